//! Checks the windows of one camera. In: a cycle of shifts once, then images. Out: a fault per window, or none. Cost:
//! see [`super`].

use std::f64::consts::TAU;

use fringeflow_base::grey::GreyLevels;
use fringeflow_base::limits::MAX_IMAGES;

use crate::phase::Validity;

use super::block::Block;
use super::fault::{Hypothesis, SequenceFault, SequenceFaultKind};
use super::judge::{BlockIndices, LEAST_BLOCKS, LitBlocks, ResidualScratch};
use super::span::{self, FASTEST_RAD, Planes};
use super::{LEAST_IMAGES, Vector};

/// Fastest motion allowed with other than the declared steps, as a share of a step. Motion by two steps back is the
/// mirror image of a resting scene, in which a lost image looks like a repeated one.
const FASTEST_STEPS: f64 = 0.9;
/// Residual share of the modulation from which on other steps are tried. A hand waved in front of the cameras leaves up
/// to
/// 0.075. The limit is less for cycles of more steps, because a step is smaller.
const SUSPICIOUS_SHARE: f64 = 0.06;
const SUSPICIOUS_STEPS: usize = 8;

/// Checks the windows of one camera and one cycle.
///
/// ```
/// use std::f64::consts::TAU;
/// use fringeflow::phase::{SequenceCheck, SequenceFaultKind};
///
/// // Windows of six images of a four-step pattern.
/// let check = SequenceCheck::new(&[0.0, TAU / 4.0, TAU / 2.0, 3.0 * TAU / 4.0], 0, 6);
/// let exchanged = SequenceFaultKind::Swapped { first: 1 };
/// assert!(check.residual_share(exchanged, 0.0) > check.least_residual_share());
/// ```
#[derive(Clone, Debug)]
pub struct SequenceCheck {
    /// Phase shifts from the first image on (rad), as many as any fault can skip to.
    shifts_rad: Vec<f64>,
    pub(super) images: usize,
    pub(super) cycle: usize,
    pub(super) nominal: Planes,
}

/// Scratch memory of a check: some 5 kB for each of 100 to 200 blocks.
#[derive(Clone, Debug, Default)]
pub struct SequenceScratch {
    blocks: Vec<Block>,
    indices: BlockIndices,
    residual: ResidualScratch,
}

impl SequenceCheck {
    /// A check for windows of `images` images in consecutive steps of a cycle with these shifts (rad), from
    /// `first_step` on.
    #[must_use]
    pub fn new(cycle_rad: &[f64], first_step: usize, images: usize) -> Self {
        let cycle = cycle_rad.len();
        let reach = images + cycle;
        let shifts_rad: Vec<f64> =
            cycle_rad.iter().cycle().skip(first_step % cycle.max(1)).take(reach).copied().collect();
        let mut check = Self { shifts_rad, images, cycle, nominal: Planes::default() };
        let mut nominal = Planes::default();
        check.set_planes(&mut nominal, &Hypothesis::nominal(images.min(MAX_IMAGES)), FASTEST_RAD);
        check.nominal = nominal;
        check
    }

    /// Finds the fault in the images of a camera, each `width · height` grey levels row by row, in order of time.
    ///
    /// `None` if they show the declared steps, if too little of them is lit, or if there are fewer than 5 images or
    /// more than [`MAX_IMAGES`].
    #[must_use]
    pub fn find_fault(
        &self,
        images: &[GreyLevels<'_>],
        width: usize,
        height: usize,
        validity: &Validity,
    ) -> Option<SequenceFault> {
        self.find_fault_in(&mut SequenceScratch::default(), images, width, height, validity)
    }

    /// [`Self::find_fault`] with scratch memory, whose contents do not matter.
    #[must_use]
    pub fn find_fault_in(
        &self,
        scratch: &mut SequenceScratch,
        images: &[GreyLevels<'_>],
        width: usize,
        height: usize,
        validity: &Validity,
    ) -> Option<SequenceFault> {
        let fits = |image: &GreyLevels<'_>| image.pixels() == width * height;
        let is_checkable = (LEAST_IMAGES..=MAX_IMAGES).contains(&self.images);
        if images.len() != self.images || !is_checkable || !images.iter().all(fits) {
            return None;
        }
        let SequenceScratch { blocks, indices, residual } = scratch;
        Block::find_all(blocks, images, width, height, validity);
        let lit = LitBlocks::new(self, blocks, indices, validity);
        if lit.count() < LEAST_BLOCKS {
            return None;
        }
        if let Some(fault) = lit.repeated_image(residual) {
            return Some(fault);
        }
        if !lit.is_suspicious(residual) {
            return lit.fault_hidden_by_motion(residual);
        }
        // Images of different brightness leave a residual too: equalize them before looking for a fault.
        let brightness = lit.brightness();
        let lit_blocks = blocks.iter_mut().filter(|block| block.signal.is_some());
        lit_blocks.for_each(|block| block.equalize_brightness(&brightness, validity));
        let lit = LitBlocks::new(self, blocks, indices, validity);
        if lit.is_suspicious(residual) { lit.find_fault(residual) } else { None }
    }

    /// Residual share of the modulation that a fault causes without noise, in a scene that moves by `motion_rad` per
    /// image. A fault with a small share is invisible.
    ///
    /// The smallest over the ways in which the fault may have happened. 1 for images without fringes, and for windows
    /// of more than [`MAX_IMAGES`].
    #[must_use]
    pub fn residual_share(&self, fault: SequenceFaultKind, motion_rad: f64) -> f64 {
        if self.images > MAX_IMAGES {
            return 1.0;
        }
        let shares = Hypothesis::all_of_kind(fault, self.images).map(|hypothesis| {
            let [shifts_rad, times] = self.angles(&hypothesis);
            let directions =
                span::directions(&shifts_rad[..hypothesis.images], &times[..hypothesis.images], motion_rad);
            self.nominal.unexplained(&directions).square.sqrt()
        });
        shares.fold(1.0, f64::min)
    }

    /// Residual share of the modulation from which on other steps are tried.
    #[must_use]
    pub fn least_residual_share(&self) -> f64 {
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
    fn angles(&self, hypothesis: &Hypothesis) -> [Vector; 2] {
        let shift_rad = |step: usize| self.shifts_rad.get(step).copied().unwrap_or_default();
        [hypothesis.steps.map(shift_rad), hypothesis.times.map(|time| time as f64)]
    }
}
