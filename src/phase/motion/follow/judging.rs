//! Checks a flow against the images. In: images at rest and sampled along the flow. Out: which tiles are followed.
//! Cost: a linear fit of one row in eight, twice.

use fringeflow_base::limits::{MAX_IMAGES, MIN_STEPS};
use fringeflow_simd::{Kernel, LANES, Lanes, first_lanes, total};

use crate::phase::Validity;
use crate::phase::motion::fit::MotionFit;
use crate::phase::motion::fits_by_motion::MotionFits;
use crate::phase::motion::flow::FLOW_TILE_PX;
use crate::phase::motion::images::Images;
use crate::phase::sample::Sample;

use super::path::Path;

/// Rows of a tile that are checked: the first, and the distance to the next.
const CHECKED_ROWS: [usize; 2] = [3, 8];
/// Residual ÷ modulation of a pixel whose fit counts as one half.
const HALF_FIT_SHARE: f32 = 0.3;
/// By chance the fit along the path may be worse than at rest by this much per pixel. A tile is judged together with
/// the tiles around it, which mostly move alike.
const CHANCE_SHARE: f32 = 0.01;

/// Largest motion that remains along the path of a well-known surface, rad per image; plus this share of the motion at
/// rest, because hands tremble.
const REMAINING_RAD: f32 = 0.05;
const REMAINING_SHARE: f32 = 0.5;
/// Smallest share of the lit pixels in tiles that fit along their paths. With fewer, the whole flow is wrong.
const LEAST_SHARE: f32 = 0.5;
/// From this share on the whole scene moves as expected, and only clear exceptions are not followed.
const RIGID_SHARE: f32 = 0.8;
/// Clear exceptions fit by less than this share of the fit at rest, or have more than this remaining motion, rad per
/// image.
const RIGID_FIT_SHARE: f32 = 0.7;
const RIGID_REMAINING_RAD: f32 = 0.25;

/// How the pixels of a tile fit at rest and along the path.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Verdict {
    /// Pixels that are lit at rest.
    lit: f32,
    resting: FitQuality,
    followed: FitQuality,
}

/// How well pixels fit a sinusoid that moves as expected. (A sinusoid of free motion would fit nearly everything.)
#[derive(Clone, Copy, Debug, Default)]
struct FitQuality {
    lit: f32,
    /// Sum of the quality of fit of each pixel, from 0 to 1.
    fit: f32,
    /// Sums over rows of |z|², and of |Σ Im(z'·z*)|, which is |z|² times the remaining motion.
    power: f32,
    remaining: f32,
}

impl FitQuality {
    fn plus(self, other: Self) -> Self {
        Self {
            lit: self.lit + other.lit,
            fit: self.fit + other.fit,
            power: self.power + other.power,
            remaining: self.remaining + other.remaining,
        }
    }

    /// Mean remaining motion, rad per image.
    fn remaining_rad(&self) -> f32 {
        if self.power > 0.0 { self.remaining / self.power } else { 0.0 }
    }
}

impl Verdict {
    fn plus(self, other: Self) -> Self {
        let Self { lit, resting, followed } = other;
        Self { lit: self.lit + lit, resting: self.resting.plus(resting), followed: self.followed.plus(followed) }
    }

    /// Whether the path is plausible in a scene that moves as expected.
    fn fits_roughly(self) -> bool {
        let fits = self.followed.fit >= RIGID_FIT_SHARE * self.resting.fit;
        fits && self.followed.remaining_rad() <= RIGID_REMAINING_RAD.max(self.resting.remaining_rad())
    }

    /// Whether the path fits as well as staying in place.
    fn fits_path(self) -> bool {
        let fits = self.followed.fit + CHANCE_SHARE * self.lit >= self.resting.fit;
        fits && self.followed.remaining_rad() <= REMAINING_RAD + REMAINING_SHARE * self.resting.remaining_rad()
    }
}

/// Scratch memory for the grey levels of a block.
pub(super) type BlockGreys = [[f32; LANES]; MAX_IMAGES];

/// Removes the paths of tiles that fit better at rest, and all paths if the flow is wrong.
pub(super) fn remove_wrong_paths(paths: &mut [Path], verdicts: &[Verdict], columns: usize) {
    let around = |tile: usize| sum_around(verdicts, columns, tile);
    let with_path = || paths.iter().enumerate().filter(|(_, path)| path.bin.is_some()).map(|(tile, _)| tile);
    let lit = with_path().map(|tile| verdicts[tile].lit).sum::<f32>();
    let fitting = with_path().filter(|&tile| around(tile).fits_path()).map(|tile| verdicts[tile].lit).sum::<f32>();
    for (tile, path) in paths.iter_mut().enumerate() {
        let is_right = if fitting >= RIGID_SHARE * lit {
            around(tile).fits_roughly()
        } else {
            fitting >= LEAST_SHARE * lit && around(tile).fits_path()
        };
        if !is_right {
            *path = Path::default();
        }
    }
}

/// Sum of the verdicts of a tile and its neighbours.
fn sum_around(verdicts: &[Verdict], columns: usize, place: usize) -> Verdict {
    let (column, row) = (place % columns, place / columns);
    let rows = row.saturating_sub(1)..(row + 2).min(verdicts.len() / columns);
    let all = rows.flat_map(|row| {
        let in_row = &verdicts[row * columns..][..columns];
        in_row[column.saturating_sub(1)..(column + 2).min(columns)].iter()
    });
    all.fold(Verdict::default(), |sum, verdict| sum.plus(*verdict))
}

/// Measures how the tiles of a row fit at rest and along their paths.
pub(super) struct VerdictKernel<'a, 'b, S> {
    /// Images at rest, and sampled along the paths.
    pub(super) images: [&'a Images<'b, S>; 2],
    pub(super) fits: &'a MotionFits,
    pub(super) validity: &'a Validity,
    pub(super) tile_row: usize,
    pub(super) paths: &'a [Path],
    pub(super) verdicts: &'a mut [Verdict],
    pub(super) greys: &'a mut BlockGreys,
}

impl<S: Sample> Kernel for VerdictKernel<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { images: [resting, followed], fits, validity, tile_row, paths, verdicts, greys } = self;
        let [first, step] = CHECKED_ROWS;
        let with_path = paths.iter().zip(verdicts).enumerate().filter(|(_, (path, _))| path.bin.is_some());
        for (block, (path, verdict)) in with_path {
            let count = (resting.width - block * LANES).min(LANES);
            let end = ((tile_row + 1) * FLOW_TILE_PX).min(resting.height);
            for row in (tile_row * FLOW_TILE_PX + first..end).step_by(step) {
                let place = [row * resting.width + block * LANES, count];
                let at_rest = fit_quality(lanes, resting, fits.resting(), validity, place, greys);
                let on_path = fit_quality(lanes, followed, fits.for_bin(path.bin), validity, place, greys);
                *verdict = verdict.plus(Verdict { lit: at_rest.lit, resting: at_rest, followed: on_path });
            }
        }
    }
}

/// Quality of fit over the lit ones of `count` pixels of a row.
///
/// ```text
/// z, z' = weighted sums of the images
/// squares = squared residual of the sinusoid that moves as the fit expects
/// for each lit, unsaturated pixel: fit += half / (half + squares), half = squared residual of a pixel that counts half
///     power += |z|², slope += Im(z'·z*); remaining motion = |slope| / power
/// ```
#[inline(always)]
fn fit_quality<L: Lanes, S: Sample>(
    lanes: L,
    images: &Images<'_, S>,
    fit: &MotionFit,
    validity: &Validity,
    [pixel, count]: [usize; 2],
    greys: &mut BlockGreys,
) -> FitQuality {
    let l = lanes;
    // Real and imaginary parts of z, then of z'.
    let mut z = [l.real(0.0); 4];
    let mut greatest = l.word(0);
    for (i, (weights, greys)) in fit.weights.iter().zip(greys.iter_mut()).enumerate() {
        let grey = images.greys(l, i, [pixel, count], &mut greatest);
        l.store_reals(grey, greys);
        let mut part = 0;
        while part < z.len() {
            z[part] = l.add_real(z[part], l.times_real(grey, l.real(weights[1 + part])));
            part += 1;
        }
    }
    // Squared residual of the sinusoid at the motion of the fit.
    let mut squares = l.real(0.0);
    for direction in &fit.equalization.observable {
        let mut residual = l.real(0.0);
        for (grey, &share) in greys.iter().zip(direction) {
            residual = l.add_real(residual, l.times_real(l.load_reals(grey), l.real(share as f32)));
        }
        squares = l.add_real(squares, l.times_real(residual, residual));
    }
    let power = l.add_real(l.times_real(z[0], z[0]), l.times_real(z[1], z[1]));
    let half = HALF_FIT_SHARE * HALF_FIT_SHARE * (images.count - MIN_STEPS) as f32;
    let half = l.times_real(l.real(half), power);
    let least = validity.min_modulation_grey * validity.min_modulation_grey;
    let is_lit = l.and_not(l.is_at_least_real(power, l.real(least)), images.saturates(l, greatest));
    let is_usable = l.and(is_lit, l.mask(first_lanes(count)));
    // Im(z'·z*).
    let slope = l.sub_real(l.times_real(z[3], z[0]), l.times_real(z[2], z[1]));
    let fit = l.over_real(half, l.add_real(half, squares));
    FitQuality {
        lit: l.bits(is_usable).count_ones() as f32,
        fit: sum(l, is_usable, fit),
        power: sum(l, is_usable, power),
        remaining: sum(l, is_usable, slope).abs(),
    }
}

/// The sum of the usable lanes.
#[inline(always)]
fn sum<L: Lanes>(lanes: L, is_usable: L::Mask, reals: L::Reals) -> f32 {
    let mut values = [0.0; LANES];
    lanes.store_reals(lanes.select_real(is_usable, reals, lanes.real(0.0)), &mut values);
    total(values)
}
