//! From the images of both cameras to their phase maps.

use fringeflow_base::grey::GreyLevels;

use crate::correspondence::KnownDrift;
use crate::geometry::{FringePattern, Rig};
use crate::phase::{
    Flow, MotionFits, MotionScratch, PhaseMap, PhaseShifts, SequenceCheck, SequenceScratch, ShiftError, Validity,
    decode_following_into, decode_into, decode_moving_into,
};
use crate::prior::{Moment, Prior};

use super::sequence::SequenceFaults;

/// Decoded phase of both cameras.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhasePair {
    /// Camera 1.
    pub cam1: PhaseMap,
    /// Camera 2.
    pub cam2: PhaseMap,
    /// What is known beforehand of the drift of the calibration.
    pub known_drift: Option<KnownDrift>,
}

/// Decodes the images of one rig and one cycle of shifts.
#[derive(Clone, Debug)]
pub struct PhaseWorker {
    rig: Rig,
    pattern: FringePattern,
    cycle_rad: Vec<f64>,
    validity: Validity,
    cam1_px: [usize; 2],
    cam2_px: [usize; 2],
    /// What was worked out for windows of so many images, by the step that they begin with.
    steps: Vec<Option<WindowSteps>>,
    window_images: usize,
    /// Memory of either camera: both are decoded at once.
    scratches: [CameraScratch; 2],
}

/// Memory for the check of the steps of a camera, and for its windows of moving scenes.
#[derive(Clone, Debug, Default)]
struct CameraScratch {
    check: SequenceScratch,
    motion: MotionScratch,
}

/// What the steps of a window tell without its images.
#[derive(Clone, Debug)]
struct WindowSteps {
    /// Those of either camera, which work out what they need.
    fits: [WindowFit; 2],
    check: SequenceCheck,
}

/// What the images of a window determine.
#[derive(Clone, Debug)]
enum WindowFit {
    /// One cycle: the phase of a scene at rest.
    Resting(Box<PhaseShifts>),
    /// More: the phase of a moving scene at the centre of the window.
    Moving(Box<MotionFits>),
}

/// Images that no phase comes of.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImagesError {
    /// The images of a camera do not fit the rig or those of the other.
    #[error(
        "camera {camera}: got {images} images, of {pixels:?} pixels in {formats:?}; expected {expected_images} images of \
         {expected} pixels, all in one format"
    )]
    Camera {
        /// 1 or 2.
        camera: u8,
        /// Number of images.
        images: usize,
        /// Pixels of each.
        pixels: Vec<usize>,
        /// Format of each.
        formats: Vec<&'static str>,
        /// Number that was expected.
        expected_images: usize,
        /// Pixels that the rig's camera has.
        expected: usize,
    },
    /// Their shifts determine no phase.
    #[error(transparent)]
    Shifts(#[from] ShiftError),
    /// The images do not show the steps that are said of them.
    #[error(transparent)]
    Sequence(#[from] SequenceFaults),
}

impl PhaseWorker {
    /// A worker for the images of `rig`, lit by a pattern with one cycle of shifts.
    #[must_use]
    pub fn new(rig: &Rig, pattern: &FringePattern, cycle: &PhaseShifts, validity: Validity) -> Self {
        let [cam1_px, cam2_px] = [&rig.cam1, &rig.cam2].map(|camera| [camera.width_px(), camera.height_px()]);
        let cycle_rad = cycle.shifts_rad().to_vec();
        let steps = vec![None; cycle_rad.len()];
        Self {
            rig: rig.clone(),
            pattern: *pattern,
            cycle_rad,
            validity,
            cam1_px,
            cam2_px,
            steps,
            window_images: 0,
            scratches: Default::default(),
        }
    }

    /// Decodes one window: images of C1 and of C2, grey levels row by row, in the order of their times, of which the first
    /// shows step `first_step` of the cycle. With more images than a cycle has, motion is compensated: by what is known of it
    /// beforehand, and by what the images tell. What is known of the drift goes on with the maps.
    ///
    /// # Errors
    /// Images of another number or size, or of different depths; fewer than a cycle, or more than a window has; images that
    /// tell that one of them was lost, came twice or out of turn.
    pub fn step(
        &mut self,
        first_step: usize,
        cam1: &[GreyLevels<'_>],
        cam2: &[GreyLevels<'_>],
        known: Option<(&Prior, Moment)>,
        out: &mut PhasePair,
    ) -> Result<(), ImagesError> {
        let images = cam1.len().max(self.cycle_rad.len());
        if images != self.window_images {
            self.steps.fill(None);
            self.window_images = images;
        }
        let begin = first_step % self.cycle_rad.len();
        let mut steps = match self.steps[begin].take() {
            Some(steps) => steps,
            None => self.window_steps(begin, images)?,
        };
        let mut decode = || {
            self.check_sequence(&steps.check, images, cam1, cam2)?;
            let flows = match &steps.fits {
                [WindowFit::Moving(_), _] => {
                    known.and_then(|(prior, moment)| prior.flows(&self.rig, &self.pattern, moment))
                }
                [WindowFit::Resting(_), _] => None,
            };
            let [flow1, flow2] = flows.map_or([None, None], |flows| flows.map(Some));
            let [fit1, fit2] = &mut steps.fits;
            let Self { scratches: [scratch1, scratch2], validity, .. } = self;
            let first =
                Decoding { camera: 1, images: cam1, size_px: self.cam1_px, fit: fit1, flow: flow1, scratch: scratch1 };
            let second =
                Decoding { camera: 2, images: cam2, size_px: self.cam2_px, fit: fit2, flow: flow2, scratch: scratch2 };
            // What of one camera takes a single thread leaves the others to the other camera.
            let PhasePair { cam1, cam2, .. } = out;
            let (first, second) =
                rayon::join(|| first.decode(images, validity, cam1), || second.decode(images, validity, cam2));
            first.and(second)
        };
        let decoded = decode();
        out.known_drift = known.and_then(|(prior, _)| prior.drift);
        self.steps[begin] = Some(steps);
        decoded
    }

    /// That both cameras' images show the steps in turn.
    fn check_sequence(
        &mut self,
        check: &SequenceCheck,
        images: usize,
        cam1: &[GreyLevels<'_>],
        cam2: &[GreyLevels<'_>],
    ) -> Result<(), SequenceFaults> {
        let Self { scratches: [scratch1, scratch2], validity, .. } = self;
        let of = |scratch: &mut CameraScratch, images: &[GreyLevels<'_>], [width, height]: [usize; 2]| {
            check.fault_in(&mut scratch.check, images, width, height, validity)
        };
        let (size1_px, size2_px) = (self.cam1_px, self.cam2_px);
        let (cam1, cam2) = rayon::join(|| of(scratch1, cam1, size1_px), || of(scratch2, cam2, size2_px));
        let faults = SequenceFaults { images, cam1, cam2 };
        if faults.first().is_some() { Err(faults) } else { Ok(()) }
    }

    fn window_steps(&self, first_step: usize, images: usize) -> Result<WindowSteps, ShiftError> {
        let cycle = self.cycle_rad.iter().cycle().skip(first_step);
        let shifts_rad: Vec<f64> = cycle.take(images).copied().collect();
        let fit = if images == self.cycle_rad.len() {
            WindowFit::Resting(Box::new(PhaseShifts::new(&shifts_rad)?))
        } else {
            WindowFit::Moving(Box::new(MotionFits::new(&shifts_rad)?))
        };
        Ok(WindowSteps { fits: [fit.clone(), fit], check: SequenceCheck::new(&self.cycle_rad, first_step, images) })
    }
}

/// The decoding of the images of a camera.
struct Decoding<'a> {
    camera: u8,
    images: &'a [GreyLevels<'a>],
    size_px: [usize; 2],
    fit: &'a mut WindowFit,
    flow: Option<Flow>,
    scratch: &'a mut CameraScratch,
}

impl Decoding<'_> {
    /// Decodes so many images.
    fn decode(self, expected_images: usize, validity: &Validity, out: &mut PhaseMap) -> Result<(), ImagesError> {
        let Self { camera, images, size_px: size_px @ [width, height], fit, flow, scratch } = self;
        let scratch = &mut scratch.motion;
        let decoded = match fit {
            WindowFit::Resting(shifts) => decode_into(out, images, width, height, shifts, validity),
            WindowFit::Moving(fits) => match flow {
                Some(flow) => decode_following_into(out, scratch, images, size_px, (fits, &flow), validity),
                None => decode_moving_into(out, scratch, images, width, height, fits.resting(), validity),
            },
        };
        decoded.ok_or_else(|| ImagesError::Camera {
            camera,
            images: images.len(),
            pixels: images.iter().map(|image| image.pixels()).collect(),
            formats: images.iter().map(|image| image.format.name()).collect(),
            expected_images,
            expected: width * height,
        })
    }
}
