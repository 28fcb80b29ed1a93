//! The kernel: 32 pixels at a time from their samples to phase, modulation, mean and validity.
//!
//! All in whole numbers of 16 and 32 bits but for one division: the sums, in the way that suits shifts and samples, then the
//! *octant*. What pixels give is judged, counted and stored here.

use std::ops::Range;

use fringeflow_base::grey::PixelFormat;
use fringeflow_base::limits::{MAX_STEPS, MIN_STEPS};
use fringeflow_simd::{Kernel, LANES, Lanes, Level};

use crate::phase::map::{DIM, Exposure, Modulation};
use crate::phase::sample::Sample;
use crate::phase::shifts::PhaseShifts;

use super::even_steps::EvenSteps;
use super::four_step::FourStep;
use super::left_out::LeftOut;
use super::plan::Plan;
use super::side_by_side::SideBySide;
use super::weighted::Weighted;
use super::{Counts, Validity};

/// What samples and sums are compared with.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    /// Stored value from which on a sample is saturated.
    saturation: u16,
    pub(super) grey_per_value: f32,
    /// Least modulation of a valid pixel and of one that is not dim.
    least: Modulation,
    not_dim: Modulation,
    /// Largest residual ÷ modulation; of three steps any.
    pub(super) max_share: f32,
}

impl Limits {
    pub(super) fn new<S: Sample>(format: PixelFormat, validity: &Validity, steps: usize) -> Self {
        let least_grey = validity.min_modulation_grey;
        Self {
            saturation: S::from_grey(validity.saturation_grey, format).value(),
            grey_per_value: format.grey_per_value(),
            least: Modulation::from_grey(least_grey),
            not_dim: Modulation::from_grey(DIM * least_grey),
            max_share: if steps == MIN_STEPS { f32::INFINITY } else { validity.max_residual_share },
        }
    }

    /// Whether a sample is saturated.
    pub(super) fn saturates<S: Sample>(&self, sample: S) -> bool {
        sample.value() >= self.saturation
    }

    /// Whether a fit is good enough.
    pub(super) fn accepts(&self, modulation: Modulation, residual_grey: f32) -> bool {
        modulation >= self.least && residual_grey <= self.max_share.min(f32::MAX) * modulation.grey()
    }
}

/// Some rows of the images of a camera, and where their phases go.
pub(super) struct Band<'a, S> {
    pub(super) samples: &'a [&'a [S]],
    pub(super) plan: &'a Plan,
    pub(super) limits: &'a Limits,
    pub(super) shifts: &'a PhaseShifts,
    pub(super) phase: &'a mut [u16],
    pub(super) modulation: &'a mut [Modulation],
    pub(super) mean: &'a mut [u8],
    pub(super) valid: &'a mut [bool],
}

impl<S: Sample> Band<'_, S> {
    /// Decodes it.
    pub(super) fn decode(self, level: Level) -> Counts {
        fringeflow_simd::run(level, self)
    }
}

/// What 32 pixels give.
#[derive(Clone, Copy)]
pub(super) struct Block<L: Lanes> {
    pub(super) phase: L::Words,
    pub(super) modulation: L::Words,
    pub(super) mean: L::Words,
    /// Where samples fit no sinusoid.
    pub(super) misfits: L::Mask,
    /// Greatest sample.
    pub(super) greatest: L::Words,
}

/// How blocks of 32 pixels are decoded.
pub(super) trait Way<S: Sample> {
    /// Whether two blocks side by side take less than one after the other: each is a long chain of operations that wait for those
    /// before, and a line of memory, the bytes of two blocks, is read at once.
    const IS_CHAIN: bool;

    /// Decodes some blocks; `of` tells the samples of the k-th image in the order of the plan, of each block.
    fn decode<'a, L: Lanes, const COUNT: usize>(
        &self,
        blocks: SideBySide<L, COUNT>,
        of: impl Fn(usize) -> [&'a [S; LANES]; COUNT],
    ) -> [Block<L>; COUNT];
}

impl<S: Sample> Kernel for Band<'_, S> {
    type Output = Counts;

    #[inline(always)]
    fn run<L: Lanes>(mut self, lanes: L) -> Counts {
        let (plan, limits) = (self.plan, self.limits);
        let mut counts = if S::IS_BYTE && plan.is_even {
            match plan.steps {
                3 => self.decode_blocks::<L, _, 4>(lanes, &EvenSteps::<1>::new(plan, limits)),
                // What is asked in the loop would part its blocks.
                4 if limits.max_share >= 1.0 => {
                    self.decode_blocks::<L, _, 4>(lanes, &FourStep::<true>::new(plan, limits))
                }
                4 => self.decode_blocks::<L, _, 4>(lanes, &FourStep::<false>::new(plan, limits)),
                5..=8 => self.decode_blocks::<L, _, 8>(lanes, &EvenSteps::<2>::new(plan, limits)),
                9..=12 => self.decode_blocks::<L, _, 12>(lanes, &EvenSteps::<3>::new(plan, limits)),
                _ => self.decode_blocks::<L, _, MAX_STEPS>(lanes, &EvenSteps::<4>::new(plan, limits)),
            }
        } else {
            self.decode_blocks::<L, _, MAX_STEPS>(lanes, &Weighted { plan, limits })
        };
        if counts.exposure.saturated_pixels > 0 {
            self.leave_out(&mut counts);
        }
        counts
    }
}

impl<S: Sample> Band<'_, S> {
    /// Decodes all blocks of up to `STEPS` images.
    #[inline(always)]
    fn decode_blocks<L: Lanes, W: Way<S>, const STEPS: usize>(&mut self, lanes: L, way: &W) -> Counts {
        let mut counts = Counts::default();
        let pixels = self.phase.len();
        let (whole, rest) = (pixels / LANES, pixels % LANES);
        let mut samples = [[].as_slice(); STEPS];
        for (samples, k) in samples.iter_mut().zip(self.plan.order).take(self.plan.steps) {
            *samples = self.samples[k];
        }
        let in_pairs = if L::TWO_AT_ONCE && W::IS_CHAIN { whole / 2 * 2 } else { 0 };
        self.decode_part::<L, W, STEPS, 2>(lanes, way, &samples, 0..in_pairs, &mut counts);
        self.decode_part::<L, W, STEPS, 1>(lanes, way, &samples, in_pairs..whole, &mut counts);
        if rest > 0 {
            let mut padded = [[S::default(); LANES]; STEPS];
            for (padded, samples) in padded.iter_mut().zip(&samples).take(self.plan.steps) {
                padded[..rest].copy_from_slice(&samples[whole * LANES..]);
            }
            let [decoded] = way.decode(SideBySide::<L, 1>(lanes), |k| [&padded[k]]);
            let (mut phase, mut modulation, mut mean, mut valid) = ([0; LANES], [0; LANES], [0; LANES], [false; LANES]);
            let to = (&mut phase, &mut modulation, &mut mean, &mut valid);
            counts = counts.plus(decoded.judge_and_store(lanes, self.limits, (1 << rest) - 1, to));
            let places = whole * LANES..;
            self.phase[places.clone()].copy_from_slice(&phase[..rest]);
            bytemuck::cast_slice_mut(&mut self.modulation[places.clone()]).copy_from_slice(&modulation[..rest]);
            self.mean[places.clone()].copy_from_slice(&mean[..rest]);
            self.valid[places].copy_from_slice(&valid[..rest]);
        }
        counts
    }

    /// Decodes whole blocks, `COUNT` at a time.
    #[inline(always)]
    fn decode_part<L: Lanes, W: Way<S>, const STEPS: usize, const COUNT: usize>(
        &mut self,
        lanes: L,
        way: &W,
        samples: &[&[S]; STEPS],
        blocks: Range<usize>,
        counts: &mut Counts,
    ) {
        let (pixels, times) = (blocks.start * LANES..blocks.end * LANES, blocks.len() / COUNT);
        let mut chunks = [[].as_slice(); STEPS];
        for (chunks, samples) in chunks.iter_mut().zip(samples).take(self.plan.steps) {
            *chunks = &samples[pixels.clone()].as_chunks::<LANES>().0.as_chunks::<COUNT>().0[..times];
        }
        let phase = self.phase[pixels.clone()].as_chunks_mut::<LANES>().0.as_chunks_mut::<COUNT>().0;
        let modulation: &mut [u16] = bytemuck::cast_slice_mut(&mut self.modulation[pixels.clone()]);
        let modulation = modulation.as_chunks_mut::<LANES>().0.as_chunks_mut::<COUNT>().0;
        let mean = self.mean[pixels.clone()].as_chunks_mut::<LANES>().0.as_chunks_mut::<COUNT>().0;
        let valid = self.valid[pixels].as_chunks_mut::<LANES>().0.as_chunks_mut::<COUNT>().0;
        // Lengths that are plainly the same are not asked for in the loop.
        let (phase, modulation, mean, valid) =
            (&mut phase[..times], &mut modulation[..times], &mut mean[..times], &mut valid[..times]);
        // A copy, which nothing that is stored can change.
        let limits = *self.limits;
        for t in 0..times {
            let decoded = way.decode(SideBySide::<L, COUNT>(lanes), |k| chunks[k][t].each_ref());
            for i in 0..COUNT {
                let to = (&mut phase[t][i], &mut modulation[t][i], &mut mean[t][i], &mut valid[t][i]);
                *counts = counts.plus(decoded[i].judge_and_store(lanes, &limits, u32::MAX, to));
            }
        }
    }
}

/// Where the phases, modulations, means and validities of a block go.
type Places<'a> = (&'a mut [u16; LANES], &'a mut [u16; LANES], &'a mut [u8; LANES], &'a mut [bool; LANES]);

impl<L: Lanes> Block<L> {
    /// Judges and counts the pixels that are used, a bit each, and stores all. Pixels with saturated samples are not counted as
    /// valid here.
    #[inline(always)]
    fn judge_and_store(&self, lanes: L, limits: &Limits, used: u32, to: Places<'_>) -> Counts {
        let saturated = lanes.bits(lanes.is_at_least(self.greatest, lanes.word(limits.saturation as i16))) & used;
        let lit = lanes.is_at_least(self.modulation, lanes.word(limits.least.0 as i16));
        let not_dim = lanes.is_at_least(self.modulation, lanes.word(limits.not_dim.0 as i16));
        let valid = lanes.and_not(lit, self.misfits);
        let (phase, modulation, mean, valid_to) = to;
        lanes.store(self.phase, phase);
        lanes.store(self.modulation, modulation);
        lanes.store_bytes(self.mean, mean);
        lanes.store_mask(valid, valid_to);
        let (lit, not_dim) = (lanes.bits(lit) & used & !saturated, lanes.bits(not_dim));
        Counts {
            valid_pixels: u64::from((lanes.bits(valid) & used & !saturated).count_ones()),
            exposure: Exposure {
                lit_pixels: u64::from((lit | saturated).count_ones()),
                saturated_pixels: u64::from(saturated.count_ones()),
                dim_pixels: u64::from((lit & !not_dim).count_ones()),
            },
        }
    }
}

impl<S: Sample> Band<'_, S> {
    /// Solves pixels with saturated samples again without these.
    #[cold]
    #[inline(never)]
    fn leave_out(&mut self, counts: &mut Counts) {
        let mut left_out = LeftOut::new(self.shifts);
        let pixels = self.phase.len();
        for begin in (0..pixels).step_by(LANES) {
            let mut saturated = [false; LANES];
            let count = LANES.min(pixels - begin);
            for samples in self.samples {
                for (saturated, &sample) in saturated.iter_mut().zip(&samples[begin..begin + count]) {
                    *saturated |= self.limits.saturates(sample);
                }
            }
            for (pixel, _) in (begin..).zip(saturated).filter(|(_, is_saturated)| *is_saturated) {
                let kept = |k: usize| {
                    let sample = self.samples[k][pixel];
                    (!self.limits.saturates(sample)).then(|| sample.grey(self.limits.grey_per_value))
                };
                let solution = left_out.solve(kept);
                self.valid[pixel] = solution.is_some_and(|s| self.limits.accepts(s.modulation, s.residual_grey));
                if let Some(solution) = solution {
                    self.phase[pixel] = solution.phase;
                    self.modulation[pixel] = solution.modulation;
                    self.mean[pixel] = solution.mean;
                }
                counts.valid_pixels += u64::from(self.valid[pixel]);
            }
        }
    }
}
