//! Fits of a window for surfaces of known motion. In: the phase shifts of a window. Out: a fit per motion, made when
//! first needed and then kept. Cost: up to a millisecond per fit.

use crate::phase::shifts::ShiftError;

use super::fit::MotionFit;
use super::image_times::time;

/// Range of motions that share one fit, rad per image. The rest is measured as motion of each pixel. So a fit must be able
/// to measure that much; the more images, the less it can.
const BIN_RAD: f32 = 0.1;
/// Fits on either side of rest: up to half a turn per image.
const BINS: usize = 31;
/// A motion can be followed up to this noise: relative to a resting scene, or per unit of noise ÷ modulation (about
/// that of four images). Beyond, the surface moves so much with the fringes that its images hardly differ.
const MAX_NOISE: f32 = 1.25;
const MAX_NOISE_GAIN: f32 = 0.75;

/// Fits of images with the same shifts, for surfaces of different motion.
#[derive(Clone, Debug)]
pub struct MotionFits {
    resting: MotionFit,
    /// Fits by rising motion; `None` until first needed.
    moving: Vec<Option<FollowingFit>>,
}

/// The fit for a motion; `None` if the images do not determine a phase at this motion.
#[derive(Clone, Debug)]
struct FollowingFit(Option<Box<MotionFit>>);

impl MotionFits {
    /// The fits of images with these shifts (rad) in order of time.
    ///
    /// # Errors
    /// Those of [`MotionFit::new`].
    pub fn new(shifts_rad: &[f64]) -> Result<Self, ShiftError> {
        Ok(Self { resting: MotionFit::new(shifts_rad)?, moving: vec![None; 2 * BINS + 1] })
    }

    /// The fit for a scene of unknown motion.
    #[must_use]
    pub fn resting(&self) -> &MotionFit {
        &self.resting
    }

    /// The bin of a motion, whose fit is made if needed; `None` if the motion cannot be followed.
    pub(super) fn bin_for(&mut self, motion_rad: f32) -> Option<Bin> {
        let place = (motion_rad / BIN_RAD).round();
        if place.abs() > BINS as f32 {
            return None;
        }
        let bin = (place + BINS as f32) as usize;
        let Self { resting, moving } = self;
        let following = moving[bin].get_or_insert_with(|| FollowingFit::new(resting, f64::from(place * BIN_RAD)));
        following.0.as_ref().map(|_| Bin(bin))
    }

    /// The fit of a bin; the resting one for `None`.
    #[inline(always)]
    pub(super) fn for_bin(&self, bin: Option<Bin>) -> &MotionFit {
        let moving = bin.and_then(|Bin(bin)| self.moving[bin].as_ref()?.0.as_deref());
        moving.unwrap_or(&self.resting)
    }
}

/// Index of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Bin(usize);

impl Bin {
    /// Motion followed by its fit, rad per image.
    pub(super) fn motion_rad(self) -> f32 {
        (self.0 as f32 - BINS as f32) * BIN_RAD
    }
}

impl FollowingFit {
    fn new(resting: &MotionFit, motion_rad: f64) -> Self {
        let images = resting.images();
        let shifts = resting.shifts_rad().iter().enumerate();
        let turned: Vec<f64> = shifts.map(|(i, shift)| shift + motion_rad * time(i, images)).collect();
        let is_usable = |fit: &MotionFit| {
            fit.noise_gain() <= MAX_NOISE_GAIN.max(MAX_NOISE * resting.noise_gain()) && fit.least_limit_rad() >= BIN_RAD
        };
        Self(MotionFit::new(&turned).ok().filter(is_usable).map(Box::new))
    }
}
