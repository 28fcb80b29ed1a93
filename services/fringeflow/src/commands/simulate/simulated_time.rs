//! Simulates the output of a live virtual scanner, with simulated time in place of the clock of the machine.
//!
//! In: a virtual scanner, and the projector and cameras of its configuration. Out: pattern events, images with their
//! headers, and the true pose of every exposure, in the order of their arrival. Projector and cameras are those of the
//! live services, including the faults; only the clock differs. Memory: the images that have not arrived yet.

use std::collections::BTreeMap;

use fringeflow_config::{ProjectorDriver, ScannerConfiguration};
use fringeflow_dataset::{CameraId, FringeSequence, GreyImage, Setup};
use fringeflow_lab::simulation::{ConfiguredScanner, Faults, PoseImages, SimulationError, VirtualScanner};
use fringeflow_pixels::{DeviceImagesError, ImageReader, UnpackError};
use fringeflow_recording::{Recordable, RecordingProblem, TruthPose};
use fringeflow_virtual_rig::cameras::{CableTriggers, ClockTriggers, Timing, Trigger, VirtualCamera};
use fringeflow_virtual_rig::projector::VirtualProjector;

/// Time of the first pattern, nanoseconds.
const START_NS: u64 = 1_000_000_000;
/// Session number of cameras and projector.
const SESSION: u64 = 1;

/// Why the simulation ended early.
#[derive(Debug, thiserror::Error)]
pub(super) enum LiveError {
    /// The projector is external, and none runs here.
    #[error("projector.driver is \"external\", but no driver runs here; set it to \"virtual\" or \"cycle\"")]
    NoProjector,
    /// Invalid option of the virtual scanner.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The format of the images does not fit their size.
    #[error(transparent)]
    Images(#[from] DeviceImagesError),
    /// An image cannot be unpacked, cropped or binned.
    #[error(transparent)]
    Image(#[from] UnpackError),
    /// Error of the recording.
    #[error(transparent)]
    Recording(#[from] RecordingProblem),
}

/// Receives the messages.
pub(super) type Sink<'s> = dyn FnMut(&Recordable<'_>) -> Result<(), RecordingProblem> + 's;

/// A running virtual scanner.
pub(super) struct LiveScanner<'a> {
    scanner: &'a VirtualScanner,
    triggers: Triggers,
    cameras: [VirtualCamera; 2],
    published: [u64; 2],
    rendered: PoseImages<'a>,
    /// Images that have not arrived yet, by number of the exposure.
    images: BTreeMap<u64, [GreyImage; 2]>,
    reader: ImageReader,
}

/// Source of the triggers of the cameras.
enum Triggers {
    Cable(Box<VirtualProjector>, CableTriggers),
    Clock(ClockTriggers),
}

impl<'a> LiveScanner<'a> {
    pub(super) fn new(
        scanner: &'a VirtualScanner,
        configuration: &ScannerConfiguration,
        options: &ConfiguredScanner,
        setup: &Setup,
    ) -> Result<Self, LiveError> {
        let faults = Faults::new(options.faults)?;
        let reader = ImageReader::new(configuration.device_images, setup.readout)?;
        let (size_px, format) = (reader.image_size_px().map(|side| side as u32), reader.pixel_format());
        let camera = |id| {
            let timing = Timing::usual(id, configuration.frame_period_ns());
            VirtualCamera::new(id, SESSION, size_px, format, timing, faults)
        };
        Ok(Self {
            scanner,
            triggers: Triggers::new(configuration, &setup.sequence, faults)?,
            cameras: CameraId::BOTH.map(camera),
            published: [0; 2],
            rendered: PoseImages::new(scanner),
            images: BTreeMap::new(),
            reader,
        })
    }

    /// Shows `patterns` patterns and runs until the last image has arrived. Calls `on_pattern` after each pattern.
    pub(super) fn run(
        &mut self,
        patterns: u64,
        sink: &mut Sink<'_>,
        mut on_pattern: impl FnMut(),
    ) -> Result<(), LiveError> {
        let (mut shown, mut now_ns) = (0, START_NS);
        loop {
            let next_pattern_ns = (shown < patterns).then(|| self.triggers.next_ns()).flatten();
            let arrivals_ns = self.cameras.iter().filter_map(VirtualCamera::next_ns);
            let Some(next_ns) = arrivals_ns.chain(next_pattern_ns).min() else { return Ok(()) };
            now_ns = next_ns.max(now_ns);
            self.deliver_arrived(now_ns, sink)?;
            if next_pattern_ns.is_some_and(|at_ns| at_ns <= now_ns) {
                for trigger in self.triggers.take_due(now_ns, sink)? {
                    self.expose(&trigger, sink)?;
                }
                shown += 1;
                on_pattern();
            }
        }
    }

    /// Renders the images of an exposure and exposes both cameras.
    fn expose(&mut self, trigger: &Trigger, sink: &mut Sink<'_>) -> Result<(), LiveError> {
        // Every trigger has a step, since the virtual projector shows only patterns of the scanner.
        let step = trigger.step.unwrap_or_default() as usize;
        let images = self.rendered.take(step)?;
        let images = self.read_out(images)?;
        self.images.insert(trigger.number, images);
        let cam1_from_object = self.scanner.cam1_from_object(trigger.number as usize);
        sink(&Recordable::TruthPose(&TruthPose { exposure_start_ns: trigger.start_ns, cam1_from_object }))?;
        for camera in &mut self.cameras {
            camera.expose(trigger);
        }
        Ok(())
    }

    /// Converts the images of an exposure to the format, crop and binning of the configuration.
    fn read_out(&mut self, mut images: [GreyImage; 2]) -> Result<[GreyImage; 2], LiveError> {
        let row_bytes = self.reader.whole_row_bytes();
        if !self.reader.is_passthrough(row_bytes) {
            let ([width, height], format) = (self.reader.image_size_px(), self.reader.pixel_format());
            for image in &mut images {
                let mut pixels = vec![0; self.reader.image_bytes()];
                self.reader.read(0, &image.pixels, row_bytes, &mut pixels)?;
                *image = GreyImage { width, height, format, pixels };
            }
        }
        Ok(images)
    }

    /// Sends the images that have arrived, and drops those that no camera will send any more.
    fn deliver_arrived(&mut self, now_ns: u64, sink: &mut Sink<'_>) -> Result<(), LiveError> {
        for (i, camera) in self.cameras.iter_mut().enumerate() {
            while let Some(shot) = camera.take_arrived(now_ns) {
                let Some(images) = self.images.get(&shot.number) else { continue };
                let header = camera.header(&shot, now_ns, self.published[i]);
                self.published[i] += 1;
                sink(&Recordable::Frame { header: &header, image: &images[i].pixels })?;
            }
        }
        let oldest = self.cameras.iter().filter_map(VirtualCamera::oldest_exposure).min().unwrap_or(u64::MAX);
        self.images = self.images.split_off(&oldest);
        Ok(())
    }
}

impl Triggers {
    fn new(configuration: &ScannerConfiguration, sequence: &FringeSequence, faults: Faults) -> Result<Self, LiveError> {
        let (rate_hz, steps) = (configuration.rate_hz, sequence.shifts_rad.len() as u32);
        match configuration.projector {
            ProjectorDriver::Virtual => {
                let mut projector = VirtualProjector::new(SESSION, rate_hz, sequence, faults);
                projector.set_scanning(true, START_NS);
                let cable = CableTriggers::new(steps, Some(configuration.frame_period_ns()));
                Ok(Self::Cable(Box::new(projector), cable))
            }
            ProjectorDriver::Cycle => {
                let mut clock = ClockTriggers::new(rate_hz, steps);
                clock.set_scanning(true, START_NS);
                Ok(Self::Clock(clock))
            }
            ProjectorDriver::External => Err(LiveError::NoProjector),
        }
    }

    fn next_ns(&self) -> Option<u64> {
        match self {
            Self::Cable(projector, _) => projector.next_ns(),
            Self::Clock(clock) => clock.next_ns(),
        }
    }

    /// The triggers of the pattern that is due at `now_ns`.
    fn take_due(&mut self, now_ns: u64, sink: &mut Sink<'_>) -> Result<Vec<Trigger>, LiveError> {
        match self {
            Self::Clock(clock) => Ok(clock.take_trigger(now_ns).map(|(_, trigger)| trigger).into_iter().collect()),
            Self::Cable(projector, cable) => {
                let Some(event) = projector.show(now_ns).and_then(|shown| shown.event) else { return Ok(Vec::new()) };
                sink(&Recordable::Pattern(&event))?;
                Ok(cable.take_event(&event))
            }
        }
    }
}
