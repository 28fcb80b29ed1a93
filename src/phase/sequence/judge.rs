//! From blocks to a verdict.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::grey::GreyLevels;
use crate::phase::Validity;

use super::LEAST_IMAGES;
use super::block::{Block, Signal};
use super::fault::{Hypothesis, SequenceFault, SequenceFaultKind};
use super::span::{self, Planes};

/// Fastest motion that may explain the said steps, rad an image.
const FASTEST_RAD: f64 = 1.2;
/// Fastest motion that may explain others, a share of a step. One of two steps back is the mirror image of a resting scene, in
/// which what is lost looks as if it came twice.
const FASTEST_STEPS: f64 = 0.9;
/// Fewest blocks that are asked.
const LEAST_BLOCKS: usize = 4;
/// Most blocks that other steps are tried with, first all of them, then those that leave not much more than the best.
const FEW_TRIED: usize = 12;
const MOST_TRIED: usize = 64;
const PROMISING: f64 = 2.0;
/// Greatest variance beside the fringes, a share of the squared modulation, of a block whose pixels move alike.
const MAX_NOISE_SQUARE: f64 = 0.08;
/// Unexplained share of the modulation from which on other steps are tried: a hand that is waved before the cameras leaves up to
/// 0.075. Of longer cycles it is less, as a step is.
const SUSPICIOUS_SHARE: f64 = 0.06;
const SUSPICIOUS_STEPS: usize = 8;
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

/// Judges the windows of one camera and one cycle.
#[derive(Clone, Debug)]
pub struct SequenceCheck {
    /// Phase shifts from the first image on, rad, as long as any fault reaches.
    shifts_rad: Vec<f64>,
    images: usize,
    cycle: usize,
    nominal: Planes,
}

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

impl SequenceCheck {
    /// Judges windows of so many images, of which the first is said to show step `first_step` of a cycle with these shifts, rad,
    /// and each of the others the step behind that of the one before.
    #[must_use]
    pub fn new(cycle_rad: &[f64], first_step: usize, images: usize) -> Self {
        let cycle = cycle_rad.len();
        let reach = images + cycle;
        let shifts_rad: Vec<f64> =
            cycle_rad.iter().cycle().skip(first_step % cycle.max(1)).take(reach).copied().collect();
        let nominal = planes(&shifts_rad, &Hypothesis::nominal(images), FASTEST_RAD);
        Self { shifts_rad, images, cycle, nominal }
    }

    /// What is wrong with the images of a camera, each `width · height` grey levels row by row, in the order of their times;
    /// `None` where they are as said, or where too little of them is lit to tell.
    #[must_use]
    pub fn fault(
        &self,
        images: &[GreyLevels<'_>],
        width: usize,
        height: usize,
        validity: &Validity,
    ) -> Option<SequenceFault> {
        let fits = |image: &GreyLevels<'_>| image.pixels() == width * height;
        if images.len() != self.images || self.images < LEAST_IMAGES || !images.iter().all(fits) {
            return None;
        }
        let lit = |blocks: Vec<Block>| -> Vec<(Block, Signal)> {
            blocks.into_iter().filter_map(|block| block.signal(validity).map(|signal| (block, signal))).collect()
        };
        let blocks = lit(Block::all(images, width, height, validity));
        if blocks.len() < LEAST_BLOCKS {
            return None;
        }
        let told = Told { check: self, blocks: &blocks, validity };
        if let Some(fault) = told.repeated() {
            return Some(fault);
        }
        if !told.is_suspicious() {
            return told.resting();
        }
        // Perhaps the images are of different brightness only.
        let brightness = brightness(&blocks);
        let levelled = lit(blocks.iter().map(|(block, _)| block.levelled(&brightness)).collect());
        let told = Told { check: self, blocks: &levelled, validity };
        if told.is_suspicious() { told.fault() } else { None }
    }

    /// What a fault leaves unexplained at any motion, a share of the modulation, where the scene moves by `motion_rad` an
    /// image and there is no noise: a fault that leaves little cannot be seen. The least of the ways in which it may have
    /// come about; 1 where it shows something else than fringes.
    #[must_use]
    pub fn residual_share(&self, fault: SequenceFaultKind, motion_rad: f64) -> f64 {
        let hypotheses = Hypothesis::of_kind(fault, self.images);
        let shares = hypotheses.iter().map(|hypothesis| {
            let (shifts_rad, times) = angles(&self.shifts_rad, hypothesis);
            self.nominal.unexplained(&span::directions(&shifts_rad, &times, motion_rad)).square.sqrt()
        });
        shares.fold(1.0, f64::min)
    }

    /// Share of the modulation from which on a fault is looked for.
    #[must_use]
    pub fn least_residual_share(&self) -> f64 {
        SUSPICIOUS_SHARE * (SUSPICIOUS_STEPS as f64 / self.cycle.max(1) as f64).min(1.0)
    }

    /// Fastest motion that may explain other steps than the said ones, rad an image.
    fn fastest_rad(&self) -> f64 {
        FASTEST_RAD.min(FASTEST_STEPS * TAU / self.cycle.max(1) as f64)
    }
}

/// The blocks of a window that are lit.
struct Told<'a> {
    check: &'a SequenceCheck,
    blocks: &'a [(Block, Signal)],
    validity: &'a Validity,
}

impl Told<'_> {
    /// The signals of the blocks whose pixels move alike, those that do most first.
    fn alike(&self) -> Vec<&Signal> {
        let mut alike: Vec<&Signal> = self.blocks.iter().map(|(_, signal)| signal).filter(|s| is_alike(s)).collect();
        alike.sort_by(|a, b| a.noise_square.total_cmp(&b.noise_square));
        alike
    }

    /// Those that the steps are judged by; `None` where too few can tell.
    fn judges(&self) -> Option<Vec<&Signal>> {
        let mut alike = self.alike();
        let judges = self.blocks.len().div_ceil(ONE_IN).max(LEAST_BLOCKS);
        (alike.len() >= judges).then(|| {
            alike.truncate(judges);
            alike
        })
    }

    /// An image that came twice: no two exposures have the same noise.
    fn repeated(&self) -> Option<SequenceFault> {
        let same = |image: usize| self.blocks.iter().all(|(block, _)| block.difference_square(image) < SAME_SQUARE);
        let image = (0..self.check.images - 1).find(|&image| same(image))?;
        let residual_share = left(&self.check.nominal, &self.alike()).map_or(1.0, |left| left.share);
        Some(SequenceFault { kind: SequenceFaultKind::Duplicated { image }, residual_share, explained_share: 0.0 })
    }

    /// Whether the said steps leave much, or most blocks cannot tell.
    fn is_suspicious(&self) -> bool {
        let nominal = self.judges().and_then(|judges| left(&self.check.nominal, &judges));
        nominal.is_none_or(|left| left.share >= self.check.least_residual_share())
    }

    fn fault(&self) -> Option<SequenceFault> {
        let Some(judges) = self.judges() else {
            let residual_share = self.residual_share();
            let (kind, explained_share) =
                self.wrong_image(MOST).filter(|&(_, share)| is_less(LESS_WITHOUT, share, residual_share))?;
            return Some(SequenceFault { kind, residual_share, explained_share });
        };
        let residual_share = left(&self.check.nominal, &judges)?.share;
        let order = self.fault_of_order(&judges, residual_share);
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
    fn fault_of_order(&self, judges: &[&Signal], residual_share: f64) -> Option<Order> {
        let check = self.check;
        let hypotheses = Hypothesis::of_order(check.images, check.cycle);
        let all: Vec<&Hypothesis> = hypotheses.iter().collect();
        let promising = self.shares(&all, &thinned_out(judges, FEW_TRIED));
        let limit = PROMISING * least_share(&promising).max(FLOOR_SHARE);
        let kept: Vec<&Hypothesis> =
            all.into_iter().zip(promising).filter(|&(_, share)| share <= limit).map(|(kept, _)| kept).collect();
        let tried = thinned_out(judges, MOST_TRIED);
        let shares = self.shares(&kept, &tried);
        let least = least_share(&shares).max(FLOOR_SHARE);
        let limit = (AS_GOOD * least).min(residual_share / LESS).max(least);
        let (best, share) = kept.into_iter().zip(shares).find(|&(_, share)| share <= limit)?;
        let planes = self.planes(best);
        let is_better = |signal: &&&Signal| {
            let square = |planes: &Planes| planes.unexplained(&signal.directions).square;
            square(&planes) < square(&check.nominal)
        };
        let agreement = tried.iter().filter(is_better).count() as f64 / tried.len() as f64;
        Some(Order { kind: best.kind?, share, agreement })
    }

    /// The planes of a fault.
    fn planes(&self, hypothesis: &Hypothesis) -> Planes {
        planes(&self.check.shifts_rad, hypothesis, self.check.fastest_rad())
    }

    /// What hypotheses leave of signals.
    fn shares(&self, hypotheses: &[&Hypothesis], signals: &[&Signal]) -> Vec<f64> {
        let share =
            |hypothesis: &&Hypothesis| left(&self.planes(hypothesis), signals).map_or(f64::INFINITY, |left| left.share);
        hypotheses.par_iter().map(share).collect()
    }

    /// The image without which the others fit best, and what they leave; so many of the blocks must move alike then.
    fn wrong_image(&self, least_alike: f64) -> Option<(SequenceFaultKind, f64)> {
        let check = self.check;
        let blocks: Vec<&Block> = self.blocks.iter().map(|(block, _)| block).collect();
        let blocks = thinned_out(&blocks, MOST_TRIED);
        let of = |image: usize| {
            let kept: Vec<usize> = (0..check.images).filter(|&i| i != image).collect();
            let hypothesis = Hypothesis { kind: None, steps: kept.clone(), times: kept };
            let signals: Vec<Signal> =
                blocks.iter().filter_map(|block| block.without(image).signal(self.validity)).collect();
            let alike: Vec<&Signal> = signals.iter().filter(|signal| is_alike(signal)).collect();
            let enough = alike.len() as f64 >= least_alike * blocks.len() as f64;
            let left = left(&planes(&check.shifts_rad, &hypothesis, FASTEST_RAD), &alike).filter(|_| enough)?;
            Some((SequenceFaultKind::Wrong { image }, left.share))
        };
        let faults: Vec<(SequenceFaultKind, f64)> = (0..check.images).into_par_iter().filter_map(of).collect();
        faults.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// A fault that a steady motion explains as well, where all blocks would share that motion, and rest without it.
    fn resting(&self) -> Option<SequenceFault> {
        let alike = self.alike();
        let said = left(&self.check.nominal, &alike)?;
        let [least, most] = said.motions_rad;
        let is_shared = most - least <= 2.0 * RESTING_RAD && least.abs().min(most.abs()) >= SHARED_MOTION_RAD;
        if !is_shared || alike.len() < LEAST_BLOCKS {
            return None;
        }
        let tried = thinned_out(&alike, MOST_TRIED);
        Hypothesis::of_order(self.check.images, self.check.cycle).iter().find_map(|hypothesis| {
            let left = left(&self.planes(hypothesis), &tried)?;
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
        let mut squares: Vec<f64> = self
            .blocks
            .iter()
            .map(|(_, signal)| {
                let beside = self.check.nominal.unexplained(&signal.directions).square;
                signal.noise_square + beside * images / (2.0 * free)
            })
            .collect();
        quantile(&mut squares, 0.5).max(0.0).sqrt()
    }
}

/// Whether one share is so many times less than another.
fn is_less(times: f64, share: f64, than: f64) -> bool {
    times * share.max(FLOOR_SHARE) <= than
}

fn is_alike(signal: &Signal) -> bool {
    signal.noise_square <= MAX_NOISE_SQUARE
}

/// What planes leave of signals; `None` of none.
fn left(planes: &Planes, signals: &[&Signal]) -> Option<Left> {
    if signals.is_empty() {
        return None;
    }
    let left = signals.iter().map(|signal| planes.unexplained(&signal.directions));
    let (mut squares, mut motions): (Vec<f64>, Vec<f64>) = left.map(|left| (left.square, left.motion_rad)).unzip();
    let share = quantile(&mut squares, 0.5).sqrt();
    Some(Left { share, motions_rad: ALL_BUT.map(|part| quantile(&mut motions, part)) })
}

fn planes(shifts_rad: &[f64], hypothesis: &Hypothesis, fastest_rad: f64) -> Planes {
    let (shifts_rad, times) = angles(shifts_rad, hypothesis);
    Planes::new(&shifts_rad, &times, fastest_rad)
}

/// Phase shifts and times of a hypothesis.
fn angles(shifts_rad: &[f64], hypothesis: &Hypothesis) -> (Vec<f64>, Vec<f64>) {
    let shift = |&step: &usize| shifts_rad.get(step).copied().unwrap_or_default();
    (hypothesis.steps.iter().map(shift).collect(), hypothesis.times.iter().map(|&time| time as f64).collect())
}

/// Brightness of every image compared with the mean of all: over the whole image the fringes cancel.
fn brightness(blocks: &[(Block, Signal)]) -> Vec<f64> {
    let images = blocks.first().map_or(0, |(block, _)| block.mean().count());
    let mut sums = vec![0.0; images];
    for (block, _) in blocks {
        sums.iter_mut().zip(block.mean()).for_each(|(sum, mean)| *sum += mean);
    }
    let mean = sums.iter().sum::<f64>() / images.max(1) as f64;
    sums.iter().map(|&sum| if sum > 0.0 { sum / mean } else { 1.0 }).collect()
}

/// So many at most, evenly chosen.
fn thinned_out<T: Copy>(all: &[T], most: usize) -> Vec<T> {
    all.iter().step_by(all.len().div_ceil(most).max(1)).copied().collect()
}

fn least_share(shares: &[f64]) -> f64 {
    shares.iter().copied().fold(f64::INFINITY, f64::min)
}

/// The value that a part of some does not exceed; 0 of none.
fn quantile(values: &mut [f64], part: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get((part * values.len().saturating_sub(1) as f64).round() as usize).copied().unwrap_or_default()
}
