//! Gaps: open pixels through which the phase goes on.
//!
//! ```text
//! runs of open pixels of a row, from one to the next of which the phase goes on; runs of neighbouring rows are united if
//! it goes on between any two of their pixels
//! ```

use fringeflow_simd::LANES;

use super::breaks::goes_on;
use super::nodes::NONE;
use crate::correspondence::runs::{Run, Runs, Union};
use crate::correspondence::view::View;

/// The gaps of an image.
#[derive(Clone, Debug, Default)]
pub(super) struct Gaps {
    runs: Runs<()>,
    /// Number of gaps.
    pub(super) count: usize,
}

impl Gaps {
    /// Finds the gaps between parts. `owner` is the part of each pixel.
    pub(super) fn find(&mut self, view: View<'_>, owner: &[u32]) {
        let (width, height) = (view.cam1.width, view.cam1.height);
        let valid = &view.cam1.valid;
        self.runs.divide(height, rayon::iter::repeat_n((), height), |v, (), (), runs| {
            let end = (v + 1) * width;
            let mut begin = v * width;
            loop {
                begin += count_closed(&owner[begin..end], &valid[begin..end]);
                if begin == end {
                    break;
                }
                let mut next = begin + 1;
                while next < end && is_open(owner[next], valid[next]) && goes_on(view, next - 1, next) == Some(true) {
                    next += 1;
                }
                runs.push(Run::new(begin..next));
                begin = next;
            }
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

fn is_open(owner: u32, is_valid: bool) -> bool {
    (owner == NONE) & is_valid
}

/// How many of these pixels, from the first one on, are not open.
fn count_closed(owner: &[u32], valid: &[bool]) -> usize {
    // Whole blocks are looked at at once.
    let blocks = owner.as_chunks::<LANES>().0.iter().zip(valid.as_chunks::<LANES>().0);
    let any_open = |(owner, valid): (&[u32; LANES], &[bool; LANES])| {
        owner.iter().zip(valid).fold(false, |any, (owner, valid)| any | is_open(*owner, *valid))
    };
    let closed = LANES * blocks.take_while(|&block| !any_open(block)).count();
    let rest = owner[closed..].iter().zip(&valid[closed..]);
    closed + rest.take_while(|(owner, valid)| !is_open(**owner, **valid)).count()
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
