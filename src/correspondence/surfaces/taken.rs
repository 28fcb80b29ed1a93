//! The places of C2 where surfaces outside the measurement volume are seen: no point within has its correspondence
//! there.
//!
//! ```text
//! for each node that sees something outside, if nearly all its pixels fit its order:
//!     mark the places of its marked pixels as taken, and short gaps between the places of neighbours
//! for each clear node that sees into the volume: mark its places as free
//!     (a surface behind it that is hidden from C2 may fit there too)
//! mask: remove the phase of C2 at every place that is taken with all places around it
//!     (at borders C2 may see something else; a row between two taken rows counts as taken,
//!     since C2 may see a surface larger than C1 does)
//! ```
//!
//! A strip of a surface outside the volume, or a part of it that is hidden from C2, finds the phase of a wrong order in
//! the image of the same surface in C2. Those places are explained already.

use rayon::prelude::*;

use fringeflow_simd::{Kernel, LANES, Lanes, Level};

use crate::correspondence::drift::{DepthRow, Drift};
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::segment::SegmentRow;

use super::NO_ORDER;
use super::block::Block;
use super::nodes::{Node, Nodes};
use super::scratch::{RowScratch, Scratch, Span, TakenRow};
use crate::correspondence::view::View;

/// Least share of the fitting pixels of a node whose places are taken.
const MIN_FITTING: f32 = 0.78;
/// Largest gap between the places of neighbouring pixels that is taken too, pixels.
const MAX_GAP_PX: u32 = 3;
/// Marks of places: taken, and free.
const TAKEN: u8 = u8::MAX;
const FREE: u8 = 0;
/// Stands for no column.
const NO_COLUMN_PX: f32 = -1.0;

impl Span {
    /// The place of one pixel.
    fn new(row_px: f32, column_px: f32) -> Self {
        let [row, begin] = [row_px, column_px].map(|px| (px + 0.5) as u32);
        Self { row, begin, end: begin + 1 }
    }

    /// Extends the span by the place of the next pixel, if it is adjacent. Returns whether it is.
    fn extend_by(&mut self, next: Self) -> bool {
        let is_adjacent = next.row == self.row && next.begin >= self.begin && next.begin < self.end + MAX_GAP_PX;
        if is_adjacent {
            self.end = self.end.max(next.end);
        }
        is_adjacent
    }
}

impl Scratch {
    /// Copies C2 to `open` without the taken places. Returns false if no pixel is known to see something outside.
    pub(in crate::correspondence) fn mask_taken(
        &mut self,
        view: View<'_>,
        drift: &Drift,
        outside: &[bool],
        open: &mut EpipolarImage,
    ) -> bool {
        let takes_places =
            |node: &Node| node.sees_beyond && !node.is_unseen() && node.fitting >= MIN_FITTING * node.sampled as f32;
        if !self.nodes.nodes.iter().any(takes_places) {
            return false;
        }
        self.taken.clear();
        self.taken.resize(view.cam2.phase.len(), FREE);
        self.set_places(view, drift, takes_places, |pixel| outside[pixel], TAKEN);
        self.set_places(view, drift, |node| node.is_within && node.is_clear(), |_| true, FREE);
        let width = view.cam2.width.max(1);
        let last = (view.cam2.phase.len() / width).saturating_sub(1);
        open.width = view.cam2.width;
        open.phase.resize(view.cam2.phase.len(), EpipolarImage::NO_PHASE);
        let rows = open.phase.par_chunks_mut(width).zip(view.cam2.phase.par_chunks(width)).enumerate();
        rows.for_each(|(row, (open, phase))| {
            let taken = std::array::from_fn(|i| {
                let row = (row + i).saturating_sub(2).min(last);
                &self.taken[row * width..(row + 1) * width]
            });
            fringeflow_simd::run(Level::in_use(), OpenRow { taken, phase, open });
        });
        true
    }

    /// Marks the places that some pixels of some nodes have in C2 by the orders of the nodes.
    fn set_places(
        &mut self,
        view: View<'_>,
        drift: &Drift,
        of_node: impl Fn(&Node) -> bool + Sync,
        of_pixel: impl Fn(usize) -> bool + Sync,
        to: u8,
    ) {
        let Self { runs, nodes, rows, taken, .. } = self;
        let (runs, nodes, width) = (&*runs, &*nodes, view.cam1.width);
        rows.par_iter_mut().enumerate().for_each(|(tile_row, scratch)| {
            scratch.taken.spans.clear();
            for v in nodes.rows_of_tiles(tile_row) {
                let label = |node: &Node| of_node(node).then_some(node.label);
                if nodes.fill_orders(runs, (v, width), label, &mut scratch.taken.orders) {
                    scratch.load_row(view, drift, v);
                    scratch.find_spans(view, nodes, v, &of_pixel);
                }
            }
        });
        let width = view.cam2.width;
        for span in rows.iter().flat_map(|scratch| &scratch.taken.spans) {
            let [begin, end] = [span.begin, span.end].map(|column| span.row as usize * width + column as usize);
            if let Some(places) = taken.get_mut(begin..end) {
                places.fill(to);
            }
        }
    }
}

impl RowScratch {
    /// Finds the places of the pixels of a row that have an order.
    fn find_spans(&mut self, view: View<'_>, nodes: &Nodes, v: usize, of_pixel: impl Fn(usize) -> bool) {
        let first = v * view.cam1.width;
        let Self { segments, drift, taken: TakenRow { orders, columns_px, spans }, .. } = self;
        columns_px.resize(orders.len(), NO_COLUMN_PX);
        let phase = &view.cam1.phase[first..first + view.cam1.width];
        fringeflow_simd::run(Level::in_use(), ColumnRow { segments, drift, phase, orders, columns_px });
        let last_px = (view.cam2.width - 1) as f32;
        for piece in nodes.row(v) {
            for pixel in (piece.begin as usize..piece.end as usize).filter(|&pixel| of_pixel(pixel)) {
                let (column_px, row_px) = (columns_px[pixel - first], segments.row_px[pixel - first]);
                if !(0.0..=last_px).contains(&column_px) {
                    continue;
                }
                let next = Span::new(row_px, column_px);
                if !spans.last_mut().is_some_and(|span| span.extend_by(next)) {
                    spans.push(next);
                }
            }
        }
    }
}

/// Finds the columns of C2 at which the pixels of a row see their orders.
struct ColumnRow<'a> {
    segments: &'a SegmentRow,
    drift: &'a DepthRow,
    phase: &'a [u16],
    orders: &'a [i16],
    columns_px: &'a mut [f32],
}

impl Kernel for ColumnRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { segments, drift, phase, orders, columns_px } = self;
        let blocks = orders.as_chunks::<LANES>().0.iter().zip(columns_px.as_chunks_mut::<LANES>().0);
        for (i, (orders, columns_px)) in blocks.enumerate() {
            if *orders == [NO_ORDER; LANES] {
                *columns_px = [NO_COLUMN_PX; LANES];
                continue;
            }
            let block = Block::new(lanes, segments, drift, phase, i * LANES);
            let order_columns = block.order_columns(orders);
            lanes.store_floats(block.columns_with_drift(&order_columns), columns_px);
            let has_order = lanes.bits(order_columns.has_order);
            for (k, column_px) in columns_px.iter_mut().enumerate() {
                *column_px = if has_order >> k & 1 == 1 { *column_px } else { NO_COLUMN_PX };
            }
        }
    }
}

/// Copies a row of C2 without the taken places.
struct OpenRow<'a> {
    /// The taken places of the row, and of two rows above and below.
    taken: [&'a [u8]; 5],
    phase: &'a [u16],
    open: &'a mut [u16],
}

impl Kernel for OpenRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { taken: [a, b, c, d, e], phase, open } = self;
        let width = open.len();
        let ([a, b, c, d, e], phase) =
            ([&a[..width], &b[..width], &c[..width], &d[..width], &e[..width]], &phase[..width]);
        open.copy_from_slice(phase);
        for u in 1..width.saturating_sub(1) {
            // b, c and d are the rows above, here and below. A free place counts as taken between taken ones above and
            // below.
            let mut taken = TAKEN;
            for u in [u - 1, u, u + 1] {
                taken &= (b[u] | a[u] & c[u]) & (c[u] | b[u] & d[u]) & (d[u] | c[u] & e[u]);
            }
            open[u] |= if taken == TAKEN { EpipolarImage::NO_PHASE } else { 0 };
        }
    }
}
