//! Kernels over 32 pixels of a row at once: *confirm*, *matching cost* and *selection*. They give the results of
//! [`crate::correspondence::pixel_search`] bit for bit, at every SIMD level.
//!
//! Every operation is that of the scalar form, in its order. Pixels that a kernel cannot handle are *irregular* and
//! left to the scalar form: Φ that hardly changes or reaches its pole, wide intervals, intervals at the border of the
//! image.

mod confirm;
mod matching_cost;
mod pixels;
mod selection;

use fringeflow_simd::Lanes;

use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::kernels::{BLOCK, Rows, block_of};

pub(super) use matching_cost::{BestBlock, CostScratch, OrderBlock};
use pixels::Pixels;
pub(super) use pixels::Row;
pub(super) use selection::{REACH_SD, REACH_TURNS, RIM_COLUMNS, SelectedBlock, SelectionScratch};

/// A block of pixels, prepared for searches of their orders.
pub(super) struct Block<'a, L: Lanes> {
    lanes: L,
    image: &'a EpipolarImage,
    pixels: Pixels<L>,
    rows: Rows<L>,
    phases: L::Words,
    /// Pixels that the kernels handle.
    regular: L::Mask,
    /// Pixels left to the scalar form.
    irregular: L::Mask,
}

impl<'a> Row<'a> {
    /// The block that begins with pixel `first`; `count` is the number of orders of each pixel. `None` if no pixel has
    /// any.
    #[inline(always)]
    pub(super) fn block<L: Lanes>(&self, lanes: L, first: usize, count: &[u8; BLOCK]) -> Option<Block<'a, L>> {
        if *count == [0; BLOCK] {
            return None;
        }
        let wanted = lanes.is_greater(lanes.words_of_bytes(count), lanes.word(0));
        let (pixels, regular) = Pixels::new(lanes, self, first);
        let (rows, in_rows) = Rows::new(lanes, self.image, pixels.segments.row, lanes.and(wanted, regular));
        let regular = lanes.and(lanes.and(wanted, regular), in_rows);
        let phases = lanes.load(block_of(self.phase, first));
        let irregular = lanes.and_not(wanted, regular);
        Some(Block { lanes, image: self.image, pixels, rows, phases, regular, irregular })
    }
}

impl<L: Lanes> Block<'_, L> {
    /// Leaves pixels to the scalar form.
    #[inline(always)]
    fn leave_to_scalar(&mut self, pixels: L::Mask) {
        self.irregular = self.lanes.or(self.irregular, pixels);
        self.regular = self.lanes.and_not(self.regular, pixels);
    }

    /// Pixels that the kernels handle, a bit each.
    #[inline(always)]
    pub(super) fn regular(&self) -> u32 {
        self.lanes.bits(self.regular)
    }

    /// Pixels left to the scalar form, a bit each.
    #[inline(always)]
    pub(super) fn irregular(&self) -> u32 {
        if self.lanes.any(self.irregular) { self.lanes.bits(self.irregular) } else { 0 }
    }
}
