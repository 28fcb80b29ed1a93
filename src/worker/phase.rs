//! From the images of both cameras to their phase maps.

use crate::geometry::Rig;
use crate::grey::GreyLevels;
use crate::phase::{PhaseMap, PhaseShifts, Validity, decode};

/// Decoded phase of both cameras.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhasePair {
    /// Camera 1.
    pub cam1: PhaseMap,
    /// Camera 2.
    pub cam2: PhaseMap,
}

/// Decodes the images of one rig and one sequence of shifts.
#[derive(Clone, Debug)]
pub struct PhaseWorker {
    shifts: PhaseShifts,
    validity: Validity,
    cam1_px: [usize; 2],
    cam2_px: [usize; 2],
}

/// The images of a camera do not fit the rig or the shifts.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "camera {camera}: got {images} images, of {pixels:?} pixels in {formats:?}; expected {steps} images of {expected} \
     pixels, all in one format"
)]
pub struct ImagesError {
    /// 1 or 2.
    pub camera: u8,
    /// Number of images.
    pub images: usize,
    /// Pixels of each.
    pub pixels: Vec<usize>,
    /// Format of each.
    pub formats: Vec<&'static str>,
    /// Number of shifts.
    pub steps: usize,
    /// Pixels that the rig's camera has.
    pub expected: usize,
}

impl PhaseWorker {
    /// A worker for the images of `rig` with these shifts.
    #[must_use]
    pub fn new(rig: &Rig, shifts: PhaseShifts, validity: Validity) -> Self {
        let [cam1_px, cam2_px] = [&rig.cam1, &rig.cam2].map(|camera| [camera.width_px(), camera.height_px()]);
        Self { shifts, validity, cam1_px, cam2_px }
    }

    /// Decodes one sequence: the images of C1 and of C2, grey levels row by row, in the order of the shifts.
    ///
    /// # Errors
    /// Images of another number or size, or of different depths.
    pub fn step(
        &mut self,
        cam1: &[GreyLevels<'_>],
        cam2: &[GreyLevels<'_>],
        out: &mut PhasePair,
    ) -> Result<(), ImagesError> {
        out.cam1 = self.decode(1, cam1, self.cam1_px)?;
        out.cam2 = self.decode(2, cam2, self.cam2_px)?;
        Ok(())
    }

    fn decode(&self, camera: u8, images: &[GreyLevels<'_>], size_px: [usize; 2]) -> Result<PhaseMap, ImagesError> {
        let [width, height] = size_px;
        decode(images, width, height, &self.shifts, &self.validity).ok_or_else(|| ImagesError {
            camera,
            images: images.len(),
            pixels: images.iter().map(|image| image.pixels()).collect(),
            formats: images.iter().map(|image| image.format.name()).collect(),
            steps: self.shifts.steps(),
            expected: width * height,
        })
    }
}
