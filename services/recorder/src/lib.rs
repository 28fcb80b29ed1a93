//! The recorder service: messages of all channels in, recordings out.
//!
//! It always receives messages; while no recording runs, it counts them as not recorded. Messages for which the queue
//! to the disk or the disk has no room are counted as lost, in the recording too. The scan never waits for the
//! recorder.

mod channels;
mod meter;
mod session;

use fringeflow_message::{Counts, DropReason, PriorHeader, ScanState, Stage};
use fringeflow_recording::Recordable;
use fringeflow_runtime::{Account, Host, ServiceArgs, ServiceError, clock, receive};
use fringeflow_transport::{SCAN_STATE, Subscriber};

use channels::{Channels, Incoming};
use meter::Meter;
use session::Session;

/// Outcome of the recordings of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The recordings hold all messages.
    Complete,
    /// Messages are missing, or a recording failed.
    Incomplete,
}

/// Runs the service until it is to stop.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs) -> Result<Outcome, ServiceError> {
    let mut host = Host::open(arguments, "recorder")?;
    let mut channels = Channels::open(&host)?;
    let mut states = Subscriber::open(&host.node, SCAN_STATE, &host.sizes)?;
    let mut recorder = Recorder::open(&host)?;
    recorder.measure(&host);
    tracing::info!("{}", recorder.meter.status);
    loop {
        // Read before the channels are emptied, so that the last messages are recorded too.
        let is_last = host.stop.is_requested();
        recorder.drain(&mut states, &mut channels, &host);
        if is_last {
            break;
        }
        recorder.write_account()?;
        if host.is_heartbeat_due() {
            recorder.check_session();
            recorder.measure(&host);
            host.report(Stage::Recorder, recorder.account.counts(), None);
        }
        host.check_connections(|host, now_ns| {
            states.ensure_connected(now_ns)?;
            channels.ensure_connected(host, now_ns)
        });
        channels.wait(&states)?;
    }
    recorder.count_missing(channels.never_arrived(&host));
    recorder.end_session();
    recorder.write_account()?;
    host.report(Stage::Recorder, recorder.account.counts(), None);
    Ok(recorder.outcome())
}

/// The running recording, and the account of all recordings.
struct Recorder {
    account: Account,
    /// Counts outside the running recording: from before this process, of messages that were not recorded or lost in a
    /// channel, and of ended recordings.
    outside: Counts,
    session: Option<Session>,
    /// The last prior. A new recording starts with it, because windows are decoded with it until the next prior
    /// arrives.
    prior: Option<(PriorHeader, Vec<u8>)>,
    /// The last state of the instance: recordings and marks requested so far.
    last_state: Option<ScanState>,
    meter: Meter,
    has_failed: bool,
}

impl Recorder {
    fn open(host: &Host) -> Result<Self, ServiceError> {
        let account = host.open_account(Stage::Recorder)?;
        let outside = *account.counts();
        let meter = Meter::new(host, clock::now_ns());
        Ok(Self { account, outside, session: None, prior: None, last_state: None, meter, has_failed: false })
    }

    /// Follows the changes of the state, and receives all waiting messages.
    fn drain(&mut self, states: &mut Subscriber<(), ScanState>, channels: &mut Channels, host: &Host) {
        while let Some(state) = receive(states) {
            // Messages that arrived before the end of a recording or before a mark are recorded before it.
            if self.session.is_some() {
                channels.drain(|message, missing| self.record(message, missing));
            }
            self.follow_state(&state, host);
        }
        channels.drain(|message, missing| self.record(message, missing));
    }

    /// Records a message; `missing` messages before it were overwritten in its channel.
    fn record(&mut self, message: Incoming<'_>, missing: u64) {
        self.meter.add(message.bytes());
        if let Incoming::Message(Recordable::Prior { header, relief }) = &message {
            let (last_header, last_relief) = self.prior.get_or_insert_default();
            *last_header = **header;
            last_relief.clear();
            last_relief.extend_from_slice(relief);
        }
        self.count_missing(missing);
        match &mut self.session {
            Some(session) => session.record(message),
            None => {
                self.outside.taken += 1;
                self.outside.drop_one(DropReason::NotRecording);
            }
        }
    }

    /// Counts messages that did not arrive. They are lost if a recording runs, and would not have been recorded
    /// otherwise.
    fn count_missing(&mut self, missing: u64) {
        match &self.session {
            Some(session) => session.count_missing(missing),
            None => {
                self.outside.taken += missing;
                self.outside.drop_many(DropReason::NotRecording, missing);
            }
        }
    }

    /// Starts and ends recordings, and sets marks, as the state of the instance requests.
    fn follow_state(&mut self, state: &ScanState, host: &Host) {
        // After a restart of this service, the first state requests a recording that was already running.
        let is_continued = self.last_state.is_none() && host.restarts() > 0;
        let before = self.last_state.replace(*state).unwrap_or_default();
        if state.recording == 0 || state.recordings != before.recordings {
            self.end_session();
        }
        if state.recording != 0 && state.recordings != before.recordings {
            let started = Session::start(state, host, is_continued);
            self.meter.note_start(state, started.as_ref().err().map(ToString::to_string));
            match started {
                Ok(session) => {
                    if let Some((header, relief)) = &self.prior {
                        session.record(Incoming::Message(Recordable::Prior { header, relief }));
                    }
                    self.session = Some(session);
                }
                Err(error) => self.fail(&error),
            }
        }
        if let Some(session) = self.session.as_ref().filter(|_| state.marks != before.marks) {
            session.mark(clock::now_ns(), &state.mark.to_text());
        }
    }

    /// Ends the running recording, if there is one.
    fn end_session(&mut self) {
        let Some(session) = self.session.take() else { return };
        let (counts, result) = session.finish();
        self.outside = self.outside.plus(&counts);
        match result {
            Ok(file) => tracing::info!(file = %file.display(), messages = counts.passed, "recording ended"),
            Err(error) => self.fail(&error),
        }
    }

    /// Logs an error that makes the recordings of the run incomplete.
    fn fail(&mut self, error: &dyn std::fmt::Display) {
        self.has_failed = true;
        tracing::error!("{error}");
    }

    /// Logs once if the running recording has ended early.
    fn check_session(&mut self) {
        let Some(session) = &mut self.session else { return };
        if let Some(reason) = session.report_early_end() {
            let message = format!("{}: {reason}; the scan goes on without a recording", session.file().display());
            self.meter.note_early_end(reason);
            self.fail(&message);
        }
    }

    /// Measures how much a recording takes and how much room the disk has for it, and tells other processes.
    fn measure(&mut self, host: &Host) {
        let settings = &host.configuration.recorder;
        let folder = self.session.as_ref().and_then(|session| session.file().parent()).unwrap_or(&settings.folder);
        let is_recording = self.session.as_ref().is_some_and(Session::is_running);
        self.meter.update_rate(self.last_state.is_some_and(|state| state.scanning != 0), clock::now_ns());
        self.meter.update_room(folder, settings.min_free_bytes, is_recording);
        host.publish_recorder_status(&self.meter.status);
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
