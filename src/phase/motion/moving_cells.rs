//! Cells of known motion. In: motions. Out: for each pixel what depends on the motion alone, and with it z without ripple
//! and the residual. Cost: some forty operations per pixel, and thirteen per sample.

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{LANES, Lanes};

use crate::phase::sample::Sample;

use super::fit::MotionFit;
use super::image_times::time;
use super::images::Images;
use super::ripple::{Complexes, Turns, ripple_removal};

/// One number per pixel of a row.
type Row = [f32; LANES];

/// What depends on the motion of the cells of a block of a strip.
#[derive(Clone, Debug, Default)]
pub(super) struct MovingCells([MovingRow; 2]);

/// The same for the pixels of a row of cells.
#[derive(Clone, Debug, Default)]
pub(super) struct MovingRow {
    /// Motion, rad per image; NaN where unknown.
    motion_rad: Row,
    /// 1 where the motion is known and z can be told from its ripple, otherwise 0.
    is_determined: Row,
    /// Factors of [`ripple_removal`].
    removal: [Row; 4],
    /// Cosine and sine of the moved phase shift of each image.
    moved_shifts: [[Row; 2]; MAX_IMAGES],
}

impl MovingCells {
    /// Sets the motion of the cells of a block, which is `known` in some of them and 0 in the others.
    #[inline(always)]
    pub(super) fn set<L: Lanes>(
        &mut self,
        lanes: L,
        fit: &MotionFit,
        motion_rad: L::Reals,
        known: L::Mask,
        turns: &mut Turns<L>,
    ) {
        let l = lanes;
        turns.set(l, fit.images(), motion_rad);
        let (removal, has_contrast) = ripple_removal(l, turns.sums(l, [&fit.fine.direct, &fit.fine.ripple]));
        let is_determined = l.select_real(l.and(known, has_contrast), l.real(1.0), l.real(0.0));
        let [upper, lower] = &mut self.0;
        store_doubled(
            l,
            l.select_real(known, motion_rad, l.real(f32::NAN)),
            [&mut upper.motion_rad, &mut lower.motion_rad],
        );
        store_doubled(l, is_determined, [&mut upper.is_determined, &mut lower.is_determined]);
        let mut k = 0;
        while k < removal.len() {
            store_doubled(l, removal[k], [&mut upper.removal[k], &mut lower.removal[k]]);
            k += 1;
        }
        for (image, &[cos, sin]) in fit.turns.iter().enumerate() {
            let [cos, sin] = turns.moved(l, [l.real(cos), l.real(sin)], [image, fit.images()]);
            let (upper, lower) = (&mut upper.moved_shifts[image], &mut lower.moved_shifts[image]);
            store_doubled(l, cos, [&mut upper[0], &mut lower[0]]);
            store_doubled(l, sin, [&mut upper[1], &mut lower[1]]);
        }
    }

    /// The upper or lower row of cells.
    #[inline(always)]
    pub(super) fn row(&self, row: usize) -> &MovingRow {
        &self.0[row]
    }
}

impl MovingRow {
    /// Motion of the pixels, rad per image; NaN where unknown.
    #[inline(always)]
    pub(super) fn motion_rad<L: Lanes>(&self, lanes: L) -> L::Reals {
        lanes.load_reals(&self.motion_rad)
    }

    /// Pixels whose motion is known and whose z can be told from its ripple.
    #[inline(always)]
    pub(super) fn is_determined<L: Lanes>(&self, lanes: L) -> L::Mask {
        lanes.is_greater_real(lanes.load_reals(&self.is_determined), lanes.real(0.0))
    }

    /// z from the fitted z.
    #[inline(always)]
    pub(super) fn without_ripple<L: Lanes>(&self, lanes: L, [x, y]: Complexes<L>) -> Complexes<L> {
        let l = lanes;
        let [re_x, re_y, im_y, im_x] = &self.removal;
        [
            l.add_real(l.times_real(l.load_reals(re_x), x), l.times_real(l.load_reals(re_y), y)),
            l.sub_real(l.times_real(l.load_reals(im_y), y), l.times_real(l.load_reals(im_x), x)),
        ]
    }

    /// Returns the offset of the samples of `count` pixels from `pixel` on, and the standard deviation of the samples
    /// about the moving sinusoids z; both in grey levels. The parameter `offset` is an estimate of the offset.
    #[inline(always)]
    pub(super) fn residual<L: Lanes, S: Sample>(
        &self,
        lanes: L,
        images: &Images<'_, S>,
        fit: &MotionFit,
        [pixel, count]: [usize; 2],
        offset: L::Reals,
        [re, im]: Complexes<L>,
    ) -> [L::Reals; 2] {
        let l = lanes;
        let (mut sum, mut trend, mut squares) = (l.real(0.0), l.real(0.0), l.real(0.0));
        let mut times = 0.0;
        for (i, [cos, sin]) in self.moved_shifts.iter().enumerate().take(fit.images()) {
            let t = time(i, images.count) as f32;
            let model = l.sub_real(l.times_real(re, l.load_reals(cos)), l.times_real(im, l.load_reals(sin)));
            let grey = l.times_real(S::reals(l, &images.block(i, pixel, count)), l.real(images.grey_per_value[i]));
            let residual = l.sub_real(l.sub_real(grey, offset), model);
            sum = l.add_real(sum, residual);
            trend = l.add_real(trend, l.times_real(l.real(t), residual));
            squares = l.add_real(squares, l.times_real(residual, residual));
            times += t * t;
        }
        // Subtract the squares explained by a better offset and, if it is determined, by the trend A'.
        let count = l.real(images.count as f32);
        let per_time = l.real(if fit.has_trend { 1.0 / times } else { 0.0 });
        let explained = l.over_real(l.times_real(sum, sum), count);
        let left = l.sub_real(l.sub_real(squares, explained), l.times_real(l.times_real(trend, trend), per_time));
        let left = l.max_real(left, l.real(0.0));
        let residual = l.root_real(l.over_real(left, l.real(fit.freedom() as f32)));
        [l.add_real(offset, l.over_real(sum, count)), residual]
    }
}

/// Stores the numbers of 32 cells for the pixels of their two rows.
#[inline(always)]
fn store_doubled<L: Lanes>(lanes: L, cells: L::Reals, [upper, lower]: [&mut Row; 2]) {
    let [first, second] = lanes.doubled(cells);
    lanes.store_reals(first, upper);
    lanes.store_reals(second, lower);
}
