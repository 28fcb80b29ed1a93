//! The chosen candidates, one array per quantity.

use rayon::prelude::*;

use super::candidates::Candidate;

/// The chosen candidates of all pixels of C1, row by row.
///
/// Whole images are read and sent array by array. All numbers are zero where no candidate was chosen; only
/// [`super::Outcome`] distinguishes these pixels.
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

/// The chosen candidates of one row.
pub(super) struct ChosenRow<'a> {
    column_px: &'a mut [f32],
    order: &'a mut [i16],
    delta: &'a mut [i16],
    slope: &'a mut [i16],
}

impl ChosenCandidates {
    /// Resizes to `pixels`. Keeps earlier candidates as far as there is room.
    pub fn resize(&mut self, pixels: usize) {
        let Self { column_px, order, delta, slope } = self;
        column_px.resize(pixels, 0.0);
        [order, delta, slope].into_iter().for_each(|plane| plane.resize(pixels, 0));
    }

    /// The numbers stored for a pixel: its candidate, if one was chosen.
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

    /// Removes the candidate of a pixel.
    pub fn clear(&mut self, pixel: usize) {
        self.column_px[pixel] = 0.0;
        [&mut self.order, &mut self.delta, &mut self.slope].into_iter().for_each(|plane| plane[pixel] = 0);
    }

    /// The rows, to be written.
    pub(super) fn rows_mut(&mut self, width: usize) -> impl IndexedParallelIterator<Item = ChosenRow<'_>> {
        let arrays = (
            self.column_px.par_chunks_mut(width),
            self.order.par_chunks_mut(width),
            self.delta.par_chunks_mut(width),
            self.slope.par_chunks_mut(width),
        );
        arrays.into_par_iter().map(|(column_px, order, delta, slope)| ChosenRow { column_px, order, delta, slope })
    }
}

impl ChosenRow<'_> {
    /// Stores the candidate of the pixel in column `u`.
    #[inline]
    pub(super) fn set(&mut self, u: usize, candidate: Option<Candidate>) {
        let none = Candidate { column_px: 0.0, order: 0, delta: 0, slope: 0 };
        let Candidate { column_px, order, delta, slope } = candidate.unwrap_or(none);
        (self.column_px[u], self.order[u], self.delta[u], self.slope[u]) = (column_px, order, delta, slope);
    }
}
