//! Neighbour votes: whether decided neighbours support the order of a pixel (paper, Eq. 2).
//!
//! A walk from pixel p meets a decided pixel k after the phase has risen by s. If both lie on one surface, their
//! absolute phases satisfy u_p = u_k − s. This is Eq. (2) with both inequalities in one: k comes before p in C1 and
//! c(k) before q in C2, by the same phase, less than 2π. In whole numbers it holds exactly or not at all.
//!
//! In: phase of C1, absolute phase and δ of the decided pixels. Out: the supported pixels. For every pixel p:
//!
//! ```text
//! for each of four sides: walk from p up to three steps, as long as the phase continues without a jump
//!     for each decided k that is met: total += 1; if u_k − s = u_p: votes += 1, sum += δ_k
//! supported(p) = |sum / votes − δ_p| <= tolerance  and  votes >= min_votes  and  votes >= total − votes
//! ```
//!
//! The low 16 bits of an absolute phase are the wrapped phase. So u_k − s = u_p compares orders alone: it counts the
//! whole turns by which the wrapped phase wrapped on the way. 32 pixels are handled at once.

use std::iter::zip;

use rayon::prelude::*;

use fringeflow_simd::{Kernel, LANES, Lanes, Level, store_first};

use crate::phase::PhaseMap;

use super::neighbourhood::{ABSENT, MAX_STEP, MAX_STEP_CHANGE};

/// Steps of a walk.
pub(super) const NEAR: usize = 3;
/// Stands for the order of an undecided pixel.
const UNDECIDED: i16 = i16::MIN;

/// When a pixel is supported.
#[derive(Clone, Copy, Debug)]
pub(super) struct SupportRule {
    /// Decided neighbours that must agree.
    pub(super) min_votes: u16,
    /// Tolerated difference between δ of a pixel and the mean δ of its supporters, turns · 65536.
    pub(super) tolerance: i32,
}

/// The supported pixels.
#[derive(Clone, Debug, Default)]
pub(super) struct Support {
    /// False for undecided pixels.
    pub(super) is_supported: Vec<bool>,
    image: Padded,
}

impl Support {
    /// Finds the supported pixels, from the absolute phases of all pixels, [`ABSENT`] where undecided, and their δ.
    pub(super) fn find(&mut self, cam1: &PhaseMap, absolute: &[i32], delta: &[i16], rule: SupportRule) {
        let (Self { is_supported, image }, width) = (self, cam1.width.max(1));
        image.copy(cam1, absolute, delta);
        let image = &*image;
        is_supported.resize(cam1.phase.len(), false);
        is_supported.par_chunks_mut(width).enumerate().for_each(|(v, is_supported)| {
            fringeflow_simd::run(Level::in_use(), SupportOfRow { image, v, rule, is_supported });
        });
    }
}

/// Phases, orders and δ of the image, with a margin of [`NEAR`] pixels without phase on all sides, in rows of whole
/// blocks.
#[derive(Clone, Debug, Default)]
struct Padded {
    size_px: [usize; 2],
    /// Places from one row to the next.
    stride: usize,
    phase: Vec<u16>,
    valid: Vec<bool>,
    order: Vec<u16>,
    delta: Vec<u16>,
}

impl Padded {
    fn copy(&mut self, cam1: &PhaseMap, absolute: &[i32], delta: &[i16]) {
        let [width, height] = [cam1.width, cam1.height];
        if self.size_px != [width, height] {
            let stride = width.next_multiple_of(LANES) + LANES;
            let words = vec![0; stride * (height + 2 * NEAR)];
            let valid = vec![false; words.len()];
            let (phase, order, delta) = (words.clone(), words.clone(), words);
            *self = Self { size_px: [width, height], stride, phase, valid, order, delta };
        }
        let stride = self.stride;
        let above = NEAR * stride;
        let planes = (
            self.phase[above..].par_chunks_mut(stride),
            self.valid[above..].par_chunks_mut(stride),
            self.order[above..].par_chunks_mut(stride),
            self.delta[above..].par_chunks_mut(stride),
        );
        planes.into_par_iter().take(height).enumerate().for_each(|(v, (of_phase, valid, order, of_delta))| {
            let (pixels, places) = (v * width..(v + 1) * width, NEAR..NEAR + width);
            of_phase[places.clone()].copy_from_slice(&cam1.phase[pixels.clone()]);
            valid[places.clone()].copy_from_slice(&cam1.valid[pixels.clone()]);
            of_delta[places.clone()].copy_from_slice(bytemuck::cast_slice(&delta[pixels.clone()]));
            for (order, &absolute) in zip(&mut order[places], &absolute[pixels]) {
                *order = if absolute == ABSENT { UNDECIDED as u16 } else { (absolute >> 16) as u16 };
            }
        });
    }
}

/// Finds the supported pixels of a row.
struct SupportOfRow<'a> {
    image: &'a Padded,
    v: usize,
    rule: SupportRule,
    is_supported: &'a mut [bool],
}

impl Kernel for SupportOfRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { image, v, rule, is_supported } = self;
        let first = (v + NEAR) * image.stride + NEAR;
        for (b, is_supported) in is_supported.chunks_mut(LANES).enumerate() {
            let votes = Votes::new(lanes, image, first + b * LANES);
            let ([mut total, mut same], mut delta_sum) = ([[0_u16; LANES]; 2], [0_i32; LANES]);
            lanes.store(votes.total, &mut total);
            lanes.store(votes.same, &mut same);
            lanes.store_longs(votes.delta_sum, &mut delta_sum);
            let [order, delta] = [&image.order, &image.delta].map(|plane| words(plane, first + b * LANES));
            let mut supported = [false; LANES];
            for u in 0..LANES {
                let votes = i32::from(same[u]);
                let off = delta_sum[u] - i32::from(delta[u] as i16) * votes;
                supported[u] = (order[u] as i16 != UNDECIDED)
                    & (off.abs() <= rule.tolerance * votes)
                    & (same[u] >= rule.min_votes)
                    & (2 * same[u] >= total[u]);
            }
            store_first(&supported, is_supported);
        }
    }
}

/// The votes for each pixel of a block: their number, the number that agree with its order, and the sum of δ over the
/// latter.
struct Votes<L: Lanes> {
    total: L::Words,
    same: L::Words,
    delta_sum: L::Longs,
}

impl<L: Lanes> Votes<L> {
    /// The votes for the pixels of the block that begins with a place.
    #[inline(always)]
    fn new(lanes: L, image: &Padded, here: usize) -> Self {
        let zero = lanes.word(0);
        let mut votes = Self { total: zero, same: zero, delta_sum: lanes.long(0) };
        votes.add_walk(lanes, image, here, |step| here - step);
        votes.add_walk(lanes, image, here, |step| here + step);
        votes.add_walk(lanes, image, here, |step| here - step * image.stride);
        votes.add_walk(lanes, image, here, |step| here + step * image.stride);
        votes
    }

    /// Adds the votes of a walk. `place` gives the place after a number of steps.
    #[inline(always)]
    fn add_walk(&mut self, lanes: L, image: &Padded, here: usize, place: impl Fn(usize) -> usize) {
        let (zero, one) = (lanes.word(0), lanes.word(1));
        let order = lanes.load(words(&image.order, here));
        let phase = lanes.load(words(&image.phase, here));
        let (mut is_walking, mut before, mut last_step, mut turns) = (is_valid(lanes, image, here), phase, zero, zero);
        for step in 1..=NEAR {
            let next = lanes.load(words(&image.phase, place(step)));
            let rise = lanes.sub(next, before);
            let continues = lanes.is_at_least(lanes.word(MAX_STEP as i16), lanes.abs(rise));
            is_walking = lanes.and(is_walking, lanes.and(is_valid(lanes, image, place(step)), continues));
            if step > 1 {
                let bend = lanes.abs(lanes.sub(rise, last_step));
                is_walking = lanes.and(is_walking, lanes.is_at_least(lanes.word(MAX_STEP_CHANGE as i16), bend));
            }
            let wraps_up = lanes.and_not(lanes.is_greater(rise, zero), lanes.is_at_least(next, before));
            let wraps_down = lanes.and_not(lanes.is_greater(zero, rise), lanes.is_at_least(before, next));
            turns = lanes.add(turns, lanes.select(wraps_up, one, zero));
            turns = lanes.sub(turns, lanes.select(wraps_down, one, zero));
            if step == NEAR {
                // Three of the largest steps may reach a period. Eq. (2) uses less, so the walk ends.
                let up = lanes.and(lanes.is_greater(turns, zero), lanes.is_at_least(next, phase));
                let down = lanes.and(lanes.is_greater(zero, turns), lanes.is_at_least(phase, next));
                let twice = lanes.is_greater(lanes.abs(turns), one);
                is_walking = lanes.and_not(is_walking, lanes.or(twice, lanes.or(up, down)));
            }
            let neighbour_order = lanes.load(words(&image.order, place(step)));
            let is_decided = lanes.and_not(is_walking, lanes.is_equal(neighbour_order, lanes.word(UNDECIDED)));
            let agrees = lanes.and(is_decided, lanes.is_equal(lanes.sub(neighbour_order, turns), order));
            let delta = lanes.load(words(&image.delta, place(step)));
            self.total = lanes.add(self.total, lanes.select(is_decided, one, zero));
            self.same = lanes.add(self.same, lanes.select(agrees, one, zero));
            self.delta_sum = lanes.add_long(self.delta_sum, lanes.widen(lanes.select(agrees, delta, zero)));
            (before, last_step) = (next, rise);
        }
    }
}

#[inline(always)]
fn is_valid<L: Lanes>(lanes: L, image: &Padded, place: usize) -> L::Mask {
    let valid: &[u8] = bytemuck::cast_slice(&image.valid);
    lanes.is_greater(lanes.words_of_bytes(valid[place..].first_chunk().unwrap_or(&[0; LANES])), lanes.word(0))
}

/// The block that begins with a place. All places used lie in the plane.
#[inline(always)]
fn words(plane: &[u16], place: usize) -> &[u16; LANES] {
    plane[place..].first_chunk().unwrap_or(&[0; LANES])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::neighbourhood::TURN;
    use crate::correspondence::reference_methods::paper::{Side, walk};
    use crate::correspondence::test_random::random;

    /// Patches of slopes of all kinds with holes, two of three pixels decided, a tenth of those for a wrong order.
    fn scene(width: usize, height: usize) -> (PhaseMap, Vec<i32>, Vec<i16>) {
        let mut random = random(11);
        // Steep patches have walks of a period within three steps.
        let slopes: Vec<[i32; 2]> =
            (0..100).map(|_| [random(48_000) as i32 - 24_000, random(12_000) as i32 - 6000]).collect();
        let (mut map, mut absolute) = (PhaseMap { width, height, ..PhaseMap::default() }, Vec::new());
        for (u, v) in (0..height).flat_map(|v| (0..width).map(move |u| (u, v))) {
            let [along, across] = slopes[u / 23 % 10 * 10 + v / 17 % 10];
            let right = along * (u % 23) as i32 + across * (v % 17) as i32 + random(300) as i32;
            let valid = random(40) > 0;
            map.phase.push(right as u16);
            map.valid.push(valid);
            let decided = if random(10) > 0 { right } else { right + TURN };
            absolute.push(if valid && random(3) > 0 { decided } else { ABSENT });
        }
        let delta = (0..width * height).map(|_| random(600) as i16 - 300).collect();
        (map, absolute, delta)
    }

    /// Whether a pixel is supported, by walks one by one.
    fn is_supported(map: &PhaseMap, absolute: &[i32], delta: &[i16], rule: SupportRule, pixel: usize) -> bool {
        let (mut total, mut votes, mut delta_sum) = (0, 0, 0);
        for side in Side::ALL {
            walk(map, pixel, side, NEAR, |met, rise| {
                if absolute[met] != ABSENT {
                    total += 1;
                    let same = absolute[met] - rise == absolute[pixel];
                    votes += i32::from(same);
                    delta_sum += if same { i32::from(delta[met]) } else { 0 };
                }
            });
        }
        let agree = (delta_sum - i32::from(delta[pixel]) * votes).abs() <= rule.tolerance * votes;
        absolute[pixel] != ABSENT && agree && votes >= i32::from(rule.min_votes) && votes >= total - votes
    }

    #[test]
    fn rows_are_supported_as_walks_say() {
        let mut support = Support::default();
        for [width, height] in [[150, 60], [5, 2], [1, 1]] {
            let (map, absolute, delta) = scene(width, height);
            for (min_votes, tolerance) in [(1, 40), (3, 100), (3, TURN), (6, 200)] {
                let rule = SupportRule { min_votes, tolerance };
                let expected: Vec<bool> =
                    (0..width * height).map(|pixel| is_supported(&map, &absolute, &delta, rule, pixel)).collect();
                for level in Level::ALL {
                    level.limit_to();
                    support.find(&map, &absolute, &delta, rule);
                    assert!(support.is_supported == expected, "{level:?} {rule:?}");
                }
                let supported = expected.iter().filter(|is| **is).count();
                assert!(width < 100 || (300..6000).contains(&supported), "{supported} of {rule:?}");
            }
        }
    }

    #[test]
    fn others_must_agree_in_phase_and_delta() {
        let width = 7;
        let map = PhaseMap {
            width,
            height: 1,
            phase: (0..width as u16).map(|u| u.wrapping_mul(9000)).collect(),
            valid: vec![true; width],
            ..PhaseMap::default()
        };
        let absolute: Vec<i32> = (0..width as i32).map(|u| 9000 * u).collect();
        let supported = |absolute: &[i32], delta: &[i16]| {
            let mut support = Support::default();
            support.find(&map, absolute, delta, SupportRule { min_votes: 3, tolerance: 50 });
            support.is_supported
        };
        assert_eq!(supported(&absolute, &[0; 7]), [true; 7]);
        let mut off = [0; 7];
        off[3] = 51;
        assert!(!supported(&absolute, &off)[3]);
        let mut of_another_order = absolute.clone();
        of_another_order[3] += TURN;
        assert!(!supported(&of_another_order, &[0; 7])[3]);
        let mut few = absolute;
        few[4..].fill(ABSENT);
        assert_eq!(supported(&few, &[0; 7]), [true, true, true, true, false, false, false]);
        few[3] = ABSENT;
        assert_eq!(supported(&few, &[0; 7]), [false; 7]);
    }
}
