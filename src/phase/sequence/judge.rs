//! Decides from the blocks of a window whether it has a fault, and which. In: blocks. Out: a fault, or none. Cost: some
//! thousand operations per block and hypothesis; without suspicion only the declared steps are tried.
//!
//! ```text
//! find_fault:
//!     residual of the declared steps       median over the most coherent blocks
//!     best fault of order                  first few blocks, then more for the promising ones
//!     best single foreign image            the others must then fit several times better
//!     foreign image, if clearly better than any order
//!     else the order, if clearly better than the declared steps, and in nearly all blocks
//!     else unexplained, if the residual is larger than any motion causes
//! ```

use rayon::prelude::*;

use fringeflow_base::limits::MAX_IMAGES;

use crate::phase::Validity;

use super::Vector;
use super::block::Block;
use super::declared::DeclaredSteps;
use super::fault::{Hypothesis, SequenceFault, SequenceFaultKind};
use super::signal::Signal;
use super::span::{FASTEST_RAD, Planes};

/// Fewest blocks that allow a decision.
pub(super) const LEAST_BLOCKS: usize = 4;
/// Other steps are tried first with few blocks. Those that leave at most [`PROMISING_RATIO`] times the residual of the
/// best are tried with more.
const FIRST_BLOCKS: usize = 12;
const MORE_BLOCKS: usize = 64;
const PROMISING_RATIO: f64 = 2.0;
/// Factor by which the residual of a fault of order must be less than that of the declared steps, and share of the
/// blocks in which it must be less. Residuals from motion differ from block to block, and other steps fit some blocks
/// by chance.
const LESS_THAN_NOMINAL: f64 = 1.3;
const MIN_AGREEMENT: f64 = 0.9;
/// Factor by which the residual must be less without a foreign image than with it. It is large, because no single block
/// shows which image is foreign.
const LESS_WITHOUT_IMAGE: f64 = 3.0;
/// Residual share of the modulation that counts as zero.
const FLOOR_SHARE: f64 = 0.01;
/// Faults with up to this multiple of the smallest residual count as equally good; the most likely of them is reported.
const AS_GOOD_RATIO: f64 = 1.5;
/// Factor by which the residual without an image must be less than with any fault of order, which keeps all images.
const LESS_THAN_ANY_ORDER: f64 = 1.5;
/// Share of the blocks that must be coherent without an image for it to be foreign, if few are coherent with it.
const MIN_COHERENT_SHARE: f64 = 0.75;
/// Residual share of the modulation that no motion causes.
const UNEXPLAINED_SHARE: f64 = 0.2;
/// One in this many lit blocks decides about the declared steps: the most coherent ones.
const DECIDING_ONE_IN: usize = 5;
/// Largest mean squared difference between copies of one image, grey levels.
const MAX_COPY_SQUARE: f64 = 1e-6;
/// A fault hides behind steady motion if all blocks share at least the first motion, rad per image, and with the fault
/// all rest to within the second.
const SHARED_MOTION_RAD: f64 = 0.3;
const RESTING_RAD: f64 = 0.06;
/// Largest residual share of the modulation of such a fault.
const RESTING_SHARE: f64 = 0.02;
/// Quantiles that stand for the least and the most motion of the blocks.
const MOTION_QUANTILES: [f64; 2] = [0.1, 0.9];

/// Residual of some steps over some blocks.
#[derive(Clone, Copy, Debug)]
struct Residual {
    /// Median residual share of the modulation.
    share: f64,
    /// Least and most motion of nearly all blocks, rad per image.
    motions_rad: [f64; 2],
}

/// The best fault of order.
#[derive(Clone, Copy, Debug)]
struct OrderFault {
    kind: SequenceFaultKind,
    /// Residual of the fault, a share of the modulation.
    share: f64,
    /// Share of the blocks in which it fits better than the declared steps.
    agreement: f64,
}

/// Indices of the blocks of a window.
#[derive(Clone, Debug, Default)]
pub(super) struct BlockIndices {
    /// Lit blocks, row by row.
    lit: Vec<usize>,
    /// Coherent blocks, the most coherent first.
    coherent: Vec<usize>,
}

/// Scratch memory for residuals.
#[derive(Clone, Debug, Default)]
pub(super) struct ResidualScratch {
    /// Planes of other than the declared steps.
    planes: Planes,
    values: BlockResiduals,
}

/// Residual and motion of each block.
#[derive(Clone, Debug, Default)]
struct BlockResiduals {
    squares: Vec<f64>,
    motions_rad: Vec<f64>,
}

/// The lit blocks of a window.
pub(super) struct LitBlocks<'a> {
    declared: &'a DeclaredSteps,
    blocks: &'a [Block],
    indices: &'a BlockIndices,
    validity: &'a Validity,
}

impl<'a> LitBlocks<'a> {
    /// Selects the lit blocks.
    pub(super) fn new(
        declared: &'a DeclaredSteps,
        blocks: &'a [Block],
        indices: &'a mut BlockIndices,
        validity: &'a Validity,
    ) -> Self {
        let BlockIndices { lit, coherent } = indices;
        let signal = |index: usize| blocks[index].signal.as_ref();
        let noise_square = |index: usize| signal(index).map_or(f64::INFINITY, |signal| signal.noise_square);
        lit.clear();
        lit.extend((0..blocks.len()).filter(|&index| signal(index).is_some()));
        coherent.clear();
        coherent.extend(lit.iter().filter(|&&index| signal(index).is_some_and(Signal::is_coherent)));
        // The index breaks ties, so that the order is always the same.
        coherent.sort_unstable_by(|&a, &b| noise_square(a).total_cmp(&noise_square(b)).then(a.cmp(&b)));
        Self { declared, blocks, indices, validity }
    }

    /// Number of lit blocks.
    pub(super) fn count(&self) -> usize {
        self.indices.lit.len()
    }

    /// Signals of at most `most` of these blocks, evenly chosen.
    fn signals(&self, indices: &'a [usize], most: usize) -> impl Iterator<Item = &'a Signal> + Clone {
        let blocks = self.blocks;
        thin_out(indices, most).filter_map(move |&index| blocks[index].signal.as_ref())
    }

    /// Residual of the declared steps over these blocks.
    fn nominal_residual(&self, indices: &'a [usize], scratch: &mut ResidualScratch) -> Option<Residual> {
        residual(&self.declared.nominal, self.signals(indices, indices.len()), &mut scratch.values)
    }

    /// Residual of other steps.
    fn hypothesis_residual<'b>(
        &self,
        hypothesis: &Hypothesis,
        signals: impl Iterator<Item = &'b Signal>,
        scratch: &mut ResidualScratch,
    ) -> Option<Residual> {
        let ResidualScratch { planes, values } = scratch;
        self.declared.set_planes(planes, hypothesis, self.declared.fastest_rad());
        residual(planes, signals, values)
    }

    /// The coherent blocks, the most coherent first.
    fn coherent(&self) -> &'a [usize] {
        &self.indices.coherent
    }

    /// The blocks that decide about the declared steps; `None` if too few are coherent.
    fn deciding(&self) -> Option<&'a [usize]> {
        self.coherent().get(..self.count().div_ceil(DECIDING_ONE_IN).max(LEAST_BLOCKS))
    }

    /// Brightness of every image relative to the mean. Over the whole image the fringes cancel.
    pub(super) fn brightness(&self) -> Vector {
        let images = self.declared.images;
        let mut sums = [0.0; MAX_IMAGES];
        for &index in &self.indices.lit {
            sums[..images].iter_mut().zip(&self.blocks[index].mean).for_each(|(sum, mean)| *sum += mean);
        }
        let mean = sums[..images].iter().sum::<f64>() / images.max(1) as f64;
        sums.map(|sum| if sum > 0.0 { sum / mean } else { 1.0 })
    }

    /// Finds an image that is an exact copy of the one before: no two exposures have the same noise.
    pub(super) fn repeated_image(&self, scratch: &mut ResidualScratch) -> Option<SequenceFault> {
        let is_same = |&index: &usize, image| self.blocks[index].difference_square(image) < MAX_COPY_SQUARE;
        let is_repeated = |image: usize| self.indices.lit.iter().all(|index| is_same(index, image));
        let image = (0..self.declared.images - 1).find(|&image| is_repeated(image))?;
        let residual_share = self.nominal_residual(self.coherent(), scratch).map_or(1.0, |residual| residual.share);
        Some(SequenceFault { kind: SequenceFaultKind::Duplicated { image }, residual_share, explained_share: 0.0 })
    }

    /// Whether the declared steps leave a large residual, or too few blocks are coherent.
    pub(super) fn is_suspicious(&self, scratch: &mut ResidualScratch) -> bool {
        let nominal = self.deciding().and_then(|deciding| self.nominal_residual(deciding, scratch));
        nominal.is_none_or(|residual| residual.share >= self.declared.least_residual_share())
    }

    /// Finds the fault of a suspicious window.
    pub(super) fn find_fault(&self, scratch: &mut ResidualScratch) -> Option<SequenceFault> {
        let Some(deciding) = self.deciding() else {
            // Too few coherent blocks: perhaps a single foreign image spoils them all.
            let residual_share = self.noisy_residual_share();
            let (kind, explained_share) = self
                .foreign_image(MIN_COHERENT_SHARE)
                .filter(|&(_, share)| is_less(LESS_WITHOUT_IMAGE, share, residual_share))?;
            return Some(SequenceFault { kind, residual_share, explained_share });
        };
        let residual_share = self.nominal_residual(deciding, scratch)?.share;
        let order = self.fault_of_order(deciding, residual_share);
        let order_share = order.map_or(f64::INFINITY, |order| order.share);
        let is_clear = |share: f64| {
            is_less(LESS_THAN_ANY_ORDER, share, order_share) && is_less(LESS_WITHOUT_IMAGE, share, residual_share)
        };
        let fault = |kind, explained_share| Some(SequenceFault { kind, residual_share, explained_share });
        if let Some((kind, share)) =
            self.foreign_image(1.0 / DECIDING_ONE_IN as f64).filter(|&(_, share)| is_clear(share))
        {
            return fault(kind, share);
        }
        match order {
            Some(OrderFault { kind, share, agreement })
                if is_less(LESS_THAN_NOMINAL, share, residual_share) && agreement >= MIN_AGREEMENT =>
            {
                fault(kind, share)
            }
            _ if residual_share < UNEXPLAINED_SHARE => None,
            _ => fault(SequenceFaultKind::Unexplained, order_share.min(residual_share)),
        }
    }

    /// The most likely fault of order among those that explain the images nearly as well as the best one.
    fn fault_of_order(&self, deciding: &'a [usize], residual_share: f64) -> Option<OrderFault> {
        let declared = self.declared;
        let all: Vec<Hypothesis> = Hypothesis::all_of_order(declared.images, declared.cycle).collect();
        let first_shares = self.shares(&all, &self.signals(deciding, FIRST_BLOCKS));
        let limit = PROMISING_RATIO * least_share(&first_shares).max(FLOOR_SHARE);
        let promising: Vec<Hypothesis> =
            all.into_iter().zip(first_shares).filter(|&(_, share)| share <= limit).map(|(one, _)| one).collect();
        let tried = self.signals(deciding, MORE_BLOCKS);
        let shares = self.shares(&promising, &tried);
        let least = least_share(&shares).max(FLOOR_SHARE);
        // As good as the best, and clearly better than the declared steps if any fault is. Hypotheses are sorted by
        // likelihood, so the first one within the limit is taken.
        let limit = (AS_GOOD_RATIO * least).min(residual_share / LESS_THAN_NOMINAL).max(least);
        let (best, share) = promising.into_iter().zip(shares).find(|&(_, share)| share <= limit)?;
        let mut planes = Planes::default();
        declared.set_planes(&mut planes, &best, declared.fastest_rad());
        let is_better = |signal: &&Signal| {
            let square = |planes: &Planes| planes.unexplained(&signal.directions).square;
            square(&planes) < square(&declared.nominal)
        };
        let agreement = tried.clone().filter(is_better).count() as f64 / tried.count() as f64;
        Some(OrderFault { kind: best.kind?, share, agreement })
    }

    /// Residual shares of hypotheses.
    fn shares<'b>(
        &self,
        hypotheses: &[Hypothesis],
        signals: &(impl Iterator<Item = &'b Signal> + Clone + Sync),
    ) -> Vec<f64> {
        let share = |hypothesis| {
            self.hypothesis_residual(hypothesis, signals.clone(), &mut ResidualScratch::default())
                .map_or(f64::INFINITY, |residual| residual.share)
        };
        hypotheses.par_iter().map(share).collect()
    }

    /// The image without which the others fit best, and their residual share. At least `least_coherent` of the blocks
    /// must be coherent without it.
    fn foreign_image(&self, least_coherent: f64) -> Option<(SequenceFaultKind, f64)> {
        let images = self.declared.images;
        let indices = thin_out(&self.indices.lit, MORE_BLOCKS);
        let without = |image: usize| {
            let signal = |&index: &usize| self.blocks[index].without(image, self.validity).signal;
            let coherent: Vec<Signal> = indices.clone().filter_map(signal).filter(Signal::is_coherent).collect();
            let are_enough = coherent.len() as f64 >= least_coherent * indices.clone().count() as f64;
            let mut planes = Planes::default();
            self.declared.set_planes(&mut planes, &Hypothesis::without(image, images), FASTEST_RAD);
            let residual = residual(&planes, coherent.iter(), &mut BlockResiduals::default()).filter(|_| are_enough)?;
            Some((SequenceFaultKind::Wrong { image }, residual.share))
        };
        let faults: Vec<(SequenceFaultKind, f64)> = (0..images).into_par_iter().filter_map(without).collect();
        faults.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// A fault that looks like steady motion: all blocks seem to share that motion, but with the fault they rest.
    pub(super) fn fault_hidden_by_motion(&self, scratch: &mut ResidualScratch) -> Option<SequenceFault> {
        let nominal = self.nominal_residual(self.coherent(), scratch)?;
        let [least, most] = nominal.motions_rad;
        let is_shared = most - least <= 2.0 * RESTING_RAD && least.abs().min(most.abs()) >= SHARED_MOTION_RAD;
        if !is_shared || self.coherent().len() < LEAST_BLOCKS {
            return None;
        }
        let tried = self.signals(self.coherent(), MORE_BLOCKS);
        Hypothesis::all_of_order(self.declared.images, self.declared.cycle).find_map(|hypothesis| {
            let residual = self.hypothesis_residual(&hypothesis, tried.clone(), scratch)?;
            let rests = residual.motions_rad.iter().all(|motion| motion.abs() <= RESTING_RAD);
            let kind = hypothesis.kind?;
            let fault = SequenceFault { kind, residual_share: nominal.share, explained_share: residual.share };
            (rests && residual.share <= nominal.share.max(RESTING_SHARE)).then_some(fault)
        })
    }

    /// Median of residual ÷ modulation over all lit blocks, including noise.
    fn noisy_residual_share(&self) -> f64 {
        let images = self.declared.images as f64;
        let freedom = images - 3.0;
        let square = |signal: &Signal| {
            let unexplained = self.declared.nominal.unexplained(&signal.directions).square;
            signal.noise_square + unexplained * images / (2.0 * freedom)
        };
        let lit = &self.indices.lit;
        let mut squares: Vec<f64> = self.signals(lit, lit.len()).map(square).collect();
        squares.sort_unstable_by(f64::total_cmp);
        quantile(&squares, 0.5).max(0.0).sqrt()
    }
}

/// Whether `share` is less than `other` by this factor.
fn is_less(factor: f64, share: f64, other: f64) -> bool {
    factor * share.max(FLOOR_SHARE) <= other
}

/// Residual of signals outside the best of some planes; `None` without signals.
fn residual<'a>(
    planes: &Planes,
    signals: impl Iterator<Item = &'a Signal>,
    scratch: &mut BlockResiduals,
) -> Option<Residual> {
    let BlockResiduals { squares, motions_rad } = scratch;
    squares.clear();
    motions_rad.clear();
    for unexplained in signals.map(|signal| planes.unexplained(&signal.directions)) {
        squares.push(unexplained.square);
        motions_rad.push(unexplained.motion_rad);
    }
    if squares.is_empty() {
        return None;
    }
    squares.sort_unstable_by(f64::total_cmp);
    motions_rad.sort_unstable_by(f64::total_cmp);
    let share = quantile(squares, 0.5).sqrt();
    Some(Residual { share, motions_rad: MOTION_QUANTILES.map(|part| quantile(motions_rad, part)) })
}

/// At most `most` of all, evenly chosen.
fn thin_out<T>(all: &[T], most: usize) -> impl Iterator<Item = &T> + Clone {
    all.iter().step_by(all.len().div_ceil(most.max(1)).max(1))
}

fn least_share(shares: &[f64]) -> f64 {
    shares.iter().copied().fold(f64::INFINITY, f64::min)
}

/// Quantile `part` of sorted values; 0 if there are none.
fn quantile(values: &[f64], part: f64) -> f64 {
    values.get((part * values.len().saturating_sub(1) as f64).round() as usize).copied().unwrap_or_default()
}
