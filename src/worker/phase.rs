//! From the images of both cameras to their phase maps.

use crate::correspondence::KnownDrift;
use crate::geometry::{FringePattern, Rig};
use crate::grey::GreyLevels;
use crate::phase::{
    Flow, MotionFits, MotionRoom, PhaseMap, PhaseShifts, SequenceCheck, SequenceRoom, ShiftError, Validity,
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
    /// Memory for the check of the steps, and for windows of moving scenes, of one camera after the other.
    check_room: SequenceRoom,
    motion_room: MotionRoom,
}

/// What the steps of a window tell without its images.
#[derive(Clone, Debug)]
struct WindowSteps {
    fit: WindowFit,
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
            check_room: SequenceRoom::default(),
            motion_room: MotionRoom::default(),
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
            let flows = match &steps.fit {
                WindowFit::Resting(_) => None,
                WindowFit::Moving(_) => known.and_then(|(prior, moment)| prior.flows(&self.rig, &self.pattern, moment)),
            };
            let [flow1, flow2] = flows.map_or([None, None], |flows| flows.map(Some));
            self.decode(1, (&mut steps.fit, flow1), images, cam1, self.cam1_px, &mut out.cam1)?;
            self.decode(2, (&mut steps.fit, flow2), images, cam2, self.cam2_px, &mut out.cam2)
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
        let Self { check_room: room, validity, .. } = self;
        let mut of = |images: &[GreyLevels<'_>], [width, height]: [usize; 2]| {
            check.fault_in(room, images, width, height, validity)
        };
        let faults = SequenceFaults { images, cam1: of(cam1, self.cam1_px), cam2: of(cam2, self.cam2_px) };
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
        Ok(WindowSteps { fit, check: SequenceCheck::new(&self.cycle_rad, first_step, images) })
    }

    fn decode(
        &mut self,
        camera: u8,
        (fit, flow): (&mut WindowFit, Option<Flow>),
        expected_images: usize,
        images: &[GreyLevels<'_>],
        size_px: [usize; 2],
        out: &mut PhaseMap,
    ) -> Result<(), ImagesError> {
        let [width, height] = size_px;
        let decoded = match fit {
            WindowFit::Resting(shifts) => decode_into(out, images, width, height, shifts, &self.validity),
            WindowFit::Moving(fits) => match flow {
                Some(flow) => {
                    let room = &mut self.motion_room;
                    decode_following_into(out, room, images, size_px, (fits, &flow), &self.validity)
                }
                None => {
                    let fit = fits.resting();
                    decode_moving_into(out, &mut self.motion_room, images, width, height, fit, &self.validity)
                }
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
