//! The fits of a window, by how far what is seen is known to move through the fringes.

use crate::phase::shifts::ShiftError;

use super::fit::{MotionFit, time};

/// Motions that one fit serves, rad an image: what they differ by is left to the motion of each pixel.
const BIN_RAD: f32 = 0.1;
/// Fits to either side of rest: up to half a turn an image.
const BINS: usize = 31;
/// Noise of the phase up to which a motion may be followed: compared with that of a resting scene, or per unit of noise ÷
/// modulation, about what four images make of it. Beyond, the surface moves so much with the fringes that its images hardly differ.
const MAX_NOISE: f32 = 1.25;
const MAX_NOISE_GAIN: f32 = 0.75;
/// Least motion, beyond what is followed, that a fit must tell, rad an image.
const LEAST_LIMIT_RAD: f32 = 0.3;

/// Fits of images with the same shifts for surfaces that are followed; each is worked out when it is first asked for.
#[derive(Clone, Debug)]
pub struct MotionFits {
    resting: MotionFit,
    /// `None` where nobody asked yet; from the motion that lowers the phase most to the one that raises it most.
    moving: Vec<Option<Followable>>,
}

/// A fit for a motion, if the images tell phases there.
#[derive(Clone, Debug)]
struct Followable(Option<Box<MotionFit>>);

impl MotionFits {
    /// The fits of images with these shifts, rad, in the order of their times.
    ///
    /// # Errors
    /// As [`MotionFit::new`].
    pub fn new(shifts_rad: &[f64]) -> Result<Self, ShiftError> {
        Ok(Self { resting: MotionFit::new(shifts_rad)?, moving: vec![None; 2 * BINS + 1] })
    }

    /// The fit of a scene of which nothing is known.
    #[must_use]
    pub fn resting(&self) -> &MotionFit {
        &self.resting
    }

    /// The bin of a motion whose phases the images tell, and works its fit out.
    pub(super) fn bin_for(&mut self, motion_rad: f32) -> Option<Bin> {
        let place = (motion_rad / BIN_RAD).round();
        if place.abs() > BINS as f32 {
            return None;
        }
        let bin = (place + BINS as f32) as usize;
        let Self { resting, moving } = self;
        let followable = moving[bin].get_or_insert_with(|| Followable::new(resting, f64::from(place * BIN_RAD)));
        followable.0.as_ref().map(|_| Bin(bin))
    }

    /// The fit of a bin.
    #[inline(always)]
    pub(super) fn of(&self, bin: Option<Bin>) -> &MotionFit {
        let moving = bin.and_then(|Bin(bin)| self.moving[bin].as_ref()?.0.as_deref());
        moving.unwrap_or(&self.resting)
    }
}

/// Which fit a tile is decoded with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Bin(usize);

impl Bin {
    /// The motion that its fit follows, rad an image.
    pub(super) fn motion_rad(self) -> f32 {
        (self.0 as f32 - BINS as f32) * BIN_RAD
    }
}

impl Followable {
    fn new(resting: &MotionFit, motion_rad: f64) -> Self {
        let images = resting.images();
        let shifts = resting.shifts_rad().iter().enumerate();
        let turned: Vec<f64> = shifts.map(|(i, shift)| shift + motion_rad * time(i, images)).collect();
        let tells = |fit: &MotionFit| {
            fit.noise_gain() <= MAX_NOISE_GAIN.max(MAX_NOISE * resting.noise_gain())
                && fit.least_limit_rad() >= LEAST_LIMIT_RAD
        };
        Self(MotionFit::new(&turned).ok().filter(tells).map(Box::new))
    }
}
