//! The decoding kernel (paper, section 2.1). In: the samples of a band of pixels. Out: their phase, modulation, mean
//! and validity. Cost: see [`super`].
//!
//! It decodes 32 pixels at a time, in whole numbers of 16 and 32 bits except for one division. A [`BlockDecoder`] that
//! suits shifts and samples computes the values; this module checks, counts and stores them.

use std::ops::Range;

use fringeflow_base::limits::MAX_STEPS;
use fringeflow_simd::{Kernel, LANES, Lanes, Level};

use crate::phase::map::Modulation;
use crate::phase::sample::Sample;
use crate::phase::shifts::PhaseShifts;

use super::block::{BlockDecoder, Counts};
use super::even_steps::EvenSteps;
use super::four_step::FourStep;
use super::plan::Plan;
use super::side_by_side::SideBySide;
use super::unsaturated::UnsaturatedSolver;
use super::validity::Limits;
use super::weighted::Weighted;

/// A band of pixels: samples of all images, and the planes for the results.
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
    pub(super) fn decode(self, level: Level) -> Counts {
        fringeflow_simd::run(level, self)
    }
}

impl<S: Sample> Kernel for Band<'_, S> {
    type Output = Counts;

    #[inline(always)]
    fn run<L: Lanes>(mut self, lanes: L) -> Counts {
        let (plan, limits) = (self.plan, self.limits);
        let mut counts = if S::IS_BYTE && plan.is_even {
            match plan.steps {
                3 => self.decode_blocks::<L, _, 4>(lanes, &EvenSteps::<1>::new(plan, limits)),
                // Decided here: a branch inside the loop would keep its blocks from overlapping.
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
            self.decode_saturated(&mut counts);
        }
        counts
    }
}

impl<S: Sample> Band<'_, S> {
    /// Decodes all blocks of up to `STEPS` images: pairs of blocks, then single ones, then the incomplete last one.
    #[inline(always)]
    fn decode_blocks<L: Lanes, D: BlockDecoder<S>, const STEPS: usize>(&mut self, lanes: L, decoder: &D) -> Counts {
        let mut counts = Counts::default();
        let pixels = self.phase.len();
        let (whole, rest) = (pixels / LANES, pixels % LANES);
        let mut samples = [[].as_slice(); STEPS];
        for (samples, k) in samples.iter_mut().zip(self.plan.order).take(self.plan.steps) {
            *samples = self.samples[k];
        }
        let in_pairs = if L::TWO_AT_ONCE && D::IS_CHAIN { whole / 2 * 2 } else { 0 };
        // A local copy stays in registers: stores through references could change `self.limits`.
        let (limits, steps) = (*self.limits, self.plan.steps);
        let pairs = samples.map(|samples| samples.get(..in_pairs * LANES).unwrap_or_default());
        decode_part::<S, L, D, STEPS, 2>(
            lanes,
            decoder,
            &limits,
            (&pairs, steps),
            self.planes(0..in_pairs * LANES),
            u32::MAX,
            &mut counts,
        );
        let mut padded = [[S::default(); LANES]; STEPS];
        let (mut phase, mut modulation, mut mean, mut valid) = ([0; LANES], [0; LANES], [0; LANES], [false; LANES]);
        for (padded, samples) in padded.iter_mut().zip(&samples).take(steps) {
            padded[..rest].copy_from_slice(&samples[whole * LANES..]);
        }
        // One loop for single blocks and the incomplete one: each copy of a decoder is large.
        for is_last in [false, true] {
            let (samples, planes, used) = if is_last {
                let pixels = if rest > 0 { LANES } else { 0 };
                let planes = Planes {
                    phase: &mut phase[..pixels],
                    modulation: &mut modulation[..pixels],
                    mean: &mut mean[..pixels],
                    valid: &mut valid[..pixels],
                };
                (padded.each_ref().map(|padded| &padded[..pixels]), planes, (1 << rest) - 1)
            } else {
                let singles = in_pairs * LANES..whole * LANES;
                let samples = samples.map(|samples| samples.get(singles.clone()).unwrap_or_default());
                (samples, self.planes(singles), u32::MAX)
            };
            decode_part::<S, L, D, STEPS, 1>(lanes, decoder, &limits, (&samples, steps), planes, used, &mut counts);
        }
        let last = self.planes(whole * LANES..pixels);
        last.phase.copy_from_slice(&phase[..rest]);
        last.modulation.copy_from_slice(&modulation[..rest]);
        last.mean.copy_from_slice(&mean[..rest]);
        last.valid.copy_from_slice(&valid[..rest]);
        counts
    }

    /// The results of some pixels.
    fn planes(&mut self, pixels: Range<usize>) -> Planes<'_> {
        Planes {
            phase: &mut self.phase[pixels.clone()],
            modulation: bytemuck::cast_slice_mut(&mut self.modulation[pixels.clone()]),
            mean: &mut self.mean[pixels.clone()],
            valid: &mut self.valid[pixels],
        }
    }
}

/// Results of pixels.
struct Planes<'a> {
    phase: &'a mut [u16],
    modulation: &'a mut [u16],
    mean: &'a mut [u8],
    valid: &'a mut [bool],
}

/// Decodes whole blocks, `COUNT` at a time. Only the pixels of a block whose bit in `used` is set count.
#[inline(always)]
fn decode_part<S: Sample, L: Lanes, D: BlockDecoder<S>, const STEPS: usize, const COUNT: usize>(
    lanes: L,
    decoder: &D,
    limits: &Limits,
    (samples, steps): (&[&[S]; STEPS], usize),
    Planes { phase, modulation, mean, valid }: Planes<'_>,
    used: u32,
    counts: &mut Counts,
) {
    let times = phase.len() / (COUNT * LANES);
    let mut chunks = [[].as_slice(); STEPS];
    for (chunks, samples) in chunks.iter_mut().zip(samples).take(steps) {
        *chunks = &samples.as_chunks::<LANES>().0.as_chunks::<COUNT>().0[..times];
    }
    // With equal lengths in plain sight, the compiler drops the bounds checks in the loop.
    let phase = &mut phase.as_chunks_mut::<LANES>().0.as_chunks_mut::<COUNT>().0[..times];
    let modulation = &mut modulation.as_chunks_mut::<LANES>().0.as_chunks_mut::<COUNT>().0[..times];
    let mean = &mut mean.as_chunks_mut::<LANES>().0.as_chunks_mut::<COUNT>().0[..times];
    let valid = &mut valid.as_chunks_mut::<LANES>().0.as_chunks_mut::<COUNT>().0[..times];
    for t in 0..times {
        let decoded = decoder.decode(SideBySide::<L, COUNT>(lanes), |k| chunks[k][t].each_ref());
        for i in 0..COUNT {
            let to = (&mut phase[t][i], &mut modulation[t][i], &mut mean[t][i], &mut valid[t][i]);
            *counts = counts.plus(decoded[i].check_and_store(lanes, limits, used, to));
        }
    }
}

impl<S: Sample> Band<'_, S> {
    /// Solves pixels with saturated samples again, without these samples.
    #[cold]
    #[inline(never)]
    fn decode_saturated(&mut self, counts: &mut Counts) {
        let mut solver = UnsaturatedSolver::new(self.shifts);
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
                let unsaturated_grey = |k: usize| {
                    let sample = self.samples[k][pixel];
                    (!self.limits.saturates(sample)).then(|| sample.grey(self.limits.grey_per_value))
                };
                let solution = solver.solve(unsaturated_grey);
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
