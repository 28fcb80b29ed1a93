//! The player: messages of a recording, one after the other, onto the channels of cameras and projector.

use std::collections::BTreeMap;
use std::iter::Peekable;
use std::path::{Path, PathBuf};

use fringeflow_message::{CloudHeader, FrameHeader, PatternEvent, PriorHeader, Stage, flags};
use fringeflow_recording::{Content, Message, Recording, RecordingError};
use fringeflow_runtime::{Account, AccountError, clock, receive};
use fringeflow_supervisor::{Progress, Source, SourceError};
use fringeflow_transport::{
    CAM1_FRAME, CAM2_FRAME, CLOUD, ChannelSizes, Node, PROJECTOR_PATTERN, Publisher, Subscriber, TRACKING_PRIOR,
};

use crate::pace::Pipeline;
use crate::{Comparison, Pace};

/// Messages of a recording that are still to be played.
type Messages<'a> = Peekable<Box<dyn Iterator<Item = Result<Message, RecordingError>> + 'a>>;

/// Plays a recording.
pub struct Player<'a> {
    messages: Messages<'a>,
    pace: Pace,
    /// Clouds to compare with.
    pub comparison: Comparison,
    ports: Option<Ports>,
    /// Times of the first message: when it was recorded, and when it was played.
    begun_ns: Option<(u64, u64)>,
}

/// Channels and accounts in the place of cameras and projector.
struct Ports {
    cameras: [Publisher<FrameHeader, [u8]>; 2],
    events: Publisher<(), PatternEvent>,
    priors: Publisher<PriorHeader, [u8]>,
    clouds: Subscriber<CloudHeader, [u8]>,
    /// Of both cameras.
    image_accounts: [Account; 2],
    event_account: Account,
    /// Events so far, by the session of their driver: each session is numbered without gaps, as a driver does it.
    announced: BTreeMap<u64, u64>,
    accounts: PathBuf,
    clouds_seen: u64,
    /// The pipeline at the last change, and when it last changed or got something.
    pipeline: (Pipeline, u64),
}

/// Time after which a pipeline at rest that has not got everything will not get it any more, nanoseconds: longer than a
/// service takes to find a lost connection.
const PATIENCE_NS: u64 = 10_000_000_000;

impl<'a> Player<'a> {
    /// A player of everything that cameras and projector put into a recording.
    #[must_use]
    pub fn new(recording: &'a Recording, pace: Pace, comparison: Comparison) -> Self {
        let is_played = |message: &Result<Message, RecordingError>| {
            let is_input =
                |m: &Message| matches!(m.content, Content::Frame(..) | Content::Pattern(_) | Content::Prior(..));
            message.as_ref().map_or(true, is_input)
        };
        let messages: Box<dyn Iterator<Item = _>> = Box::new(recording.messages().filter(is_played));
        Self { messages: messages.peekable(), pace, comparison, ports: None, begun_ns: None }
    }

    /// When a message is due, by the clock of this machine; `None` where it is due once the pipeline is idle.
    fn due_ns(&mut self, log_ns: u64) -> Option<u64> {
        let Pace::Rate(rate) = self.pace else { return None };
        let (recorded_ns, played_ns) = *self.begun_ns.get_or_insert_with(|| (log_ns, clock::now_ns()));
        Some(played_ns + (log_ns.saturating_sub(recorded_ns) as f64 / rate) as u64)
    }
}

impl Source for Player<'_> {
    fn open(&mut self, node: &Node, sizes: &ChannelSizes, accounts: &Path) -> Result<(), SourceError> {
        self.ports = Some(Ports::open(node, sizes, accounts)?);
        Ok(())
    }

    fn turn(&mut self) -> Result<Progress, SourceError> {
        loop {
            let Some(ports) = &mut self.ports else { return Ok(Progress::Waiting) };
            ports.see_clouds(&mut self.comparison);
            // At a steady rate nobody waits for the pipeline.
            let is_idle = self.pace != Pace::Fastest || ports.is_idle();
            let Some(next) = self.messages.peek() else {
                return Ok(if is_idle { Progress::Finished } else { Progress::Waiting });
            };
            let log_ns = next.as_ref().map_or(0, |message| message.log_ns);
            match self.due_ns(log_ns) {
                Some(due_ns) if clock::now_ns() < due_ns => return Ok(Progress::Next(due_ns)),
                None if !is_idle => return Ok(Progress::Waiting),
                _ => {}
            }
            if let (Some(message), Some(ports)) = (self.messages.next(), &mut self.ports) {
                ports.put_out(&message?)?;
            }
        }
    }

    fn close(&mut self) {
        self.ports = None;
    }
}

impl Ports {
    fn open(node: &Node, sizes: &ChannelSizes, accounts: &Path) -> Result<Self, SourceError> {
        Ok(Self {
            cameras: [Publisher::open(node, CAM1_FRAME, sizes)?, Publisher::open(node, CAM2_FRAME, sizes)?],
            events: Publisher::open(node, PROJECTOR_PATTERN, sizes)?,
            priors: Publisher::open(node, TRACKING_PRIOR, sizes)?,
            clouds: Subscriber::open(node, CLOUD, sizes)?,
            image_accounts: [Account::open(accounts, Stage::Camera1)?, Account::open(accounts, Stage::Camera2)?],
            event_account: Account::open(accounts, Stage::Projector)?,
            announced: BTreeMap::new(),
            accounts: accounts.to_owned(),
            clouds_seen: 0,
            pipeline: (Pipeline::default(), 0),
        })
    }

    fn see_clouds(&mut self, comparison: &mut Comparison) {
        while let Some(cloud) = receive(&mut self.clouds) {
            comparison.add(cloud.header(), cloud.payload());
            self.clouds_seen = cloud.header().published + 1;
        }
    }

    /// Whether everything that was put out has gone through, and its clouds were seen, or will not be any more.
    fn is_idle(&mut self) -> bool {
        let (pipeline, now_ns) = (Pipeline::read(&self.accounts), clock::now_ns());
        let images = self.image_accounts.iter().map(|account| account.counts().passed).sum();
        if pipeline.has_worked_off(images, self.event_account.counts().passed, self.clouds_seen) {
            return true;
        }
        if pipeline != self.pipeline.0 {
            self.pipeline = (pipeline, now_ns);
            return false;
        }
        self.pipeline.0.is_at_rest() && now_ns.saturating_sub(self.pipeline.1) >= PATIENCE_NS
    }

    /// Puts out a message under the next number of its channel.
    fn put_out(&mut self, message: &Message) -> Result<(), AccountError> {
        let sent = match &message.content {
            Content::Frame(header, image) => {
                let camera = usize::from(header.camera == 2);
                let published = {
                    self.image_accounts[camera].take(1)?;
                    self.image_accounts[camera].pass()?
                };
                let header = FrameHeader { published, flags: header.flags | flags::REPLAYED, ..*header };
                self.cameras[camera].send(&header, image)
            }
            Content::Pattern(event) => {
                let announced = self.announced.entry(event.session).or_default();
                let sequence = *announced;
                *announced += 1;
                self.event_account.take(1)?;
                self.event_account.pass_as(event.session, sequence)?;
                self.events.send_message(&PatternEvent { sequence, ..*event })
            }
            Content::Prior(header, relief) => self.priors.send(header, relief),
            _ => Ok(()),
        };
        // What could not be sent is missing in the channel, and counted there.
        if let Err(error) = sent {
            tracing::warn!("{error}");
        }
        self.pipeline.1 = clock::now_ns();
        Ok(())
    }
}
