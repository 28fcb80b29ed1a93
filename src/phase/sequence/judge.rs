//! From blocks to a verdict.

use rayon::prelude::*;

use fringeflow_base::limits::MAX_IMAGES;

use crate::phase::Validity;

use super::Vector;
use super::block::Block;
use super::check::SequenceCheck;
use super::fault::{Hypothesis, SequenceFault, SequenceFaultKind};
use super::signal::Signal;
use super::span::{FASTEST_RAD, Planes};

/// Fewest blocks that are asked.
pub(super) const LEAST_BLOCKS: usize = 4;
/// Most blocks that other steps are tried with, first all of them, then those that leave not much more than the best.
const FEW_TRIED: usize = 12;
const MOST_TRIED: usize = 64;
const PROMISING: f64 = 2.0;
/// How much less of the modulation the true steps must leave than the said ones, and in what share of the blocks they must
/// leave less: what motion leaves of both differs from block to block, and other steps suit some of them by chance.
const LESS: f64 = 1.3;
const AGREEMENT: f64 = 0.9;
/// How much less the other images must leave without the one that shows something else: no block says by itself which.
const LESS_WITHOUT: f64 = 3.0;
/// Share of the modulation that any steps may leave.
const FLOOR_SHARE: f64 = 0.01;
/// Faults that leave up to so many times as much as the best, and the floor, explain the images as well: the likelier is named.
const AS_GOOD: f64 = 1.5;
/// How much less must be left without an image than with a fault of order, which keeps them all.
const LESS_THAN_ANY_ORDER: f64 = 1.5;
/// Share of the blocks that must move alike without an image for it to be the one that shows something else.
const MOST: f64 = 0.75;
/// Unexplained share of the modulation that no motion makes.
const UNEXPLAINED_SHARE: f64 = 0.2;
/// The said steps are judged by one in so many lit blocks, those whose pixels move most alike.
const ONE_IN: usize = 5;
/// Mean squared difference of images that are the same image, grey levels.
const SAME_SQUARE: f64 = 1e-6;
/// Slowest motion that all blocks share where a fault is told by their resting without it, and what they move then at most.
const SHARED_MOTION_RAD: f64 = 0.3;
const RESTING_RAD: f64 = 0.06;
/// Share of the modulation that the steps of such a fault may leave.
const RESTING_SHARE: f64 = 0.02;
/// Quantiles between which the motions of the blocks are said to lie.
const ALL_BUT: [f64; 2] = [0.1, 0.9];

/// What steps leave of some blocks.
#[derive(Clone, Copy, Debug)]
struct Left {
    /// Median unexplained share of the modulation.
    share: f64,
    /// Motion that most blocks have at least and at most, rad an image.
    motions_rad: [f64; 2],
}

/// A fault of order that explains the images.
#[derive(Clone, Copy, Debug)]
struct Order {
    kind: SequenceFaultKind,
    /// What it leaves, a share of the modulation.
    share: f64,
    /// Share of the blocks of which it leaves less than the said steps do.
    agreement: f64,
}

/// Numbers of blocks of a window.
#[derive(Clone, Debug, Default)]
pub(super) struct Numbers {
    /// Those that are lit, row by row.
    lit: Vec<usize>,
    /// Those of them whose pixels move alike, those that do most first.
    alike: Vec<usize>,
}

/// Memory in which is found what steps leave.
#[derive(Clone, Debug, Default)]
pub(super) struct LeftScratch {
    /// Planes of other steps than the said ones.
    planes: Planes,
    values: Values,
}

/// What planes leave of blocks, one by one.
#[derive(Clone, Debug, Default)]
struct Values {
    squares: Vec<f64>,
    motions_rad: Vec<f64>,
}

/// The blocks of a window that are lit.
pub(super) struct Told<'a> {
    check: &'a SequenceCheck,
    blocks: &'a [Block],
    numbers: &'a Numbers,
    validity: &'a Validity,
}

impl<'a> Told<'a> {
    /// What blocks tell.
    pub(super) fn new(
        check: &'a SequenceCheck,
        blocks: &'a [Block],
        numbers: &'a mut Numbers,
        validity: &'a Validity,
    ) -> Self {
        let Numbers { lit, alike } = numbers;
        let signal = |number: usize| blocks[number].signal.as_ref();
        let noise_square = |number: usize| signal(number).map_or(f64::INFINITY, |signal| signal.noise_square);
        lit.clear();
        lit.extend((0..blocks.len()).filter(|&number| signal(number).is_some()));
        alike.clear();
        alike.extend(lit.iter().filter(|&&number| signal(number).is_some_and(Signal::is_alike)));
        // Of blocks with the same noise the first comes first.
        alike.sort_unstable_by(|&a, &b| noise_square(a).total_cmp(&noise_square(b)).then(a.cmp(&b)));
        Self { check, blocks, numbers, validity }
    }

    pub(super) fn lit_blocks(&self) -> usize {
        self.numbers.lit.len()
    }

    /// The signals of some of the lit blocks, so many at most, evenly chosen.
    fn signals(&self, numbers: &'a [usize], most: usize) -> impl Iterator<Item = &'a Signal> + Clone {
        let blocks = self.blocks;
        thinned_out(numbers, most).filter_map(move |&number| blocks[number].signal.as_ref())
    }

    /// What the said steps leave of some of the lit blocks.
    fn left(&self, numbers: &'a [usize], scratch: &mut LeftScratch) -> Option<Left> {
        left(&self.check.nominal, self.signals(numbers, numbers.len()), &mut scratch.values)
    }

    /// What others leave of signals.
    fn left_by<'b>(
        &self,
        hypothesis: &Hypothesis,
        signals: impl Iterator<Item = &'b Signal>,
        scratch: &mut LeftScratch,
    ) -> Option<Left> {
        let LeftScratch { planes, values } = scratch;
        self.check.set_planes(planes, hypothesis, self.check.fastest_rad());
        left(planes, signals, values)
    }

    /// The lit blocks whose pixels move alike, those that do most first.
    fn alike(&self) -> &'a [usize] {
        &self.numbers.alike
    }

    /// Those that the steps are judged by; `None` where too few can tell.
    fn judges(&self) -> Option<&'a [usize]> {
        self.alike().get(..self.lit_blocks().div_ceil(ONE_IN).max(LEAST_BLOCKS))
    }

    /// Brightness of every image compared with the mean of all: over the whole image the fringes cancel.
    pub(super) fn brightness(&self) -> Vector {
        let images = self.check.images;
        let mut sums = [0.0; MAX_IMAGES];
        for &number in &self.numbers.lit {
            sums[..images].iter_mut().zip(&self.blocks[number].mean).for_each(|(sum, mean)| *sum += mean);
        }
        let mean = sums[..images].iter().sum::<f64>() / images.max(1) as f64;
        sums.map(|sum| if sum > 0.0 { sum / mean } else { 1.0 })
    }

    /// An image that came twice: no two exposures have the same noise.
    pub(super) fn repeated(&self, scratch: &mut LeftScratch) -> Option<SequenceFault> {
        let is_same = |&number: &usize, image| self.blocks[number].difference_square(image) < SAME_SQUARE;
        let same = |image: usize| self.numbers.lit.iter().all(|number| is_same(number, image));
        let image = (0..self.check.images - 1).find(|&image| same(image))?;
        let residual_share = self.left(self.alike(), scratch).map_or(1.0, |left| left.share);
        Some(SequenceFault { kind: SequenceFaultKind::Duplicated { image }, residual_share, explained_share: 0.0 })
    }

    /// Whether the said steps leave much, or most blocks cannot tell.
    pub(super) fn is_suspicious(&self, scratch: &mut LeftScratch) -> bool {
        let nominal = self.judges().and_then(|judges| self.left(judges, scratch));
        nominal.is_none_or(|left| left.share >= self.check.least_residual_share())
    }

    /// What is wrong where the said steps leave much.
    pub(super) fn fault(&self, scratch: &mut LeftScratch) -> Option<SequenceFault> {
        let Some(judges) = self.judges() else {
            let residual_share = self.residual_share();
            let (kind, explained_share) =
                self.wrong_image(MOST).filter(|&(_, share)| is_less(LESS_WITHOUT, share, residual_share))?;
            return Some(SequenceFault { kind, residual_share, explained_share });
        };
        let residual_share = self.left(judges, scratch)?.share;
        let order = self.fault_of_order(judges, residual_share);
        let order_share = order.map_or(f64::INFINITY, |order| order.share);
        let is_clear = |share: f64| {
            is_less(LESS_THAN_ANY_ORDER, share, order_share) && is_less(LESS_WITHOUT, share, residual_share)
        };
        let fault = |kind, explained_share| Some(SequenceFault { kind, residual_share, explained_share });
        if let Some((kind, share)) = self.wrong_image(1.0 / ONE_IN as f64).filter(|&(_, share)| is_clear(share)) {
            return fault(kind, share);
        }
        match order {
            Some(Order { kind, share, agreement })
                if is_less(LESS, share, residual_share) && agreement >= AGREEMENT =>
            {
                fault(kind, share)
            }
            _ if residual_share < UNEXPLAINED_SHARE => None,
            _ => fault(SequenceFaultKind::Unexplained, order_share.min(residual_share)),
        }
    }

    /// The likeliest of the faults of order that explain the images well, or at least better than the said steps, which leave so
    /// much.
    fn fault_of_order(&self, judges: &'a [usize], residual_share: f64) -> Option<Order> {
        let check = self.check;
        let all: Vec<Hypothesis> = Hypothesis::all_of_order(check.images, check.cycle).collect();
        let promising = self.shares(&all, &self.signals(judges, FEW_TRIED));
        let limit = PROMISING * least_share(&promising).max(FLOOR_SHARE);
        let kept: Vec<Hypothesis> =
            all.into_iter().zip(promising).filter(|&(_, share)| share <= limit).map(|(kept, _)| kept).collect();
        let tried = self.signals(judges, MOST_TRIED);
        let shares = self.shares(&kept, &tried);
        let least = least_share(&shares).max(FLOOR_SHARE);
        let limit = (AS_GOOD * least).min(residual_share / LESS).max(least);
        let (best, share) = kept.into_iter().zip(shares).find(|&(_, share)| share <= limit)?;
        let mut planes = Planes::default();
        check.set_planes(&mut planes, &best, check.fastest_rad());
        let is_better = |signal: &&Signal| {
            let square = |planes: &Planes| planes.unexplained(&signal.directions).square;
            square(&planes) < square(&check.nominal)
        };
        let agreement = tried.clone().filter(is_better).count() as f64 / tried.count() as f64;
        Some(Order { kind: best.kind?, share, agreement })
    }

    /// What hypotheses leave of signals.
    fn shares<'b>(
        &self,
        hypotheses: &[Hypothesis],
        signals: &(impl Iterator<Item = &'b Signal> + Clone + Sync),
    ) -> Vec<f64> {
        let share = |hypothesis| {
            self.left_by(hypothesis, signals.clone(), &mut LeftScratch::default())
                .map_or(f64::INFINITY, |left| left.share)
        };
        hypotheses.par_iter().map(share).collect()
    }

    /// The image without which the others fit best, and what they leave; so many of the blocks must move alike then.
    fn wrong_image(&self, least_alike: f64) -> Option<(SequenceFaultKind, f64)> {
        let images = self.check.images;
        let numbers = thinned_out(&self.numbers.lit, MOST_TRIED);
        let of = |image: usize| {
            let signal = |&number: &usize| self.blocks[number].without(image, self.validity).signal;
            let alike: Vec<Signal> = numbers.clone().filter_map(signal).filter(Signal::is_alike).collect();
            let enough = alike.len() as f64 >= least_alike * numbers.clone().count() as f64;
            let mut planes = Planes::default();
            self.check.set_planes(&mut planes, &Hypothesis::without(image, images), FASTEST_RAD);
            let left = left(&planes, alike.iter(), &mut Values::default()).filter(|_| enough)?;
            Some((SequenceFaultKind::Wrong { image }, left.share))
        };
        let faults: Vec<(SequenceFaultKind, f64)> = (0..images).into_par_iter().filter_map(of).collect();
        faults.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// A fault that a steady motion explains as well, where all blocks would share that motion, and rest without it.
    pub(super) fn resting(&self, scratch: &mut LeftScratch) -> Option<SequenceFault> {
        let said = self.left(self.alike(), scratch)?;
        let [least, most] = said.motions_rad;
        let is_shared = most - least <= 2.0 * RESTING_RAD && least.abs().min(most.abs()) >= SHARED_MOTION_RAD;
        if !is_shared || self.alike().len() < LEAST_BLOCKS {
            return None;
        }
        let tried = self.signals(self.alike(), MOST_TRIED);
        Hypothesis::all_of_order(self.check.images, self.check.cycle).find_map(|hypothesis| {
            let left = self.left_by(&hypothesis, tried.clone(), scratch)?;
            let rests = left.motions_rad.iter().all(|motion| motion.abs() <= RESTING_RAD);
            let fault =
                SequenceFault { kind: hypothesis.kind?, residual_share: said.share, explained_share: left.share };
            (rests && left.share <= said.share.max(RESTING_SHARE)).then_some(fault)
        })
    }

    /// Median of residual ÷ modulation over all lit blocks, noise and all.
    fn residual_share(&self) -> f64 {
        let images = self.check.images as f64;
        let free = images - 3.0;
        let square = |signal: &Signal| {
            let beside = self.check.nominal.unexplained(&signal.directions).square;
            signal.noise_square + beside * images / (2.0 * free)
        };
        let lit = &self.numbers.lit;
        let mut squares: Vec<f64> = self.signals(lit, lit.len()).map(square).collect();
        squares.sort_unstable_by(f64::total_cmp);
        quantile(&squares, 0.5).max(0.0).sqrt()
    }
}

/// Whether one share is so many times less than another.
fn is_less(times: f64, share: f64, than: f64) -> bool {
    times * share.max(FLOOR_SHARE) <= than
}

/// What planes leave of signals; `None` of none.
fn left<'a>(planes: &Planes, signals: impl Iterator<Item = &'a Signal>, scratch: &mut Values) -> Option<Left> {
    let Values { squares, motions_rad } = scratch;
    squares.clear();
    motions_rad.clear();
    for left in signals.map(|signal| planes.unexplained(&signal.directions)) {
        squares.push(left.square);
        motions_rad.push(left.motion_rad);
    }
    if squares.is_empty() {
        return None;
    }
    squares.sort_unstable_by(f64::total_cmp);
    motions_rad.sort_unstable_by(f64::total_cmp);
    let share = quantile(squares, 0.5).sqrt();
    Some(Left { share, motions_rad: ALL_BUT.map(|part| quantile(motions_rad, part)) })
}

/// So many at most, evenly chosen.
fn thinned_out<T>(all: &[T], most: usize) -> impl Iterator<Item = &T> + Clone {
    all.iter().step_by(all.len().div_ceil(most.max(1)).max(1))
}

fn least_share(shares: &[f64]) -> f64 {
    shares.iter().copied().fold(f64::INFINITY, f64::min)
}

/// The value that a part of some, the least first, does not exceed; 0 of none.
fn quantile(values: &[f64], part: f64) -> f64 {
    values.get((part * values.len().saturating_sub(1) as f64).round() as usize).copied().unwrap_or_default()
}
