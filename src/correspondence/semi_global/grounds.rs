//! The grounds on which a candidate is held to be true.

use rayon::prelude::*;

use super::super::neighbourhood::MAX_STEP;
use super::selection::ABSENT;
use crate::simd::{self, Kernel, Lanes, Level};

/// Pixels on either side within which support counts.
const REACH_PX: usize = 3;
/// Pixels along a side of that surrounding.
const SIDE: usize = 2 * REACH_PX + 1;

/// What speaks for the selected candidate of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Grounds {
    /// Lead of its order over the next best, nats a path.
    pub margin_nats: f32,
    /// |δ − drift| in sd of true candidates.
    pub abs_z: f32,
    /// Pixels of its region.
    pub region_px: u32,
    /// Mean lead of its region, nats a path.
    pub region_lead_nats: f32,
    /// Of the 8 pixels beside it those that stand and whose absolute phases run on to its own.
    pub beside: u8,
    /// Of the 48 pixels around it those.
    pub around: u8,
    /// Whether its place in C2 serves a point that is nearer to C2.
    pub is_hidden: bool,
    /// Share of its region for which that is so.
    pub hidden_share: f32,
}

/// Absolute phases of the pixels that stand, in a frame of absent ones as wide as support reaches.
#[derive(Clone, Debug, Default)]
pub(super) struct Surroundings {
    absolute: Vec<i32>,
    /// Width of the image and of the frame on both sides.
    stride: usize,
}

/// How far the absolute phase of a pixel may differ that is so many rows and columns away.
const MAX_DIFFERENCE: [[u32; SIDE]; SIDE] = {
    let mut limits = [[0; SIDE]; SIDE];
    let mut i = 0;
    while i < SIDE * SIDE {
        let (rows, columns) = ((i / SIDE).abs_diff(REACH_PX), (i % SIDE).abs_diff(REACH_PX));
        let away = if rows > columns { rows } else { columns };
        limits[i / SIDE][i % SIDE] = MAX_STEP as u32 * away as u32;
        i += 1;
    }
    limits
};

impl Surroundings {
    /// Pixels of an image of so many columns and rows; `fill` tells those of a row that stand, all others are absent.
    pub(super) fn fill(&mut self, [width, height]: [usize; 2], fill: impl Fn(usize, &mut [i32]) + Sync) {
        self.stride = width + 2 * REACH_PX;
        self.absolute.clear();
        self.absolute.resize(self.stride * (height + 2 * REACH_PX), ABSENT);
        let inside = &mut self.absolute[self.stride * REACH_PX..][..self.stride * height];
        let rows = inside.par_chunks_exact_mut(self.stride);
        rows.enumerate().for_each(|(v, row)| fill(v, &mut row[REACH_PX..REACH_PX + width]));
    }

    /// How many pixels beside and around those of row `v` from a column on stand with an absolute phase that runs on to their
    /// `own`.
    pub(super) fn support(&self, v: usize, column: usize, own: &[i32], beside: &mut [u8], around: &mut [u8]) {
        let rows = std::array::from_fn(|row| &self.absolute[(v + row) * self.stride..][column..self.stride]);
        simd::run(Level::in_use(), SupportRow { rows, own, beside, around });
    }
}

/// Counts the support of a row.
struct SupportRow<'a> {
    /// The rows around it, with their frames.
    rows: [&'a [i32]; SIDE],
    own: &'a [i32],
    beside: &'a mut [u8],
    around: &'a mut [u8],
}

impl Kernel for SupportRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { rows, own, beside, around } = self;
        beside.fill(0);
        around.fill(0);
        for row in 0..SIDE {
            for column in 0..SIDE {
                // The pixel itself is no support.
                if row == REACH_PX && column == REACH_PX {
                    continue;
                }
                let is_near = row.abs_diff(REACH_PX) <= 1 && column.abs_diff(REACH_PX) <= 1;
                let counts = if is_near { &mut *beside } else { &mut *around };
                count(own, &rows[row][column..], MAX_DIFFERENCE[row][column], counts);
            }
        }
        for (around, beside) in around.iter_mut().zip(beside) {
            *around = around.wrapping_add(*beside);
        }
    }
}

/// Counts those whose absolute phases differ by no more than a limit.
#[inline(always)]
fn count(own: &[i32], others: &[i32], limit: u32, counts: &mut [u8]) {
    let (own, others) = (&own[..counts.len()], &others[..counts.len()]);
    for i in 0..counts.len() {
        let runs_on = others[i].wrapping_sub(own[i]).unsigned_abs() <= limit;
        counts[i] = counts[i].wrapping_add(u8::from(runs_on));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn support_is_what_stands_around_and_runs_on() {
        let turn = 65536;
        // A ramp of an eighth of a turn a column; the last column lies an order higher, one pixel does not stand.
        let mut absolute: Vec<i32> = (0..25).map(|i| (i % 5) * turn / 8 + if i % 5 == 4 { turn } else { 0 }).collect();
        absolute[6] = ABSENT;
        let mut surroundings = Surroundings::default();
        surroundings.fill([5, 5], |v, row| row.copy_from_slice(&absolute[5 * v..5 * v + 5]));
        let support = |[u, v]: [usize; 2], own: i32| {
            let (mut beside, mut around) = ([0; 5], [0; 5]);
            surroundings.support(v, 0, &[own; 5], &mut beside, &mut around);
            (beside[u], around[u])
        };
        // A phase that is not the pixel's own finds the pixel no more than its own does.
        assert_eq!(support([2, 2], turn / 4), (7, 18));
        assert_eq!(support([2, 2], turn / 4 + turn), (0, 5));
        assert_eq!(support([0, 0], 0), (2, 14));
    }

    #[test]
    fn support_is_that_of_counting_one_by_one() {
        let (width, height) = (37, 12);
        let mut state = 9_u32;
        let mut random = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 16) as i32
        };
        let absolute: Vec<i32> =
            (0..width * height).map(|_| if random() % 6 == 0 { ABSENT } else { random() * 2 - 60_000 }).collect();
        let mut surroundings = Surroundings::default();
        surroundings.fill([width, height], |v, row| row.copy_from_slice(&absolute[width * v..][..width]));
        let (mut beside, mut around) = (vec![0; width], vec![0; width]);
        for v in 0..height {
            let own = &absolute[width * v..][..width];
            let (near, all) = (&mut beside[v..], &mut around[v..]);
            surroundings.support(v, v, &own[v..], near, all);
            for u in (v..width).filter(|&u| own[u] != ABSENT) {
                let (mut near, mut all) = (0, 0);
                for (i, &other) in absolute.iter().enumerate() {
                    let away = (i % width).abs_diff(u).max((i / width).abs_diff(v));
                    let runs_on = other != ABSENT && (other - own[u]).abs() <= MAX_STEP * away as i32;
                    all += u8::from(runs_on && (1..=REACH_PX).contains(&away));
                    near += u8::from(runs_on && away == 1);
                }
                assert_eq!((beside[u], around[u]), (near, all), "{u} {v}");
            }
        }
    }
}
