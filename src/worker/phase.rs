//! From the images of both cameras to their phase maps.

use crate::geometry::Rig;
use crate::grey::GreyLevels;
use crate::phase::{MotionFit, PhaseMap, PhaseShifts, SequenceCheck, ShiftError, Validity, decode_into, decode_moving};

use super::sequence::SequenceFaults;

/// Decoded phase of both cameras.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhasePair {
    /// Camera 1.
    pub cam1: PhaseMap,
    /// Camera 2.
    pub cam2: PhaseMap,
}

/// Decodes the images of one rig and one cycle of shifts.
#[derive(Clone, Debug)]
pub struct PhaseWorker {
    cycle_rad: Vec<f64>,
    validity: Validity,
    cam1_px: [usize; 2],
    cam2_px: [usize; 2],
}

/// What the images of a window determine.
enum WindowFit {
    /// One cycle: the phase of a scene at rest.
    Resting(PhaseShifts),
    /// More: the phase of a moving scene at the centre of the window.
    Moving(Box<MotionFit>),
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
    /// A worker for the images of `rig` with one cycle of shifts.
    #[must_use]
    pub fn new(rig: &Rig, cycle: &PhaseShifts, validity: Validity) -> Self {
        let [cam1_px, cam2_px] = [&rig.cam1, &rig.cam2].map(|camera| [camera.width_px(), camera.height_px()]);
        Self { cycle_rad: cycle.shifts_rad().to_vec(), validity, cam1_px, cam2_px }
    }

    /// Decodes one window: images of C1 and of C2, grey levels row by row, in the order of their times, of which the first
    /// shows step `first_step` of the cycle. With more images than a cycle has, motion is compensated.
    ///
    /// # Errors
    /// Images of another number or size, or of different depths; fewer than a cycle, or more than a window has; images that
    /// tell that one of them was lost, came twice or out of turn.
    pub fn step(
        &mut self,
        first_step: usize,
        cam1: &[GreyLevels<'_>],
        cam2: &[GreyLevels<'_>],
        out: &mut PhasePair,
    ) -> Result<(), ImagesError> {
        let images = cam1.len().max(self.cycle_rad.len());
        let fit = self.fit(first_step, images)?;
        self.check_sequence(first_step, images, cam1, cam2)?;
        self.decode(1, &fit, images, cam1, self.cam1_px, &mut out.cam1)?;
        self.decode(2, &fit, images, cam2, self.cam2_px, &mut out.cam2)
    }

    /// That both cameras' images show the steps in turn.
    fn check_sequence(
        &self,
        first_step: usize,
        images: usize,
        cam1: &[GreyLevels<'_>],
        cam2: &[GreyLevels<'_>],
    ) -> Result<(), SequenceFaults> {
        let check = SequenceCheck::new(&self.cycle_rad, first_step, images);
        let of =
            |images: &[GreyLevels<'_>], [width, height]: [usize; 2]| check.fault(images, width, height, &self.validity);
        let faults = SequenceFaults { images, cam1: of(cam1, self.cam1_px), cam2: of(cam2, self.cam2_px) };
        if faults.first().is_some() { Err(faults) } else { Ok(()) }
    }

    fn fit(&self, first_step: usize, images: usize) -> Result<WindowFit, ShiftError> {
        let cycle = self.cycle_rad.iter().cycle().skip(first_step % self.cycle_rad.len().max(1));
        let shifts_rad: Vec<f64> = cycle.take(images).copied().collect();
        Ok(if images == self.cycle_rad.len() {
            WindowFit::Resting(PhaseShifts::new(&shifts_rad)?)
        } else {
            WindowFit::Moving(Box::new(MotionFit::new(&shifts_rad)?))
        })
    }

    fn decode(
        &self,
        camera: u8,
        fit: &WindowFit,
        expected_images: usize,
        images: &[GreyLevels<'_>],
        size_px: [usize; 2],
        out: &mut PhaseMap,
    ) -> Result<(), ImagesError> {
        let [width, height] = size_px;
        let decoded = match fit {
            WindowFit::Resting(shifts) => decode_into(out, images, width, height, shifts, &self.validity),
            WindowFit::Moving(fit) => decode_moving(images, width, height, fit, &self.validity).map(|map| *out = map),
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
