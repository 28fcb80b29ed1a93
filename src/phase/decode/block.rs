//! The kernel: 32 pixels at a time from their samples to phase, modulation, mean and validity.
//!
//! All in whole numbers of 16 and 32 bits but for one division: the sums, the arctangent of min/max as a polynomial of
//! fractions of 2^15, and the modulation as max · √(1 + (min/max)²), a polynomial of the same square.

use crate::grey::PixelFormat;
use crate::simd::{self, Kernel, LANES, Lanes, Level};

use super::super::map::{DIM, Exposure, Modulation};
use super::super::sample::Sample;
use super::super::shifts::{MAX_STEPS, MIN_STEPS, PhaseShifts};
use super::left_out::LeftOut;
use super::plan::Plan;
use super::{Counts, Validity};

/// Coefficients of `4·atan(t)/2π ≈ t·(c0 + c1·t² + …)` on [0, 1], minimax, times 2^15; largest error 0.12 · 2^−16 turn.
const ARCTANGENT: [i16; 5] = [20858, -6890, 3758, -1776, 435];
/// Coefficients of `√(1 + u) − 1 ≈ u·(c0 + c1·u + …)` on [0, 1], minimax, times 2^15; largest error 1e-4.
const ROOT: [i16; 3] = [16309, -3565, 832];

/// What samples and sums are compared with.
pub(super) struct Limits {
    /// Stored value from which on a sample is saturated.
    saturation: u16,
    pub(super) grey_per_value: f32,
    /// Least modulation of a valid pixel and of one that is not dim.
    least: Modulation,
    not_dim: Modulation,
    /// Largest residual ÷ modulation; of three steps any.
    max_share: f32,
}

impl Limits {
    pub(super) fn new<S: Sample>(format: PixelFormat, validity: &Validity, steps: usize) -> Self {
        let least_grey = validity.min_modulation_grey;
        Self {
            saturation: S::from_grey(validity.saturation_grey, format).value(),
            grey_per_value: format.grey_per_value(),
            least: Modulation::of_grey(least_grey),
            not_dim: Modulation::of_grey(DIM * least_grey),
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
        simd::run(level, self)
    }
}

/// What 32 pixels give.
struct Block<L: Lanes> {
    phase: L::Words,
    modulation: L::Words,
    mean: L::Words,
    /// Where samples fit no sinusoid.
    misfits: L::Mask,
    /// Greatest sample.
    greatest: L::Words,
}

impl<S: Sample> Kernel for Band<'_, S> {
    type Output = Counts;

    #[inline(always)]
    fn run<L: Lanes>(mut self, lanes: L) -> Counts {
        let (mut counts, mut left_out) = (Counts::default(), LeftOut::new(self.shifts));
        let whole = self.phase.len() / LANES;
        let mut chunks = [[].as_slice(); MAX_STEPS];
        for (chunks, k) in chunks.iter_mut().zip(self.plan.order).take(self.plan.steps) {
            *chunks = self.samples[k].as_chunks::<LANES>().0;
        }
        let chunks = &chunks[..self.plan.steps];
        for block in 0..whole {
            let decoded = decode_block(lanes, self.plan, self.limits, |k| &chunks[k][block]);
            self.finish(lanes, block, LANES, &decoded, &mut counts, &mut left_out);
        }
        let rest = self.phase.len() % LANES;
        if rest > 0 {
            let mut padded = [[S::default(); LANES]; MAX_STEPS];
            for (padded, k) in padded.iter_mut().zip(self.plan.order).take(self.plan.steps) {
                padded[..rest].copy_from_slice(&self.samples[k][whole * LANES..]);
            }
            let decoded = decode_block(lanes, self.plan, self.limits, |k| &padded[k]);
            self.finish(lanes, whole, rest, &decoded, &mut counts, &mut left_out);
        }
        counts
    }
}

impl<S: Sample> Band<'_, S> {
    /// Judges and stores the first `count` pixels of a block.
    #[inline(always)]
    fn finish<L: Lanes>(
        &mut self,
        lanes: L,
        block: usize,
        count: usize,
        decoded: &Block<L>,
        counts: &mut Counts,
        left_out: &mut LeftOut<'_>,
    ) {
        let used = if count == LANES { u32::MAX } else { (1 << count) - 1 };
        let saturated =
            lanes.bits(lanes.is_at_least(decoded.greatest, lanes.word(self.limits.saturation as i16))) & used;
        let lit = lanes.is_at_least(decoded.modulation, lanes.word(self.limits.least.0 as i16));
        let not_dim = lanes.is_at_least(decoded.modulation, lanes.word(self.limits.not_dim.0 as i16));
        let valid = lanes.and_not(lit, decoded.misfits);
        let (lit, not_dim) = (lanes.bits(lit) & used & !saturated, lanes.bits(not_dim));
        counts.exposure = counts.exposure.plus(Exposure {
            lit_pixels: u64::from((lit | saturated).count_ones()),
            saturated_pixels: u64::from(saturated.count_ones()),
            dim_pixels: u64::from((lit & !not_dim).count_ones()),
        });
        counts.valid_pixels += u64::from((lanes.bits(valid) & used & !saturated).count_ones());
        let begin = block * LANES;
        let places = begin..begin + count;
        if let (Ok(phase), Ok(modulation), Ok(mean), Ok(valid_to)) = (
            (&mut self.phase[places.clone()]).try_into(),
            bytemuck::cast_slice_mut(&mut self.modulation[places.clone()]).try_into(),
            (&mut self.mean[places.clone()]).try_into(),
            (&mut self.valid[places.clone()]).try_into(),
        ) {
            lanes.store(decoded.phase, phase);
            lanes.store(decoded.modulation, modulation);
            lanes.store_bytes(decoded.mean, mean);
            lanes.store_mask(valid, valid_to);
        } else {
            let (mut phase, mut modulation, mut mean, mut truth) = ([0; LANES], [0; LANES], [0; LANES], [false; LANES]);
            lanes.store(decoded.phase, &mut phase);
            lanes.store(decoded.modulation, &mut modulation);
            lanes.store_bytes(decoded.mean, &mut mean);
            lanes.store_mask(valid, &mut truth);
            self.phase[places.clone()].copy_from_slice(&phase[..count]);
            bytemuck::cast_slice_mut(&mut self.modulation[places.clone()]).copy_from_slice(&modulation[..count]);
            self.mean[places.clone()].copy_from_slice(&mean[..count]);
            self.valid[places].copy_from_slice(&truth[..count]);
        }
        if saturated != 0 {
            self.leave_out(begin, saturated, counts, left_out);
        }
    }

    /// Solves pixels with saturated samples again without these.
    #[cold]
    #[inline(never)]
    fn leave_out(&mut self, begin: usize, saturated: u32, counts: &mut Counts, left_out: &mut LeftOut<'_>) {
        for pixel in (0..LANES).filter(|k| saturated >> k & 1 == 1).map(|k| begin + k) {
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

#[inline(always)]
fn decode_block<'a, L: Lanes, S: Sample>(
    lanes: L,
    plan: &Plan,
    limits: &Limits,
    of: impl Fn(usize) -> &'a [S; LANES],
) -> Block<L> {
    if plan.is_even && plan.steps == 4 && S::IS_BYTE {
        quarters(lanes, plan, limits, of)
    } else {
        weighted(lanes, plan, limits, of)
    }
}

/// Four evenly spaced samples of 8 bits: cosine and sine are differences of two.
#[inline(always)]
fn quarters<'a, L: Lanes, S: Sample>(
    lanes: L,
    plan: &Plan,
    limits: &Limits,
    of: impl Fn(usize) -> &'a [S; LANES],
) -> Block<L> {
    let l = lanes;
    let (a, b, c, d) = (S::words(l, of(0)), S::words(l, of(1)), S::words(l, of(2)), S::words(l, of(3)));
    let (cosine, sine) = (l.sub(a, c), l.sub(d, b));
    let (even, odd) = (l.add(a, c), l.add(b, d));
    let mean = l.shift_right::<2>(l.add(l.add(even, odd), l.word(2)));
    let greatest = l.max_unsigned(l.max_unsigned(a, b), l.max_unsigned(c, d));
    let (abs_cosine, abs_sine) = (l.abs(cosine), l.abs(sine));
    let (small, large) = (l.min_unsigned(abs_cosine, abs_sine), l.max_unsigned(abs_cosine, abs_sine));
    let direction = Direction {
        swapped: l.is_greater(abs_sine, abs_cosine),
        left: l.is_greater(l.word(0), cosine),
        below: l.is_greater(l.word(0), sine),
    };
    let (small_f, large_f) = (l.floats(l.widen_unsigned(small)), l.floats(l.widen_unsigned(large)));
    let (phase, square) = angle(l, small_f, large_f, &direction, plan.ahead);
    // Half the difference is the cosine sum: 256 · 1/2.
    let modulation = hypotenuse(l, l.shift_left::<7>(large), square);
    // What is left beside the sinusoid: (a − b + c − d)/2, in steps of 1/128 grey level; both sides are signed words.
    let residual = l.shift_left::<6>(l.abs(l.sub(even, odd)));
    let share = limits.max_share;
    let misfits = if share >= 1.0 {
        l.is_greater(l.times(residual, l.word((32767.0 / share) as i16)), modulation)
    } else {
        l.is_greater(residual, l.times(modulation, l.word((32767.0 * share) as i16)))
    };
    Block { phase, modulation, mean, misfits, greatest }
}

/// Any shifts and depth.
#[inline(always)]
fn weighted<'a, L: Lanes, S: Sample>(
    lanes: L,
    plan: &Plan,
    limits: &Limits,
    of: impl Fn(usize) -> &'a [S; LANES],
) -> Block<L> {
    let l = lanes;
    let zero = l.long(0);
    let (mut offset, mut cosine, mut sine, mut squares) = (zero, zero, zero, zero);
    let (mut sum, mut greatest) = (l.word(0), l.word(0));
    for p in 0..plan.steps.div_ceil(2) {
        let weights = &plan.pairs[p];
        let a = S::words(l, of(2 * p));
        // The partner of the last of an odd number has no weight.
        let b = if 2 * p + 1 < plan.steps { S::words(l, of(2 * p + 1)) } else { l.word(S::BIAS) };
        greatest = l.max_unsigned(greatest, l.max_unsigned(S::unsigned(l, a), S::unsigned(l, b)));
        cosine = l.add_weighted(cosine, a, b, weights.cosine);
        sine = l.add_weighted(sine, a, b, weights.sine);
        if S::IS_BYTE && plan.is_even {
            sum = l.add(sum, l.add(a, b));
            squares = l.add_squares(squares, a, b);
        } else {
            offset = l.add_weighted(offset, a, b, weights.offset);
        }
    }
    let (cosine_f, sine_f) = (l.floats(cosine), l.floats(sine));
    let (abs_cosine, abs_sine) = (l.abs_float(cosine_f), l.abs_float(sine_f));
    let (small, large) = (l.min_float(abs_cosine, abs_sine), l.max_float(abs_cosine, abs_sine));
    let direction = Direction {
        swapped: l.is_greater_float(abs_sine, abs_cosine),
        left: l.is_negative(cosine),
        below: l.is_negative(sine),
    };
    let (phase, square) = angle(l, small, large, &direction, plan.ahead);
    let grey_per_step = plan.value_per_step * limits.grey_per_value;
    let steps_256 = l.times_float(large, l.float(256.0 * grey_per_step));
    let modulation = hypotenuse(l, l.narrow(l.longs(l.min_float(steps_256, l.float(65535.0)))), square);
    let mean = if S::IS_BYTE && plan.is_even {
        // (2·sum + N)/2N, rounded down; of 13 and 15 steps a mean that ends in 0.46 or more may be rounded up.
        let twice = l.add(l.shift_left::<1>(sum), l.word(plan.steps as i16));
        l.times_high(twice, l.word(plan.half_per_step as i16))
    } else {
        let bias_grey = -f32::from(S::BIAS) * limits.grey_per_value;
        let offset = l.times_float(l.floats(offset), l.float(grey_per_step));
        l.narrow(l.longs(l.min_float(l.add_float(offset, l.float(bias_grey + 0.5)), l.float(255.0))))
    };
    let power = l.add_float(l.times_float(cosine_f, cosine_f), l.times_float(sine_f, sine_f));
    let steps = plan.steps as f32;
    let freedom = (plan.steps - MIN_STEPS) as f32;
    let share_square = limits.max_share * limits.max_share * freedom;
    let value_square = plan.value_per_step * plan.value_per_step;
    let misfits = if plan.steps == MIN_STEPS {
        l.is_greater(l.word(0), l.word(0))
    } else if S::IS_BYTE && plan.is_even {
        // N·Σ I² − (Σ I)² is exact, and holds N²/2·B² of the sinusoid.
        let sum = l.floats(l.widen_unsigned(sum));
        let all = l.times_float(l.floats(squares), l.float(steps));
        let about_mean = l.sub_float(all, l.times_float(sum, sum));
        l.is_greater_float(
            about_mean,
            l.times_float(power, l.float(steps * (0.5 * steps + share_square) * value_square)),
        )
    } else {
        let minus = l.float(-plan.value_per_step);
        let offset = l.times_float(l.floats(offset), minus);
        let (cosine_f, sine_f) = (l.times_float(cosine_f, minus), l.times_float(sine_f, minus));
        let mut off_squares = l.float(0.0);
        for k in 0..plan.steps {
            let [cos, sin] = plan.angles[k];
            let value = l.floats(l.widen(S::words(l, of(k))));
            let fitted = l.add_float(l.times_float(cosine_f, l.float(cos)), l.times_float(sine_f, l.float(-sin)));
            let off = l.add_float(l.add_float(value, offset), fitted);
            off_squares = l.add_float(off_squares, l.times_float(off, off));
        }
        l.is_greater_float(off_squares, l.times_float(power, l.float(share_square * value_square)))
    };
    Block { phase, modulation, mean, misfits, greatest }
}

/// In which octant an angle lies.
struct Direction<L: Lanes> {
    /// The sine is the greater.
    swapped: L::Mask,
    /// The cosine is negative.
    left: L::Mask,
    /// The sine is negative.
    below: L::Mask,
}

/// The angle less `ahead`, turns · 65536, and the square of small/large, times 2^15; 0 of no vector.
#[inline(always)]
fn angle<L: Lanes>(
    lanes: L,
    small: L::Floats,
    large: L::Floats,
    direction: &Direction<L>,
    ahead: u16,
) -> (L::Words, L::Words) {
    let l = lanes;
    let quotient = l.over(l.times_float(small, l.float(32767.0)), l.max_float(large, l.float(1.0)));
    let t = l.narrow(l.longs(l.add_float(quotient, l.float(0.5))));
    let u = l.times(t, t);
    let eighth = l.times(t, polynomial(l, u, &ARCTANGENT));
    let octant = l.shift_right::<1>(l.add(eighth, l.word(1)));
    let quadrant = l.select(direction.swapped, l.sub(l.word(16384), octant), octant);
    let half = l.select(direction.left, l.sub(l.word(-32768), quadrant), quadrant);
    let whole = l.select(direction.below, l.sub(l.word(0), half), half);
    (l.sub(whole, l.word(ahead as i16)), u)
}

/// Modulation, in its steps: large · √(1 + square), large in steps of 1/256 grey level.
#[inline(always)]
fn hypotenuse<L: Lanes>(lanes: L, large: L::Words, square: L::Words) -> L::Words {
    let l = lanes;
    let root = l.add(l.word(-32768), l.times(square, polynomial(l, square, &ROOT)));
    l.times_high(large, root)
}

/// c0 + x·(c1 + x·(c2 + …)), all fractions of 2^15.
#[inline(always)]
fn polynomial<L: Lanes, const DEGREE: usize>(lanes: L, x: L::Words, coefficients: &[i16; DEGREE]) -> L::Words {
    // A loop: what iterators do with closures is not inlined at once.
    let mut sum = lanes.word(coefficients[DEGREE - 1]);
    let mut k = DEGREE - 1;
    while k > 0 {
        k -= 1;
        sum = lanes.add(lanes.word(coefficients[k]), lanes.times(x, sum));
    }
    sum
}
