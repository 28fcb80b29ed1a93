//! Checks the windows of one camera. In: a cycle of shifts once, then images. Out: a fault per window, or none. Cost:
//! see [`super`].

use fringeflow_base::grey::GreyLevels;
use fringeflow_base::limits::MAX_IMAGES;

use crate::phase::Validity;

use super::LEAST_IMAGES;
use super::block::Block;
use super::declared::DeclaredSteps;
use super::fault::{Hypothesis, SequenceFault, SequenceFaultKind};
use super::judge::{BlockIndices, LEAST_BLOCKS, LitBlocks, ResidualScratch};
use super::span;

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
    declared: DeclaredSteps,
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
        Self { declared: DeclaredSteps::new(cycle_rad, first_step, images) }
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
        let is_checkable = (LEAST_IMAGES..=MAX_IMAGES).contains(&self.declared.images);
        if images.len() != self.declared.images || !is_checkable || !images.iter().all(fits) {
            return None;
        }
        let SequenceScratch { blocks, indices, residual } = scratch;
        Block::find_all(blocks, images, width, height, validity);
        let lit = LitBlocks::new(&self.declared, blocks, indices, validity);
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
        let lit = LitBlocks::new(&self.declared, blocks, indices, validity);
        if lit.is_suspicious(residual) { lit.find_fault(residual) } else { None }
    }

    /// Residual share of the modulation that a fault causes without noise, in a scene that moves by `motion_rad` per
    /// image. A fault with a small share is invisible.
    ///
    /// A fault may have happened in several ways; the smallest share of these is returned. It is 1 for images without
    /// fringes, and for windows of more than [`MAX_IMAGES`].
    #[must_use]
    pub fn residual_share(&self, fault: SequenceFaultKind, motion_rad: f64) -> f64 {
        if self.declared.images > MAX_IMAGES {
            return 1.0;
        }
        let shares = Hypothesis::all_of_kind(fault, self.declared.images).map(|hypothesis| {
            let [shifts_rad, times] = self.declared.angles(&hypothesis);
            let directions =
                span::directions(&shifts_rad[..hypothesis.images], &times[..hypothesis.images], motion_rad);
            self.declared.nominal.unexplained(&directions).square.sqrt()
        });
        shares.fold(1.0, f64::min)
    }

    /// Residual share of the modulation from which on other steps are tried.
    #[must_use]
    pub fn least_residual_share(&self) -> f64 {
        self.declared.least_residual_share()
    }
}
