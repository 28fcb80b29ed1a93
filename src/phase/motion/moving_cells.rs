//! Cells of known motion. In: motions. Out: for each pixel what depends on the motion alone, and with it z without ripple
//! and the residual. Cost: some forty operations per pixel, and six per residual.

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{LANES, Lanes};

use super::fit::MotionFit;
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
    /// Responses of A and of the residuals to z.
    responses: [[Row; 2]; 1 + MAX_IMAGES],
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
        let responses = std::iter::once(&fit.offset_response).chain(&fit.residual_responses);
        for (response, (upper, lower)) in responses.zip(upper.responses.iter_mut().zip(&mut lower.responses)) {
            let [[re, im]] = turns.sums(l, [response]);
            store_doubled(l, re, [&mut upper[0], &mut lower[0]]);
            store_doubled(l, im, [&mut upper[1], &mut lower[1]]);
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

    /// Returns the offset of fitted pixels, and the standard deviation of their samples about moving sinusoids with these
    /// z; both in grey levels.
    #[inline(always)]
    pub(super) fn residual<L: Lanes>(
        &self,
        lanes: L,
        (offset, residuals): (&Row, &[Row]),
        z: Complexes<L>,
    ) -> [L::Reals; 2] {
        let l = lanes;
        let [of_offset, of_residuals @ ..] = &self.responses;
        let mut squares = l.real(0.0);
        for (residual, response) in residuals.iter().zip(of_residuals) {
            let residual = l.sub_real(l.load_reals(residual), explained(l, response, z));
            squares = l.add_real(squares, l.times_real(residual, residual));
        }
        let residual = l.root_real(l.over_real(squares, l.real(residuals.len() as f32)));
        [l.sub_real(l.load_reals(offset), explained(l, of_offset, z)), residual]
    }
}

/// What z explains with a response.
#[inline(always)]
fn explained<L: Lanes>(lanes: L, [x, y]: &[Row; 2], [re, im]: Complexes<L>) -> L::Reals {
    lanes.sub_real(lanes.times_real(re, lanes.load_reals(x)), lanes.times_real(im, lanes.load_reals(y)))
}

/// Stores the numbers of 32 cells for the pixels of their two rows.
#[inline(always)]
fn store_doubled<L: Lanes>(lanes: L, cells: L::Reals, [upper, lower]: [&mut Row; 2]) {
    let [first, second] = lanes.doubled(cells);
    lanes.store_reals(first, upper);
    lanes.store_reals(second, lower);
}
