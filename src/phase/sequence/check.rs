//! The windows of one camera and one cycle: what is worked out once for all of them, and what is kept from one to the next.

use std::f64::consts::TAU;

use fringeflow_base::grey::GreyLevels;
use fringeflow_base::limits::MAX_IMAGES;

use crate::phase::Validity;

use super::block::Block;
use super::fault::{Hypothesis, SequenceFault, SequenceFaultKind};
use super::judge::{LEAST_BLOCKS, LeftScratch, Numbers, Told};
use super::span::{self, FASTEST_RAD, Planes};
use super::{LEAST_IMAGES, Vector};

/// Fastest motion that may explain other steps than the said ones, a share of a step. One of two steps back is the mirror image
/// of a resting scene, in which what is lost looks as if it came twice.
const FASTEST_STEPS: f64 = 0.9;
/// Unexplained share of the modulation from which on other steps are tried: a hand that is waved before the cameras leaves up to
/// 0.075. Of longer cycles it is less, as a step is.
const SUSPICIOUS_SHARE: f64 = 0.06;
const SUSPICIOUS_STEPS: usize = 8;

/// Judges the windows of one camera and one cycle.
#[derive(Clone, Debug)]
pub struct SequenceCheck {
    /// Phase shifts from the first image on, rad, as long as any fault reaches.
    shifts_rad: Vec<f64>,
    pub(super) images: usize,
    pub(super) cycle: usize,
    pub(super) nominal: Planes,
}

/// Memory in which windows are judged, of one camera after the other: some 5 KB a block, of which an image has 100 to 200.
#[derive(Clone, Debug, Default)]
pub struct SequenceScratch {
    blocks: Vec<Block>,
    numbers: Numbers,
    left: LeftScratch,
}

impl SequenceCheck {
    /// Judges windows of so many images, of which the first is said to show step `first_step` of a cycle with these shifts, rad,
    /// and each of the others the step behind that of the one before.
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

    /// What is wrong with the images of a camera, each `width · height` grey levels row by row, in the order of their times;
    /// `None` where they are as said, or where too little of them is lit to tell. Of fewer than 5 images, or more than
    /// [`MAX_IMAGES`], nothing is told.
    #[must_use]
    pub fn fault(
        &self,
        images: &[GreyLevels<'_>],
        width: usize,
        height: usize,
        validity: &Validity,
    ) -> Option<SequenceFault> {
        self.fault_in(&mut SequenceScratch::default(), images, width, height, validity)
    }

    /// As [`Self::fault`], in memory that is used again; what it held makes no difference.
    #[must_use]
    pub fn fault_in(
        &self,
        scratch: &mut SequenceScratch,
        images: &[GreyLevels<'_>],
        width: usize,
        height: usize,
        validity: &Validity,
    ) -> Option<SequenceFault> {
        let fits = |image: &GreyLevels<'_>| image.pixels() == width * height;
        let can_tell = (LEAST_IMAGES..=MAX_IMAGES).contains(&self.images);
        if images.len() != self.images || !can_tell || !images.iter().all(fits) {
            return None;
        }
        let SequenceScratch { blocks, numbers, left } = scratch;
        Block::find_all(blocks, images, width, height, validity);
        let told = Told::new(self, blocks, numbers, validity);
        if told.lit_blocks() < LEAST_BLOCKS {
            return None;
        }
        if let Some(fault) = told.repeated(left) {
            return Some(fault);
        }
        if !told.is_suspicious(left) {
            return told.resting(left);
        }
        // Perhaps the images are of different brightness only.
        let brightness = told.brightness();
        blocks.iter_mut().filter(|block| block.signal.is_some()).for_each(|block| block.level(&brightness, validity));
        let told = Told::new(self, blocks, numbers, validity);
        if told.is_suspicious(left) { told.fault(left) } else { None }
    }

    /// What a fault leaves unexplained at any motion, a share of the modulation, where the scene moves by `motion_rad` an
    /// image and there is no noise: a fault that leaves little cannot be seen. The least of the ways in which it may have
    /// come about; 1 where it shows something else than fringes, and where the windows are longer than any.
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

    /// Share of the modulation from which on a fault is looked for.
    #[must_use]
    pub fn least_residual_share(&self) -> f64 {
        SUSPICIOUS_SHARE * (SUSPICIOUS_STEPS as f64 / self.cycle.max(1) as f64).min(1.0)
    }

    /// Fastest motion that may explain other steps than the said ones, rad an image.
    pub(super) fn fastest_rad(&self) -> f64 {
        FASTEST_RAD.min(FASTEST_STEPS * TAU / self.cycle.max(1) as f64)
    }

    /// The planes of a hypothesis, in the memory of others.
    pub(super) fn set_planes(&self, planes: &mut Planes, hypothesis: &Hypothesis, fastest_rad: f64) {
        let [shifts_rad, times] = self.angles(hypothesis);
        planes.set(&shifts_rad[..hypothesis.images], &times[..hypothesis.images], fastest_rad);
    }

    /// Phase shifts, rad, and times of the images of a hypothesis.
    fn angles(&self, hypothesis: &Hypothesis) -> [Vector; 2] {
        let shift_rad = |step: usize| self.shifts_rad.get(step).copied().unwrap_or_default();
        [hypothesis.steps.map(shift_rad), hypothesis.times.map(|time| time as f64)]
    }
}
