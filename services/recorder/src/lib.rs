//! The recorder service: every channel in, recordings out.
//!
//! It always listens; while no recording runs, messages are counted as such. What the queue to the disk cannot take, or the
//! disk cannot hold, is counted, and stands in the recording too; the scan is never held up.

mod channels;
mod session;

use fringeflow_message::{Counts, DropReason, PriorHeader, ScanState, Stage};
use fringeflow_recording::Recordable;
use fringeflow_runtime::{Account, Host, ServiceArgs, ServiceError, clock, receive};
use fringeflow_transport::{SCAN_STATE, Subscriber};

use channels::{Channels, Taken};
use session::Session;

/// What came of the recordings of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// They hold everything.
    Complete,
    /// Something is missing in them.
    Incomplete,
}

/// Runs the service until it is to end.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs) -> Result<Outcome, ServiceError> {
    let mut host = Host::open(arguments, "recorder")?;
    let mut channels = Channels::open(&host)?;
    let mut state = Subscriber::open(&host.node, SCAN_STATE, &host.sizes)?;
    let mut recorder = Recorder::open(&host)?;
    loop {
        // Asked before the channels are emptied, so that what came last is recorded.
        let is_last = host.stop.is_requested();
        recorder.drain(&mut state, &mut channels, &host);
        if is_last {
            break;
        }
        recorder.write_account()?;
        if host.beat_is_due() {
            recorder.tell();
            host.report(Stage::Recorder, recorder.account.counts(), None);
        }
        host.tend(|host, now_ns| {
            state.ensure_connected(now_ns)?;
            channels.ensure_connected(host, now_ns)
        });
        channels.wait(&state)?;
    }
    recorder.end();
    recorder.write_account()?;
    host.report(Stage::Recorder, recorder.account.counts(), None);
    Ok(recorder.outcome())
}

/// The running recording, and the account over all of them.
struct Recorder {
    account: Account,
    /// Counts outside the running recording: before this process, not recording, lost in a channel, recordings ended.
    outside: Counts,
    session: Option<Session>,
    /// The last prior: windows of a recording that begins now are decoded with it until the next one comes.
    prior: Option<(PriorHeader, Vec<u8>)>,
    /// Recordings and marks asked for so far.
    seen: Option<ScanState>,
    has_failed: bool,
}

impl Recorder {
    fn open(host: &Host) -> Result<Self, ServiceError> {
        let account = host.account(Stage::Recorder)?;
        let outside = *account.counts();
        Ok(Self { account, outside, session: None, prior: None, seen: None, has_failed: false })
    }

    /// Follows the state, and takes what has come.
    fn drain(&mut self, state: &mut Subscriber<(), ScanState>, channels: &mut Channels, host: &Host) {
        while let Some(wanted) = receive(state) {
            // Everything that came before the end of a recording, or before a mark, comes before it there too.
            if self.session.is_some() {
                channels.drain(|message, missing| self.take(message, missing));
            }
            self.follow(&wanted, host);
        }
        channels.drain(|message, missing| self.take(message, missing));
    }

    /// Takes a message, before which so many were overwritten in its channel.
    fn take(&mut self, message: Taken<'_>, missing: u64) {
        self.outside.taken += missing;
        self.outside.drop_many(DropReason::Overrun, missing);
        if let Taken::Message(Recordable::Prior { header, relief }) = &message {
            let (last, cells) = self.prior.get_or_insert_default();
            *last = **header;
            cells.clear();
            cells.extend_from_slice(relief);
        }
        match &mut self.session {
            Some(session) => session.take(message, missing),
            None => {
                self.outside.taken += 1;
                self.outside.drop_one(DropReason::NotRecording);
            }
        }
    }

    /// Begins and ends recordings and sets marks as the instance asks.
    fn follow(&mut self, wanted: &ScanState, host: &Host) {
        // What was asked for before this process began is gone on with.
        let is_continued = self.seen.is_none() && host.restarts() > 0;
        let before = self.seen.replace(*wanted).unwrap_or_default();
        if wanted.recording == 0 || wanted.recordings != before.recordings {
            self.end();
        }
        if wanted.recording != 0 && wanted.recordings != before.recordings {
            match Session::begin(wanted, host, is_continued) {
                Ok(session) => {
                    if let Some((header, relief)) = &self.prior {
                        session.take(Taken::Message(Recordable::Prior { header, relief }), 0);
                    }
                    self.session = Some(session);
                }
                Err(error) => self.fail(&error),
            }
        }
        if let Some(session) = self.session.as_ref().filter(|_| wanted.marks != before.marks) {
            session.mark(clock::now_ns(), &wanted.mark.to_text());
        }
    }

    /// Ends the running recording, if there is one.
    fn end(&mut self) {
        let Some(session) = self.session.take() else { return };
        let (counts, result) = session.end();
        self.outside = self.outside.plus(&counts);
        match result {
            Ok(file) => tracing::info!(file = %file.display(), messages = counts.passed, "recording ended"),
            Err(error) => self.fail(&error),
        }
    }

    fn fail(&mut self, error: &dyn std::fmt::Display) {
        self.has_failed = true;
        tracing::error!("{error}");
    }

    /// Says once if the running recording has come to a standstill.
    fn tell(&mut self) {
        if let Some(why) = self.session.as_mut().and_then(Session::standstill) {
            self.fail(&why);
        }
    }

    fn write_account(&mut self) -> Result<(), ServiceError> {
        let counts = self.session.as_ref().map_or(self.outside, |session| self.outside.plus(&session.counts()));
        if counts != *self.account.counts() {
            self.account.set(&counts, &[])?;
        }
        Ok(())
    }

    fn outcome(&self) -> Outcome {
        let is_lost = self.outside.losses().next().is_some();
        if is_lost || self.has_failed { Outcome::Incomplete } else { Outcome::Complete }
    }
}
