//! Whether what is known of the motion is true: some rows of each tile tell, whose images fit it or do not.

use fringeflow_base::limits::{MAX_IMAGES, MIN_STEPS};
use fringeflow_simd::{Kernel, LANES, Lanes, first_lanes};

use crate::phase::Validity;
use crate::phase::motion::fit::MotionFit;
use crate::phase::motion::fits::MotionFits;
use crate::phase::motion::flow::FLOW_TILE_PX;
use crate::phase::motion::images::Images;
use crate::phase::sample::Sample;

use super::Path;

/// Rows of a tile by which it is judged: the first, and how far apart.
const JUDGED: [usize; 2] = [3, 8];
/// Residual ÷ modulation at which a pixel fits by half.
const HALF_FIT_SHARE: f32 = 0.3;
/// By how much less of a pixel may fit along the way than at rest: as much as by chance. Tiles are judged with those around them,
/// which most often move alike.
const CHANCE_SHARE: f32 = 0.01;

/// Motion that is left along the way of a surface whose motion is known well, rad an image; and the share of what is there at
/// rest, for hands that tremble.
const LEFT_RAD: f32 = 0.05;
const LEFT_SHARE: f32 = 0.5;
/// Share of the lit pixels that must lie in tiles that fit along their ways: where fewer do, what is known is wrong.
const LEAST_SHARE: f32 = 0.5;
/// From this share on the whole scene moves as is known, and only tiles that clearly do not are left.
const RIGID_SHARE: f32 = 0.8;
/// What such tiles may do: fit so much worse than at rest, and move so much more than is known, rad an image.
const RIGID_FIT_SHARE: f32 = 0.7;
const RIGID_LEFT_RAD: f32 = 0.25;

/// How the pixels of a tile fit at rest and along the way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Verdict {
    /// Pixels that are lit at rest.
    lit: f32,
    resting: Fitting,
    followed: Fitting,
}

/// How well pixels fit a sinusoid that moves as expected; one that may move as it likes fits nearly everything.
#[derive(Clone, Copy, Debug, Default)]
struct Fitting {
    lit: f32,
    /// Sum of how well each fits, 1 at best.
    fit: f32,
    /// Sums of |z|², and of |z|² times the amount of the motion that is left, over the pixels of a row each.
    power: f32,
    left: f32,
}

impl Fitting {
    fn plus(self, other: Self) -> Self {
        Self {
            lit: self.lit + other.lit,
            fit: self.fit + other.fit,
            power: self.power + other.power,
            left: self.left + other.left,
        }
    }

    /// Mean motion that is left, rad an image.
    fn left_rad(&self) -> f32 {
        if self.power > 0.0 { self.left / self.power } else { 0.0 }
    }
}

impl Verdict {
    fn plus(self, other: Self) -> Self {
        let Self { lit, resting, followed } = other;
        Self { lit: self.lit + lit, resting: self.resting.plus(resting), followed: self.followed.plus(followed) }
    }

    /// Whether the way fits as well, if the scene around moves as is known.
    fn is_near_the_way(self) -> bool {
        let fits = self.followed.fit >= RIGID_FIT_SHARE * self.resting.fit;
        fits && self.followed.left_rad() <= RIGID_LEFT_RAD.max(self.resting.left_rad())
    }

    /// Whether the way fits as well.
    fn is_for_the_way(self) -> bool {
        let fits = self.followed.fit + CHANCE_SHARE * self.lit >= self.resting.fit;
        fits && self.followed.left_rad() <= LEFT_RAD + LEFT_SHARE * self.resting.left_rad()
    }
}

/// What judges the tiles of a row.
#[derive(Clone, Debug)]
pub(super) struct JudgeScratch {
    greys: Box<[[f32; LANES]; MAX_IMAGES]>,
}

impl Default for JudgeScratch {
    fn default() -> Self {
        Self { greys: Box::new([[0.0; LANES]; MAX_IMAGES]) }
    }
}

/// Takes the ways from tiles that fit better without them, and from all where what is known is wrong.
pub(super) fn judge(paths: &mut [Path], verdicts: &[Verdict], columns: usize) {
    let around = |place: usize| around_tile(verdicts, columns, place);
    let ways = || paths.iter().enumerate().filter(|(_, path)| path.bin.is_some()).map(|(place, _)| place);
    let lit = ways().map(|place| verdicts[place].lit).sum::<f32>();
    let fitting = ways().filter(|&place| around(place).is_for_the_way()).map(|place| verdicts[place].lit).sum::<f32>();
    for (place, path) in paths.iter_mut().enumerate() {
        let stays = if fitting >= RIGID_SHARE * lit {
            around(place).is_near_the_way()
        } else {
            fitting >= LEAST_SHARE * lit && around(place).is_for_the_way()
        };
        if !stays {
            *path = Path::default();
        }
    }
}

/// The verdicts of a tile and of those around it.
fn around_tile(verdicts: &[Verdict], columns: usize, place: usize) -> Verdict {
    let (column, row) = (place % columns, place / columns);
    let rows = row.saturating_sub(1)..(row + 2).min(verdicts.len() / columns);
    let all = rows.flat_map(|row| {
        let of_row = &verdicts[row * columns..][..columns];
        of_row[column.saturating_sub(1)..(column + 2).min(columns)].iter()
    });
    all.fold(Verdict::default(), |sum, verdict| sum.plus(*verdict))
}

/// Judges the tiles of a row: whether samples along their ways fit as well as those at rest.
pub(super) struct Judging<'a, 'b, S> {
    pub(super) images: [&'a Images<'b, S>; 2],
    pub(super) fits: &'a MotionFits,
    pub(super) validity: &'a Validity,
    pub(super) tile_row: usize,
    pub(super) paths: &'a [Path],
    pub(super) verdicts: &'a mut [Verdict],
    pub(super) scratch: &'a mut JudgeScratch,
}

impl<S: Sample> Kernel for Judging<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { images: [resting, followed], fits, validity, tile_row, paths, verdicts, scratch } = self;
        let [first, step] = JUDGED;
        let ways = paths.iter().zip(verdicts).enumerate().filter(|(_, (path, _))| path.bin.is_some());
        for (block, (path, verdict)) in ways {
            let count = (resting.width - block * LANES).min(LANES);
            let end = ((tile_row + 1) * FLOW_TILE_PX).min(resting.height);
            for row in (tile_row * FLOW_TILE_PX + first..end).step_by(step) {
                let place = [row * resting.width + block * LANES, count];
                let both = [(resting, fits.resting()), (followed, fits.of(path.bin))];
                let [resting, followed] =
                    both.map(|(images, fit)| fitting(lanes, images, fit, validity, place, &mut scratch.greys));
                *verdict = verdict.plus(Verdict { lit: resting.lit, resting, followed });
            }
        }
    }
}

/// How well those of `count` pixels of a row fit that are lit.
#[inline(always)]
fn fitting<L: Lanes, S: Sample>(
    lanes: L,
    images: &Images<'_, S>,
    fit: &MotionFit,
    validity: &Validity,
    [pixel, count]: [usize; 2],
    greys: &mut [[f32; LANES]; MAX_IMAGES],
) -> Fitting {
    let l = lanes;
    let Some(levelling) = &fit.levelling else { return Fitting::default() };
    let mut z = [l.real(0.0); 4];
    let mut greatest = l.word(0);
    for (i, (weights, greys)) in fit.weights.iter().zip(greys.iter_mut()).enumerate() {
        let grey = images.greys(l, i, [pixel, count], &mut greatest);
        l.store_reals(grey, greys);
        z = [0, 1, 2, 3].map(|part| l.add_real(z[part], l.times_real(grey, l.real(weights[1 + part]))));
    }
    let mut squares = l.real(0.0);
    for row in &levelling.projector {
        let mut left = l.real(0.0);
        for (grey, &share) in greys.iter().zip(row) {
            left = l.add_real(left, l.times_real(l.load_reals(grey), l.real(share as f32)));
        }
        squares = l.add_real(squares, l.times_real(left, left));
    }
    let power = l.add_real(l.times_real(z[0], z[0]), l.times_real(z[1], z[1]));
    let half = HALF_FIT_SHARE * HALF_FIT_SHARE * (images.count - MIN_STEPS) as f32;
    let half = l.times_real(l.real(half), power);
    let least = validity.min_modulation_grey * validity.min_modulation_grey;
    let is_clear =
        l.bits(l.is_at_least_real(power, l.real(least))) & !l.bits(images.saturates(l, greatest)) & first_lanes(count);
    // Im(z'·z*).
    let slope = l.sub_real(l.times_real(z[3], z[0]), l.times_real(z[2], z[1]));
    let sum = |of: L::Reals| {
        let mut values = [0.0; LANES];
        l.store_reals(of, &mut values);
        let clear = values.iter().enumerate().filter(|(k, _)| is_clear >> k & 1 == 1);
        clear.map(|(_, value)| value).sum::<f32>()
    };
    let lit = is_clear.count_ones() as f32;
    Fitting { lit, fit: sum(l.over_real(half, l.add_real(half, squares))), power: sum(power), left: sum(slope).abs() }
}
