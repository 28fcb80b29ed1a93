//! The candidates that were chosen, a plane a quantity.

use rayon::prelude::*;

use super::candidates::Candidate;

/// The chosen candidates of all pixels of C1, row by row: what is read of whole images, and what channels carry, are planes.
///
/// All numbers are zero where none was chosen; which pixels these are is said by their outcome.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChosenCandidates {
    /// Columns in the epipolar frame, pixels.
    pub column_px: Vec<f32>,
    /// Fringe orders.
    pub order: Vec<i16>,
    /// δ, turns · 65536.
    pub delta: Vec<i16>,
    /// Rise of the phase of C2 over one column, turns · 65536.
    pub slope: Vec<i16>,
}

/// Those of one row.
pub(super) struct ChosenRow<'a> {
    column_px: &'a mut [f32],
    order: &'a mut [i16],
    delta: &'a mut [i16],
    slope: &'a mut [i16],
}

impl ChosenCandidates {
    /// Makes room for so many pixels; what was chosen before stays where there is room for it.
    pub fn resize(&mut self, pixels: usize) {
        let Self { column_px, order, delta, slope } = self;
        column_px.resize(pixels, 0.0);
        [order, delta, slope].into_iter().for_each(|plane| plane.resize(pixels, 0));
    }

    /// What stands at a pixel: its candidate, if one was chosen.
    #[must_use]
    #[inline]
    pub fn at(&self, pixel: usize) -> Candidate {
        Candidate {
            column_px: self.column_px[pixel],
            order: self.order[pixel],
            delta: self.delta[pixel],
            slope: self.slope[pixel],
        }
    }

    /// Takes back what was chosen for a pixel.
    pub fn clear(&mut self, pixel: usize) {
        self.column_px[pixel] = 0.0;
        [&mut self.order, &mut self.delta, &mut self.slope].into_iter().for_each(|plane| plane[pixel] = 0);
    }

    /// The rows, to be filled in.
    pub(super) fn rows_mut(&mut self, width: usize) -> impl IndexedParallelIterator<Item = ChosenRow<'_>> {
        let columns_and_orders = self.column_px.par_chunks_mut(width).zip(self.order.par_chunks_mut(width));
        let rest = self.delta.par_chunks_mut(width).zip(self.slope.par_chunks_mut(width));
        columns_and_orders.zip(rest).map(|((column_px, order), (delta, slope))| ChosenRow {
            column_px,
            order,
            delta,
            slope,
        })
    }
}

impl ChosenRow<'_> {
    /// Says what was chosen for the pixel in a column.
    #[inline]
    pub(super) fn set(&mut self, u: usize, candidate: Option<Candidate>) {
        let none = Candidate { column_px: 0.0, order: 0, delta: 0, slope: 0 };
        let Candidate { column_px, order, delta, slope } = candidate.unwrap_or(none);
        (self.column_px[u], self.order[u], self.delta[u], self.slope[u]) = (column_px, order, delta, slope);
    }
}
