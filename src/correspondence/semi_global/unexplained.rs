//! Unexplained neighbourhoods: their pixels see a surface that C2 does not see, or noise. No path can find their order.
//!
//! ```text
//! for each pixel p: remove all orders of p if, for every q with |q − p| ≤ 2 along both axes,
//!     no surface gives the order of q, and none of its orders fits
//! ```
//!
//! A pixel near an explained one keeps its orders: it may be a rim, or a dark speck that paths bridge. And all
//! candidates of a surface may lie farther from the drift than matching costs reach.

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

/// Distance within which a pixel must be explained, pixels.
const REACH_PX: usize = 2;
/// Rows within that distance.
const ROWS: usize = 2 * REACH_PX + 1;
/// Pixels handled at once.
const BLOCK: usize = 32;

/// Removes the orders of the pixels in unexplained neighbourhoods, in an image of `width` columns.
pub(super) fn remove_orders(width: usize, is_explained: &[u8], count: &mut [u8]) {
    let height = is_explained.len() / width;
    count.par_chunks_mut(width).enumerate().for_each(|(v, count)| {
        let rows = std::array::from_fn(|i| {
            let row = (v + i).saturating_sub(REACH_PX).min(height - 1);
            &is_explained[row * width..(row + 1) * width]
        });
        fringeflow_simd::run(Level::in_use(), RemoveRow { rows, count });
    });
}

/// Removes the orders of a row.
struct RemoveRow<'a> {
    /// The explained pixels of the rows around it; beyond the image its border repeats.
    rows: [&'a [u8]; ROWS],
    count: &'a mut [u8],
}

impl Kernel for RemoveRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { rows, count } = self;
        let width = count.len();
        for begin in (0..width).step_by(BLOCK) {
            // Whether any pixel is explained, column by column around the block.
            let mut columns = [0; BLOCK + 2 * REACH_PX];
            let (from, to) = (begin.saturating_sub(REACH_PX), (begin + BLOCK + REACH_PX).min(width));
            let within = &mut columns[from + REACH_PX - begin..][..to - from];
            for row in rows {
                for (any, is_explained) in within.iter_mut().zip(&row[from..to]) {
                    *any |= is_explained;
                }
            }
            for (k, count) in count[begin..].iter_mut().take(BLOCK).enumerate() {
                let mut any = 0;
                for i in 0..ROWS {
                    any |= columns[k + i];
                }
                *count = if any == 0 { 0 } else { *count };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_stay_around_explained_pixels() {
        for (width, height) in [(1, 1), (3, 2), (33, 7), (70, 40)] {
            let places = [[0, 0], [width - 1, height / 2], [width / 2, height - 1], [31 % width, 4 % height]];
            let mut is_explained = vec![0; width * height];
            places.iter().for_each(|[u, v]| is_explained[v * width + u] = 1);
            let mut counts = vec![9; width * height];
            remove_orders(width, &is_explained, &mut counts);
            for (pixel, &count) in counts.iter().enumerate() {
                let is_near = |[u, v]: &[usize; 2]| {
                    (pixel % width).abs_diff(*u) <= REACH_PX && (pixel / width).abs_diff(*v) <= REACH_PX
                };
                assert_eq!(count, if places.iter().any(is_near) { 9 } else { 0 }, "{width} {height} {pixel}");
            }
        }
    }
}
