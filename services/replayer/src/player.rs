//! Plays the messages of a recording, in order, onto the channels of cameras and projector.

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

use crate::pace::PipelineCounts;
use crate::{Comparison, Pace};

/// Messages of a recording that are still to be played.
type Messages<'a> = Peekable<Box<dyn Iterator<Item = Result<Message, RecordingError>> + 'a>>;

/// Plays a recording.
pub struct Player<'a> {
    messages: Messages<'a>,
    pace: Pace,
    /// Comparison with the recorded clouds.
    pub comparison: Comparison,
    ports: Option<Ports>,
    /// When the first message was recorded, and when it was played.
    start_ns: Option<(u64, u64)>,
}

/// Channels and accounts of the replaced cameras and projector.
struct Ports {
    cameras: [Publisher<FrameHeader, [u8]>; 2],
    events: Publisher<(), PatternEvent>,
    priors: Publisher<PriorHeader, [u8]>,
    clouds: Subscriber<CloudHeader, [u8]>,
    /// Accounts of both cameras.
    image_accounts: [Account; 2],
    event_account: Account,
    /// Number of the next event, by the session of the projector driver. Each session is numbered without gaps, as a
    /// driver does it.
    next_sequences: BTreeMap<u64, u64>,
    accounts: PathBuf,
    received_clouds: u64,
    /// The counts at their last change, and when they changed or a message was sent.
    pipeline: (PipelineCounts, u64),
}

/// If a pipeline is idle for this time, messages that it has not received are lost, nanoseconds. A service finds a lost
/// connection in less time.
const IDLE_TIMEOUT_NS: u64 = 10_000_000_000;

impl<'a> Player<'a> {
    /// Creates a player of the images, pattern events and priors of a recording.
    #[must_use]
    pub fn new(recording: &'a Recording, pace: Pace, comparison: Comparison) -> Self {
        let is_played = |message: &Result<Message, RecordingError>| {
            let is_input =
                |m: &Message| matches!(m.content, Content::Frame(..) | Content::Pattern(_) | Content::Prior(..));
            message.as_ref().map_or(true, is_input)
        };
        let messages: Box<dyn Iterator<Item = _>> = Box::new(recording.messages().filter(is_played));
        Self { messages: messages.peekable(), pace, comparison, ports: None, start_ns: None }
    }

    /// Returns when a message is due, on the clock of this machine. Returns `None` if it is due as soon as the pipeline
    /// has processed the messages before it.
    fn due_ns(&mut self, log_ns: u64) -> Option<u64> {
        let Pace::Rate(rate) = self.pace else { return None };
        let (recorded_ns, played_ns) = *self.start_ns.get_or_insert_with(|| (log_ns, clock::now_ns()));
        Some(played_ns + (log_ns.saturating_sub(recorded_ns) as f64 / rate) as u64)
    }
}

impl Source for Player<'_> {
    fn open(&mut self, node: &Node, sizes: &ChannelSizes, accounts: &Path) -> Result<(), SourceError> {
        self.ports = Some(Ports::open(node, sizes, accounts)?);
        Ok(())
    }

    fn publish_due(&mut self) -> Result<Progress, SourceError> {
        loop {
            let Some(ports) = &mut self.ports else { return Ok(Progress::Waiting) };
            ports.compare_clouds(&mut self.comparison);
            // At a fixed rate the player does not wait for the pipeline.
            let is_ready = self.pace != Pace::Fastest || ports.has_pipeline_finished();
            let Some(next) = self.messages.peek() else {
                return Ok(if is_ready { Progress::Finished } else { Progress::Waiting });
            };
            let log_ns = next.as_ref().map_or(0, |message| message.log_ns);
            match self.due_ns(log_ns) {
                Some(due_ns) if clock::now_ns() < due_ns => return Ok(Progress::Next(due_ns)),
                None if !is_ready => return Ok(Progress::Waiting),
                _ => {}
            }
            if let (Some(message), Some(ports)) = (self.messages.next(), &mut self.ports) {
                ports.send(&message?)?;
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
            next_sequences: BTreeMap::new(),
            accounts: accounts.to_owned(),
            received_clouds: 0,
            pipeline: (PipelineCounts::default(), 0),
        })
    }

    /// Receives the waiting clouds and compares them.
    fn compare_clouds(&mut self, comparison: &mut Comparison) {
        while let Some(cloud) = receive(&mut self.clouds) {
            comparison.add(cloud.header(), cloud.payload());
            self.received_clouds = cloud.header().published + 1;
        }
    }

    /// Returns whether the pipeline has processed all messages sent so far, and their clouds were received. Also true
    /// if messages or clouds are lost.
    fn has_pipeline_finished(&mut self) -> bool {
        let (pipeline, now_ns) = (PipelineCounts::read(&self.accounts), clock::now_ns());
        let images = self.image_accounts.iter().map(|account| account.counts().passed).sum();
        if pipeline.has_processed(images, self.event_account.counts().passed, self.received_clouds) {
            return true;
        }
        if pipeline != self.pipeline.0 {
            self.pipeline = (pipeline, now_ns);
            return false;
        }
        self.pipeline.0.is_idle() && now_ns.saturating_sub(self.pipeline.1) >= IDLE_TIMEOUT_NS
    }

    /// Sends a message with the next number of its channel.
    fn send(&mut self, message: &Message) -> Result<(), AccountError> {
        let sent = match &message.content {
            Content::Frame(header, image) => {
                let camera = usize::from(header.camera == 2);
                let published = {
                    self.image_accounts[camera].count_taken(1)?;
                    self.image_accounts[camera].count_passed()?
                };
                let header = FrameHeader { published, flags: header.flags | flags::REPLAYED, ..*header };
                self.cameras[camera].send(&header, image)
            }
            Content::Pattern(event) => {
                let next_sequence = self.next_sequences.entry(event.session).or_default();
                let sequence = *next_sequence;
                *next_sequence += 1;
                self.event_account.count_taken(1)?;
                self.event_account.count_passed_item(event.session, sequence)?;
                self.events.send_message(&PatternEvent { sequence, ..*event })
            }
            Content::Prior(header, relief) => self.priors.send(header, relief),
            _ => Ok(()),
        };
        // A message that was not sent is missing in the channel, and the next stage counts it.
        if let Err(error) = sent {
            tracing::warn!("{error}");
        }
        self.pipeline.1 = clock::now_ns();
        Ok(())
    }
}
