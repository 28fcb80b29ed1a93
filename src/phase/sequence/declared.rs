//! The steps that the images of a window should show. In: a cycle of shifts. Out: the planes in which the samples of
//! these steps lie, and those of any other hypothesis.

use std::f64::consts::TAU;

use fringeflow_base::limits::MAX_IMAGES;

use super::Vector;
use super::fault::Hypothesis;
use super::span::{FASTEST_RAD, Planes};

/// Fastest motion allowed with other than the declared steps, as a share of a step. Motion by two steps back is the
/// mirror image of a resting scene, in which a lost image looks like a repeated one.
const FASTEST_STEPS: f64 = 0.9;
/// Residual share of the modulation from which on other steps are tried. A hand waved in front of the cameras leaves up
/// to 0.075. Beyond [`SUSPICIOUS_STEPS`] steps a cycle the limit is less, because a step is smaller.
const SUSPICIOUS_SHARE: f64 = 0.06;
const SUSPICIOUS_STEPS: usize = 8;

/// The declared steps of the windows of one camera and one cycle.
#[derive(Clone, Debug)]
pub(super) struct DeclaredSteps {
    /// Phase shifts from the first image on (rad), as many as any fault can skip to.
    shifts_rad: Vec<f64>,
    /// Number of images in a window.
    pub(super) images: usize,
    /// Number of steps in the cycle.
    pub(super) cycle: usize,
    /// The planes of the declared steps.
    pub(super) nominal: Planes,
}

impl DeclaredSteps {
    /// The steps of windows of `images` images, from `first_step` of a cycle with these shifts (rad) on.
    pub(super) fn new(cycle_rad: &[f64], first_step: usize, images: usize) -> Self {
        let cycle = cycle_rad.len();
        let reach = images + cycle;
        let shifts_rad: Vec<f64> =
            cycle_rad.iter().cycle().skip(first_step % cycle.max(1)).take(reach).copied().collect();
        let mut declared = Self { shifts_rad, images, cycle, nominal: Planes::default() };
        let mut nominal = Planes::default();
        declared.set_planes(&mut nominal, &Hypothesis::nominal(images.min(MAX_IMAGES)), FASTEST_RAD);
        declared.nominal = nominal;
        declared
    }

    /// Residual share of the modulation from which on other steps are tried.
    pub(super) fn least_residual_share(&self) -> f64 {
        SUSPICIOUS_SHARE * (SUSPICIOUS_STEPS as f64 / self.cycle.max(1) as f64).min(1.0)
    }

    /// Fastest motion allowed with other than the declared steps, rad per image.
    pub(super) fn fastest_rad(&self) -> f64 {
        FASTEST_RAD.min(FASTEST_STEPS * TAU / self.cycle.max(1) as f64)
    }

    /// Sets `planes` to those of a hypothesis.
    pub(super) fn set_planes(&self, planes: &mut Planes, hypothesis: &Hypothesis, fastest_rad: f64) {
        let [shifts_rad, times] = self.angles(hypothesis);
        planes.set(&shifts_rad[..hypothesis.images], &times[..hypothesis.images], fastest_rad);
    }

    /// Phase shifts (rad) and times (images) of a hypothesis.
    pub(super) fn angles(&self, hypothesis: &Hypothesis) -> [Vector; 2] {
        let shift_rad = |step: usize| self.shifts_rad.get(step).copied().unwrap_or_default();
        [hypothesis.steps.map(shift_rad), hypothesis.times.map(|time| time as f64)]
    }
}
