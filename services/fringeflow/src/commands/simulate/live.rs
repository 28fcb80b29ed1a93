//! What a virtual scanner would deliver live, in its own time instead of the machine's.
//!
//! In: a virtual scanner, and the projector and cameras of its configuration. Out: pattern events, images with their
//! headers, and the true pose of every exposure, in the order in which they come. The very same projector and cameras run
//! live, faults included; only the clock is another. Memory: the images that are on their way.

use std::collections::BTreeMap;

use fringeflow_config::{ProjectorDriver, ScannerConfiguration};
use fringeflow_dataset::{CameraId, FringeSequence, GreyImage, Setup};
use fringeflow_lab::simulation::{ConfiguredScanner, Faults, PoseImages, SimulationError, VirtualScanner};
use fringeflow_pixels::{ImageReader, UnpackError};
use fringeflow_recording::{Recordable, RecordingProblem, TruthPose};
use fringeflow_virtual_rig::cameras::{CableTriggers, ClockTriggers, Timing, Trigger, VirtualCamera};
use fringeflow_virtual_rig::projector::VirtualProjector;

/// When the first pattern is shown, nanoseconds.
const START_NS: u64 = 1_000_000_000;
/// Session of cameras and projector.
const SESSION: u64 = 1;

/// Why it ended too early.
#[derive(Debug, thiserror::Error)]
pub(super) enum LiveError {
    /// Nobody shows patterns.
    #[error("projector.driver is \"external\", but no driver runs here; set it to \"virtual\" or \"cycle\"")]
    NoProjector,
    /// An option of the virtual scanner.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// What is used of an image.
    #[error(transparent)]
    Image(#[from] UnpackError),
    /// The recording.
    #[error(transparent)]
    Recording(#[from] RecordingProblem),
}

/// Takes what comes.
pub(super) type Sink<'s> = dyn FnMut(&Recordable<'_>) -> Result<(), RecordingProblem> + 's;

/// A virtual scanner that runs.
pub(super) struct LiveScanner<'a> {
    scanner: &'a VirtualScanner,
    triggers: Triggers,
    cameras: [VirtualCamera; 2],
    published: [u64; 2],
    rendered: PoseImages<'a>,
    /// Images of exposures that are on their way, by number.
    images: BTreeMap<u64, [GreyImage; 2]>,
    reader: ImageReader,
}

/// What makes the cameras expose.
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
        let reader = ImageReader::new(configuration.source_format, setup.readout);
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

    /// Runs for so many patterns, and until the last image has come; `on_pattern` is called after each pattern.
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
            self.put_out(now_ns, sink)?;
            if next_pattern_ns.is_some_and(|at_ns| at_ns <= now_ns) {
                for trigger in self.triggers.take(now_ns, sink)? {
                    self.expose(&trigger, sink)?;
                }
                shown += 1;
                on_pattern();
            }
        }
    }

    /// Both cameras expose.
    fn expose(&mut self, trigger: &Trigger, sink: &mut Sink<'_>) -> Result<(), LiveError> {
        // The projector shows no step that the scanner has not.
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

    /// What is used of the images of an exposure.
    fn read_out(&mut self, mut images: [GreyImage; 2]) -> Result<[GreyImage; 2], LiveError> {
        let row_bytes = self.reader.whole_row_bytes();
        if !self.reader.is_passthrough(row_bytes) {
            let ([width, height], format) = (self.reader.image_size_px(), self.reader.pixel_format());
            for image in &mut images {
                let mut pixels = vec![0; self.reader.image_bytes()];
                self.reader.read(&image.pixels, row_bytes, &mut pixels)?;
                *image = GreyImage { width, height, format, pixels };
            }
        }
        Ok(images)
    }

    /// Hands over the images that have arrived, and forgets those that no camera sends any more.
    fn put_out(&mut self, now_ns: u64, sink: &mut Sink<'_>) -> Result<(), LiveError> {
        for (i, camera) in self.cameras.iter_mut().enumerate() {
            while let Some(shot) = camera.arrived(now_ns) {
                let Some(images) = self.images.get(&shot.number) else { continue };
                let header = camera.header(&shot, now_ns, self.published[i]);
                self.published[i] += 1;
                sink(&Recordable::Frame { header: &header, image: &images[i].pixels })?;
            }
        }
        let oldest = self.cameras.iter().filter_map(VirtualCamera::oldest).min().unwrap_or(u64::MAX);
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
                projector.scan(true, START_NS);
                let cable = CableTriggers::new(steps, Some(configuration.frame_period_ns()));
                Ok(Self::Cable(Box::new(projector), cable))
            }
            ProjectorDriver::Cycle => {
                let mut clock = ClockTriggers::new(rate_hz, steps);
                clock.scan(true, START_NS);
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

    /// The triggers of the pattern whose time has come.
    fn take(&mut self, now_ns: u64, sink: &mut Sink<'_>) -> Result<Vec<Trigger>, LiveError> {
        match self {
            Self::Clock(clock) => Ok(clock.take(now_ns).map(|(_, trigger)| trigger).into_iter().collect()),
            Self::Cable(projector, cable) => {
                let Some(event) = projector.show(now_ns).and_then(|shown| shown.event) else { return Ok(Vec::new()) };
                sink(&Recordable::Pattern(&event))?;
                Ok(cable.of_event(&event))
            }
        }
    }
}
