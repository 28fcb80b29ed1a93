//! The grounds: the observations from which the confidence of a selected candidate is computed.

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::neighbourhood::{ABSENT, MAX_STEP};

/// Pixels on either side within which support counts.
const REACH_PX: usize = 3;
/// Side of that neighbourhood, pixels.
const SIDE: usize = 2 * REACH_PX + 1;

/// Observations for and against the selected candidate of one pixel.
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
    /// How many of the 8 adjacent pixels are accepted and have an absolute phase that continues that of the pixel.
    pub near_support: u8,
    /// How many of the 48 pixels around it are.
    pub wide_support: u8,
    /// Whether its place in C2 serves a point nearer to C2, which hides it.
    pub is_hidden: bool,
    /// Share of its region that is hidden so.
    pub hidden_share: f32,
}

/// Columns handled at once.
const BLOCK: usize = 32;
/// Support of a pixel whose neighbours all continue its phase.
const ALL_NEAR: u8 = 8;
const ALL_WIDE: u8 = (SIDE * SIDE - 1) as u8;

/// Absolute phases of the accepted pixels, with a margin of absent ones as wide as support reaches.
#[derive(Clone, Debug, Default)]
pub(super) struct Surroundings {
    absolute: Vec<i32>,
    /// Width of the image with its margins.
    stride: usize,
    /// For each block of each row 1 if every pixel is accepted and its phase continues to the right, below and to the
    /// lower right, else 0. A pixel surrounded by such blocks has full support.
    is_continuous: Vec<u8>,
}

/// Most difference of the absolute phases of two pixels, by their distance in rows and columns.
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
    /// Loads an image of `width` columns and `height` rows. `fill` writes the accepted pixels of a row; all others are
    /// absent.
    pub(super) fn fill(&mut self, [width, height]: [usize; 2], fill: impl Fn(usize, &mut [i32]) + Sync) {
        self.stride = width + 2 * REACH_PX;
        self.absolute.clear();
        self.absolute.resize(self.stride * (height + 2 * REACH_PX), ABSENT);
        let inside = &mut self.absolute[self.stride * REACH_PX..][..self.stride * height];
        let rows = inside.par_chunks_exact_mut(self.stride);
        rows.enumerate().for_each(|(v, row)| fill(v, &mut row[REACH_PX..REACH_PX + width]));
        let blocks = self.stride.div_ceil(BLOCK);
        self.is_continuous.resize(blocks * (height + 2 * REACH_PX), 0);
        let (absolute, stride) = (&self.absolute, self.stride);
        self.is_continuous.par_chunks_mut(blocks).enumerate().for_each(|(v, is_continuous)| {
            let row = &absolute[v * stride..][..stride];
            let below = absolute.get((v + 1) * stride..(v + 2) * stride).unwrap_or(row);
            fringeflow_simd::run(Level::in_use(), ContinuousRow { row, below, is_continuous });
        });
    }

    /// Counts the near and wide support of the pixels of row `v` from a column on, whose absolute phases are `own`.
    pub(super) fn support(
        &self,
        v: usize,
        column: usize,
        own: &[i32],
        near_support: &mut [u8],
        wide_support: &mut [u8],
    ) {
        let rows = std::array::from_fn(|row| &self.absolute[(v + row) * self.stride..][column..self.stride]);
        let blocks = self.stride.div_ceil(BLOCK);
        let is_continuous = std::array::from_fn(|row| &self.is_continuous[(v + row) * blocks..][..blocks]);
        fringeflow_simd::run(
            Level::in_use(),
            SupportRow { column, rows, is_continuous, own, near_support, wide_support },
        );
    }
}

/// Finds the blocks of a row whose phase continues everywhere.
struct ContinuousRow<'a> {
    row: &'a [i32],
    below: &'a [i32],
    /// One entry per block.
    is_continuous: &'a mut [u8],
}

impl Kernel for ContinuousRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { row, below, is_continuous } = self;
        let differs = |a: i32, b: i32| i32::from(a.wrapping_sub(b).unsigned_abs() > MAX_STEP as u32);
        for (block, is_continuous) in is_continuous.iter_mut().enumerate() {
            let begin = block * BLOCK;
            let count = BLOCK.min(row.len() - 1 - begin);
            let (here, right) = (&row[begin..][..count], &row[begin + 1..][..count]);
            let (under, lower_right) = (&below[begin..][..count], &below[begin + 1..][..count]);
            let mut ends = 0;
            for i in 0..count {
                ends |= i32::from(here[i] == ABSENT) | differs(here[i], right[i]) | differs(here[i], under[i]);
                ends |= differs(here[i], lower_right[i]) | differs(right[i], under[i]);
            }
            *is_continuous = u8::from(ends == 0);
        }
    }
}

/// Counts the support of a row from a column on.
struct SupportRow<'a> {
    column: usize,
    /// The rows around it, with their margins, and their blocks.
    rows: [&'a [i32]; SIDE],
    is_continuous: [&'a [u8]; SIDE],
    own: &'a [i32],
    near_support: &'a mut [u8],
    wide_support: &'a mut [u8],
}

impl Kernel for SupportRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { column, rows, is_continuous, own, near_support, wide_support } = self;
        for begin in (0..own.len()).step_by(BLOCK) {
            let count = BLOCK.min(own.len() - begin);
            let (first, last) = ((column + begin) / BLOCK, (column + begin + count + 2 * REACH_PX - 1) / BLOCK);
            let (near_support, wide_support) =
                (&mut near_support[begin..][..count], &mut wide_support[begin..][..count]);
            if is_continuous.iter().all(|row| row[first..=last].iter().all(|&is_continuous| is_continuous == 1)) {
                near_support.fill(ALL_NEAR);
                wide_support.fill(ALL_WIDE);
                continue;
            }
            let mut phases = [ABSENT; BLOCK];
            phases[..count].copy_from_slice(&own[begin..][..count]);
            let around_block = std::array::from_fn(|row| rows[row][begin..].first_chunk());
            let [near, all] = match around_block {
                [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f), Some(g)] => {
                    support(&phases, [a, b, c, d, e, f, g])
                }
                _ => {
                    // Beyond the end of the row no pixel is accepted.
                    let mut padded = [[ABSENT; BLOCK + 2 * REACH_PX]; SIDE];
                    for (padded, row) in padded.iter_mut().zip(&rows) {
                        padded[..count + 2 * REACH_PX].copy_from_slice(&row[begin..][..count + 2 * REACH_PX]);
                    }
                    support(&phases, padded.each_ref())
                }
            };
            near_support.copy_from_slice(&near[..count]);
            wide_support.copy_from_slice(&all[..count]);
        }
    }
}

/// Near and wide support of a block of pixels with absolute phases `own`, among the rows around them.
#[inline(always)]
fn support(own: &[i32; BLOCK], rows: [&[i32; BLOCK + 2 * REACH_PX]; SIDE]) -> [[u8; BLOCK]; 2] {
    let (mut near_support, mut wide_support) = ([0_u8; BLOCK], [0_u8; BLOCK]);
    for row in 0..SIDE {
        for column in 0..SIDE {
            // The pixel itself is no support.
            if row == REACH_PX && column == REACH_PX {
                continue;
            }
            let (limit, others) = (MAX_DIFFERENCE[row][column], &rows[row][column..][..BLOCK]);
            let is_beside = row.abs_diff(REACH_PX) <= 1 && column.abs_diff(REACH_PX) <= 1;
            let counts = if is_beside { &mut near_support } else { &mut wide_support };
            for i in 0..BLOCK {
                let continues = others[i].wrapping_sub(own[i]).unsigned_abs() <= limit;
                counts[i] = counts[i].wrapping_add(u8::from(continues));
            }
        }
    }
    for i in 0..BLOCK {
        wide_support[i] = wide_support[i].wrapping_add(near_support[i]);
    }
    [near_support, wide_support]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::test_random::random;

    #[test]
    fn support_counts_the_accepted_pixels_around_that_continue() {
        let turn = 65536;
        // A ramp of an eighth of a turn a column; the last column lies an order higher, one pixel is not accepted.
        let mut absolute: Vec<i32> = (0..25).map(|i| (i % 5) * turn / 8 + if i % 5 == 4 { turn } else { 0 }).collect();
        absolute[6] = ABSENT;
        let mut surroundings = Surroundings::default();
        surroundings.fill([5, 5], |v, row| row.copy_from_slice(&absolute[5 * v..5 * v + 5]));
        let support = |[u, v]: [usize; 2], own: i32| {
            let (mut near_support, mut wide_support) = ([0; 5], [0; 5]);
            surroundings.support(v, 0, &[own; 5], &mut near_support, &mut wide_support);
            (near_support[u], wide_support[u])
        };
        // A phase that is not the pixel's own finds the pixel no more than its own does.
        assert_eq!(support([2, 2], turn / 4), (7, 18));
        assert_eq!(support([2, 2], turn / 4 + turn), (0, 5));
        assert_eq!(support([0, 0], 0), (2, 14));
    }

    #[test]
    fn support_is_that_of_counting_one_by_one() {
        let (width, height) = (157, 24);
        let mut random = random(9);
        // On the left random phases, on the right a surface with a few holes.
        let anything = |random: i32, value: i32| if random % 6 == 0 { ABSENT } else { value * 2 - 60_000 };
        let surface = |i: usize, random: i32| if random % 1000 == 0 { ABSENT } else { (i % width) as i32 * 9000 };
        let of = |i: usize, random: [i32; 2]| match i % width {
            0..37 => anything(random[0], random[1]),
            _ => surface(i, random[0]),
        };
        let absolute: Vec<i32> = (0..width * height).map(|i| of(i, [0; 2].map(|_| random(1 << 16) as i32))).collect();
        let mut surroundings = Surroundings::default();
        surroundings.fill([width, height], |v, row| row.copy_from_slice(&absolute[width * v..][..width]));
        let (mut near_support, mut wide_support) = (vec![0; width], vec![0; width]);
        for v in 0..height {
            let own = &absolute[width * v..][..width];
            let (near, all) = (&mut near_support[v..], &mut wide_support[v..]);
            surroundings.support(v, v, &own[v..], near, all);
            for u in (v..width).filter(|&u| own[u] != ABSENT) {
                let (mut near, mut all) = (0, 0);
                for (i, &other) in absolute.iter().enumerate() {
                    let away = (i % width).abs_diff(u).max((i / width).abs_diff(v));
                    let continues = other != ABSENT && (other - own[u]).abs() <= MAX_STEP * away as i32;
                    all += u8::from(continues && (1..=REACH_PX).contains(&away));
                    near += u8::from(continues && away == 1);
                }
                assert_eq!((near_support[u], wide_support[u]), (near, all), "{u} {v}");
            }
        }
    }
}
