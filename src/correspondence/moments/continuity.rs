//! How many of the eight pixels around a point continue it: at rims, where two surfaces mix, few do.

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use super::Pixels;
use super::nodes::NONE;
use crate::correspondence::neighbourhood::{ABSENT, MAX_STEP};
use crate::correspondence::pool::Pool;
use crate::correspondence::view::View;

/// Pixels around one.
pub(super) const NEIGHBOURS: u8 = 8;

/// Absolute phases of a row and of those above and below, turns · 65536, with a column without phase at both ends.
type Rows = [Vec<i32>; 3];

/// Counts for all pixels, and scratch memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Continuity {
    pub(super) of_pixels: Vec<u8>,
    pool: Pool<Rows>,
}

impl Continuity {
    /// Counts around every pixel; what it counts around one without a point has no meaning.
    pub(super) fn count(&mut self, view: View<'_>, pixels: &Pixels<'_>) {
        let Self { of_pixels, pool } = self;
        let (width, height) = (view.cam1.width, view.cam1.height);
        of_pixels.resize(width * height, 0);
        of_pixels.par_chunks_mut(width).enumerate().for_each(|(v, counts)| {
            let mut rows = pool.take();
            for (row, v) in rows.iter_mut().zip([v.checked_sub(1), Some(v), Some(v + 1)]) {
                row.clear();
                row.resize(width + 2, ABSENT);
                let Some(v) = v.filter(|v| *v < height) else { continue };
                let own = v * width..(v + 1) * width;
                let (owner, order, phase) =
                    (&pixels.owner[own.clone()], &pixels.chosen.order[own.clone()], &view.cam1.phase[own]);
                for (u, absolute) in row[1..=width].iter_mut().enumerate() {
                    let decided = (i32::from(order[u]) << 16) + i32::from(phase[u]);
                    *absolute = if owner[u] == NONE { ABSENT } else { decided };
                }
            }
            fringeflow_simd::run(Level::in_use(), CountKernel { rows: &rows, counts });
        });
    }
}

struct CountKernel<'a> {
    rows: &'a Rows,
    counts: &'a mut [u8],
}

impl Kernel for CountKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { rows, counts } = self;
        let width = counts.len();
        let own = &rows[1][1..][..width];
        counts.fill(0);
        for (i, row) in rows.iter().enumerate() {
            for shift in 0..3 {
                if (i, shift) == (1, 1) {
                    continue;
                }
                let other = &row[shift..][..width];
                for u in 0..width {
                    let step = other[u].wrapping_sub(own[u]).wrapping_abs();
                    counts[u] += u8::from((0..=MAX_STEP).contains(&step));
                }
            }
        }
    }
}
