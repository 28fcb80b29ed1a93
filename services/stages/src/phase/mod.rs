//! The phase service: images and pattern events in, phase maps out.
//!
//! It keeps four accounts: pattern events, images (pairing), image pairs (windowing), windows (phase).

mod image;
mod intake;
mod priors;

use fringeflow::phase::{PhaseShifts, SequenceFaultKind};
use fringeflow::worker::{ImagesError, PhasePair, PhaseWorker};
use fringeflow_config::ScannerConfiguration;
use fringeflow_dataset::Setup;
use fringeflow_message::synchronization::WindowImages;
use fringeflow_message::{Block, DropReason, MapsHeader, Stage};
use fringeflow_runtime::{
    Account, AccountError, Host, ItemTimes, MAX_WAIT, POLL_INTERVAL, ServiceArgs, ServiceError, WindowSpan, clock,
};
use fringeflow_transport::{PHASE_MAPS, Publisher};
use fringeflow_wire as wire;

use image::Image;
use intake::Intake;
use priors::PriorInput;

use crate::warm_up::WarmUp;

/// Runs the service until it is to stop.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs) -> Result<(), ServiceError> {
    let mut host = Host::open(arguments, "phase")?;
    let mut worker = new_worker(&host.configuration, &host.setup)?;
    let mut maps = PhasePair::default();
    if let Some(warm_up) = WarmUp::of(&host) {
        warm_up.decode(0, &mut worker, &mut maps);
    }
    let mut intake = Intake::open(&host)?;
    let mut decoding = Decoding::open(&host, worker, maps)?;
    loop {
        // Read before the channels are emptied, so that the last images of the cameras are processed too.
        let is_last = host.stop.is_requested();
        intake.drain(|number, images| decoding.add(&mut host, number, images))?;
        decoding.decode_newest(&mut host)?;
        if is_last {
            break;
        }
        if host.is_heartbeat_due() {
            intake.report(&mut host);
            host.report(Stage::Phase, decoding.account.counts(), None);
        }
        host.check_connections(|host, now_ns| {
            intake.forgive_silence(host);
            decoding.output.ensure_connected()?;
            decoding.priors.ensure_connected(now_ns)?;
            intake.ensure_connected(now_ns)
        });
        // A waiting window is decoded once the account of the next stage shows that it is free.
        intake.wait(if decoding.newest.is_some() { POLL_INTERVAL } else { MAX_WAIT })?;
    }
    intake.end(|number, images| decoding.add(&mut host, number, images))?;
    decoding.decode_newest(&mut host)?;
    decoding.drop_newest()?;
    intake.close(&host)?;
    intake.report(&mut host);
    host.report(Stage::Phase, decoding.account.counts(), None);
    Ok(())
}

/// Returns a worker for a configuration.
pub(crate) fn new_worker(configuration: &ScannerConfiguration, setup: &Setup) -> Result<PhaseWorker, ServiceError> {
    let shifts = PhaseShifts::new(setup.cycle_shifts_rad()).map_err(|e| ServiceError::Unusable(e.to_string()))?;
    let validity = configuration.measurement.settings.validity;
    Ok(PhaseWorker::new(&setup.rig, &setup.sequence.pattern, &shifts, validity))
}

/// Makes phase maps of windows.
struct Decoding {
    account: Account,
    output: Publisher<MapsHeader, [Block]>,
    worker: PhaseWorker,
    maps: PhasePair,
    priors: PriorInput,
    /// The newest window if it is not decoded yet.
    newest: Option<WaitingWindow>,
}

/// A window that is not decoded yet.
struct WaitingWindow {
    images: WindowImages<Image>,
    taken_ns: u64,
    span: WindowSpan,
}

impl Decoding {
    fn open(host: &Host, worker: PhaseWorker, maps: PhasePair) -> Result<Self, ServiceError> {
        let mut account = host.open_account(Stage::Phase)?;
        host.catch_up(&mut account, DropReason::Restart)?;
        Ok(Self {
            account,
            output: Publisher::open(&host.node, PHASE_MAPS, &host.sizes)?,
            worker,
            maps,
            priors: PriorInput::open(host)?,
            newest: None,
        })
    }

    /// Takes a window. A previous window that is not decoded yet is dropped, unless the configuration wants no window
    /// lost.
    fn add(&mut self, host: &mut Host, number: u64, images: WindowImages<Image>) -> Result<(), ServiceError> {
        self.account.count_arrival(0, number)?;
        let span = WindowSpan::new(Stage::Phase, number);
        span.identify(&images.window);
        if self.newest.replace(WaitingWindow { images, taken_ns: clock::now_ns(), span }).is_some() {
            self.account.drop_one(DropReason::NextStageBusy)?;
        }
        if host.configuration.wait_when_busy {
            host.wait_until_free(Stage::Correspondence, &self.account);
            self.decode_newest(host)?;
        }
        Ok(())
    }

    /// Drops the newest window at the end of the run, if the next stage is still busy.
    fn drop_newest(&mut self) -> Result<(), AccountError> {
        self.newest.take().map_or(Ok(()), |_| self.account.drop_one(DropReason::NextStageBusy))
    }

    /// Decodes the newest window if the next stage is free for it. Otherwise the window waits until a newer one
    /// arrives.
    fn decode_newest(&mut self, host: &mut Host) -> Result<(), ServiceError> {
        if !host.is_free(Stage::Correspondence, &self.account) {
            return Ok(());
        }
        let Some(WaitingWindow { images, taken_ns, span }) = self.newest.take() else { return Ok(()) };
        span.work(|| self.decode(images, taken_ns, host))
    }

    fn decode(&mut self, mut images: WindowImages<Image>, taken_ns: u64, host: &mut Host) -> Result<(), ServiceError> {
        let waited_ns = clock::now_ns() - taken_ns;
        let prior = self.priors.for_window(&mut images.window);
        let [cam1, cam2] =
            [&images.cam1, &images.cam2].map(|images| images.iter().map(Image::levels).collect::<Vec<_>>());
        if let Err(error) = self.worker.step(images.window.first_step as usize, &cam1, &cam2, prior, &mut self.maps) {
            let window = &images.window;
            let [cam1, cam2] = [window.cam1_sequence[0], window.cam2_sequence[0]];
            tracing::warn!(first_image_of_camera1 = cam1, first_image_of_camera2 = cam2, "{error}");
            return Ok(self.account.drop_one(drop_reason(&error))?);
        }
        let published = self.account.count_passed()?;
        let header = wire::maps::header(&self.maps, &images.window, images.skew_ns, published);
        let header = MapsHeader { refused_windows: self.account.counts().dropped_for_images(), ..header };
        let blocks = wire::maps::blocks(self.maps.cam1.phase.len());
        let maps = &self.maps;
        // Maps that were not sent are missing in the channel, and the next stage counts them.
        if let Err(error) = self.output.send_filled(&header, blocks, |payload| wire::maps::write(maps, payload)) {
            tracing::warn!("{error}");
        }
        let (exposure_start_ns, received_ns) = (images.window.last_exposure_ns, images.window.received_ns);
        let times = ItemTimes { exposure_start_ns, received_ns, taken_ns, passed_ns: clock::now_ns(), waited_ns };
        host.report(Stage::Phase, self.account.counts(), Some(times));
        Ok(())
    }
}

/// Returns the reason for dropping a window that cannot be decoded.
fn drop_reason(error: &ImagesError) -> DropReason {
    let ImagesError::Sequence(faults) = error else { return DropReason::BadImage };
    match faults.first().map(|fault| fault.kind) {
        Some(SequenceFaultKind::Lost { .. }) => DropReason::HiddenLoss,
        Some(SequenceFaultKind::Duplicated { .. }) => DropReason::HiddenDuplicate,
        Some(SequenceFaultKind::Swapped { .. }) => DropReason::HiddenSwap,
        Some(SequenceFaultKind::Wrong { .. }) => DropReason::WrongImage,
        Some(SequenceFaultKind::Unexplained) | None => DropReason::UnexplainedImages,
    }
}
