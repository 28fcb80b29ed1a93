//! First stage. In: the images of both cameras. Out: their phase maps. Cost: see [`crate::phase`]; both at once.

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
    /// Drift of the calibration known from earlier windows.
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
    /// Solvers for windows of `window_images` images, by their first step. Made when first needed.
    solvers: Vec<Option<WindowSolver>>,
    window_images: usize,
    /// Scratch memory of each camera: both are decoded at once.
    scratches: [CameraScratch; 2],
}

/// Scratch memory for the images of one camera.
#[derive(Clone, Debug, Default)]
struct CameraScratch {
    check: SequenceScratch,
    motion: MotionScratch,
}

/// The part of decoding a window that depends on its steps alone.
#[derive(Clone, Debug)]
struct WindowSolver {
    /// One per camera: each caches fits of its own.
    fits: [WindowFit; 2],
    check: SequenceCheck,
}

/// How the phase of a window is fitted.
#[derive(Clone, Debug)]
enum WindowFit {
    /// One cycle of images: the scene rests.
    Resting(Box<PhaseShifts>),
    /// More than a cycle: the scene moves; the phase is that at the centre of the window.
    Moving(Box<MotionFits>),
}

/// Why images yield no phase.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImagesError {
    /// The images of a camera do not fit the rig or the images of the other camera.
    #[error(
        "camera {camera}: got {images} images, of {pixels:?} pixels in {formats:?}; expected {expected_images} images \
         of {expected} pixels, all in one format"
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
        /// Expected number of images.
        expected_images: usize,
        /// Pixels of the rig's camera.
        expected: usize,
    },
    /// The shifts do not determine a phase.
    #[error(transparent)]
    Shifts(#[from] ShiftError),
    /// The images do not show the declared steps.
    #[error(transparent)]
    Sequence(#[from] SequenceFaults),
}

impl PhaseWorker {
    /// A worker for the images of `rig`, illuminated by a pattern with one cycle of shifts.
    #[must_use]
    pub fn new(rig: &Rig, pattern: &FringePattern, cycle: &PhaseShifts, validity: Validity) -> Self {
        let [cam1_px, cam2_px] = [&rig.cam1, &rig.cam2].map(|camera| [camera.width_px(), camera.height_px()]);
        let cycle_rad = cycle.shifts_rad().to_vec();
        let solvers = vec![None; cycle_rad.len()];
        Self {
            rig: *rig,
            pattern: *pattern,
            cycle_rad,
            validity,
            cam1_px,
            cam2_px,
            solvers,
            window_images: 0,
            scratches: Default::default(),
        }
    }

    /// Decodes one window: images of C1 and C2, grey levels row by row, in order of time. The first image shows step
    /// `first_step` of the cycle.
    ///
    /// A window of more images than a cycle is compensated for motion, with the help of `prior` if there is one. The
    /// drift of the prior is passed on with the maps.
    ///
    /// # Errors
    /// Images of wrong number or size, or of different depths; fewer than a cycle, or more than a window holds; images
    /// that show that one of them was lost, repeated or exchanged.
    pub fn step(
        &mut self,
        first_step: usize,
        cam1: &[GreyLevels<'_>],
        cam2: &[GreyLevels<'_>],
        prior: Option<(&Prior, Moment)>,
        out: &mut PhasePair,
    ) -> Result<(), ImagesError> {
        let images = cam1.len().max(self.cycle_rad.len());
        if images != self.window_images {
            self.solvers.fill(None);
            self.window_images = images;
        }
        let begin = first_step % self.cycle_rad.len();
        let mut solver = match self.solvers[begin].take() {
            Some(solver) => solver,
            None => self.window_solver(begin, images)?,
        };
        let mut decode = || {
            self.check_sequence(&solver.check, images, cam1, cam2)?;
            let flows = match &solver.fits {
                [WindowFit::Moving(_), _] => {
                    prior.and_then(|(prior, moment)| prior.flows(&self.rig, &self.pattern, moment))
                }
                [WindowFit::Resting(_), _] => None,
            };
            let [flow1, flow2] = flows.map_or([None, None], |flows| flows.map(Some));
            let [fit1, fit2] = &mut solver.fits;
            let Self { scratches: [scratch1, scratch2], validity, .. } = self;
            let first =
                Decoding { camera: 1, images: cam1, size_px: self.cam1_px, fit: fit1, flow: flow1, scratch: scratch1 };
            let second =
                Decoding { camera: 2, images: cam2, size_px: self.cam2_px, fit: fit2, flow: flow2, scratch: scratch2 };
            // Both at once: while one camera is in a serial part, the other keeps the remaining threads busy.
            let PhasePair { cam1, cam2, .. } = out;
            let (first, second) =
                rayon::join(|| first.decode(images, validity, cam1), || second.decode(images, validity, cam2));
            first.and(second)
        };
        let decoded = decode();
        out.known_drift = prior.and_then(|(prior, _)| prior.drift);
        self.solvers[begin] = Some(solver);
        decoded
    }

    /// Checks that the images of both cameras show the steps in turn.
    fn check_sequence(
        &mut self,
        check: &SequenceCheck,
        images: usize,
        cam1: &[GreyLevels<'_>],
        cam2: &[GreyLevels<'_>],
    ) -> Result<(), SequenceFaults> {
        let Self { scratches: [scratch1, scratch2], validity, .. } = self;
        let find_fault = |scratch: &mut CameraScratch, images: &[GreyLevels<'_>], [width, height]: [usize; 2]| {
            check.find_fault_in(&mut scratch.check, images, width, height, validity)
        };
        let (size1_px, size2_px) = (self.cam1_px, self.cam2_px);
        let (cam1, cam2) =
            rayon::join(|| find_fault(scratch1, cam1, size1_px), || find_fault(scratch2, cam2, size2_px));
        let faults = SequenceFaults { images, cam1, cam2 };
        if faults.first().is_some() { Err(faults) } else { Ok(()) }
    }

    fn window_solver(&self, first_step: usize, images: usize) -> Result<WindowSolver, ShiftError> {
        let cycle = self.cycle_rad.iter().cycle().skip(first_step);
        let shifts_rad: Vec<f64> = cycle.take(images).copied().collect();
        let fit = if images == self.cycle_rad.len() {
            WindowFit::Resting(Box::new(PhaseShifts::new(&shifts_rad)?))
        } else {
            WindowFit::Moving(Box::new(MotionFits::new(&shifts_rad)?))
        };
        Ok(WindowSolver { fits: [fit.clone(), fit], check: SequenceCheck::new(&self.cycle_rad, first_step, images) })
    }
}

/// Inputs of decoding the images of one camera.
struct Decoding<'a> {
    camera: u8,
    images: &'a [GreyLevels<'a>],
    size_px: [usize; 2],
    fit: &'a mut WindowFit,
    flow: Option<Flow>,
    scratch: &'a mut CameraScratch,
}

impl Decoding<'_> {
    /// Decodes the images into `out`.
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
