//! Gaps: open pixels through which the phase goes on.
//!
//! ```text
//! runs of open pixels of a row, from one to the next of which the phase goes on; runs of neighbouring rows are united if
//! it goes on between any two of their pixels
//! ```

use super::breaks::goes_on;
use super::nodes::NONE;
use crate::correspondence::runs::{Run, Runs, Union, divide_at_marks};
use crate::correspondence::view::View;

/// The gaps of an image.
#[derive(Clone, Debug, Default)]
pub(super) struct Gaps {
    runs: Runs<Vec<u8>>,
    /// Number of gaps.
    pub(super) count: usize,
}

impl Gaps {
    /// Finds the gaps between parts. `owner` is the part of each pixel.
    pub(super) fn find(&mut self, view: View<'_>, owner: &[u32]) {
        let (width, height) = (view.cam1.width, view.cam1.height);
        let is_open = |pixel: usize| owner[pixel] == NONE && view.cam1.valid[pixel];
        self.runs.divide(height, rayon::iter::repeat_n((), height), |v, ends, (), runs| {
            let first = v * width;
            let mut was_open = false;
            ends.clear();
            for pixel in first..first + width {
                let is_open = is_open(pixel);
                ends.push(u8::from(is_open != was_open || is_open && goes_on(view, pixel - 1, pixel) != Some(true)));
                was_open = is_open;
            }
            divide_at_marks(first, ends, |u| is_open(first + u), runs);
        });
        self.count = self.runs.unite(width, |_, _, overlaps, unions| {
            for (runs, shared) in overlaps {
                if shared.into_iter().any(|pixel| goes_on(view, pixel - width, pixel) == Some(true)) {
                    unions.push(Union { runs, order_step: 0 });
                }
            }
        });
    }

    /// A cursor over the gaps of a row.
    pub(super) fn row(&self, v: usize) -> Cursor<'_> {
        Cursor(self.runs.row(v))
    }
}

/// Finds the gaps of pixels of a row, from left to right.
pub(super) struct Cursor<'a>(&'a [Run]);

impl Cursor<'_> {
    /// The gap of a pixel, [`NONE`] if it is in none.
    pub(super) fn gap_of(&mut self, pixel: usize) -> u32 {
        while self.0.first().is_some_and(|run| run.pixels().end <= pixel) {
            self.0 = &self.0[1..];
        }
        self.0.first().filter(|run| run.pixels().contains(&pixel)).map_or(NONE, |run| run.set)
    }
}
