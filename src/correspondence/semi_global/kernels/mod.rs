//! Evidence and selection of 32 pixels of a row at once: what [`super::outlook`] says of each, bit for bit, at every level.
//!
//! Every operation is that of the scalar form, single and in its order. Pixels of which more cannot be said are *irregular*, and
//! left to it: Φ that hardly changes or runs into its pole, intervals of many columns or at the border of the image.

mod look;
mod matching_cost;
mod pixels;
mod selection;

use fringeflow_simd::Lanes;

use crate::correspondence::drift::DepthRow;
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::kernels::{BLOCK, Rows, block_of};
use crate::correspondence::segment::SegmentRow;

use super::order_ranges::Reach;

pub(super) use matching_cost::{BestOfBlock, EvidenceScratch, OrdersOfBlock};
use pixels::Pixels;
pub(super) use selection::SelectionScratch;

/// A row of pixels and what it is searched in.
#[derive(Clone, Copy)]
pub(super) struct Row<'a> {
    pub(super) image: &'a EpipolarImage,
    pub(super) segments: &'a SegmentRow,
    pub(super) drift: &'a DepthRow,
    pub(super) reach: Reach,
    pub(super) phase: &'a [u16],
    /// sd of δ of each pixel, turns.
    pub(super) sd_turns: &'a [f32],
}

/// Pixels of a row from a column on, made ready to be asked about their orders.
pub(super) struct Block<'a, L: Lanes> {
    lanes: L,
    image: &'a EpipolarImage,
    pixels: Pixels<L>,
    rows: Rows<L>,
    phases: L::Words,
    /// Pixels that are asked about.
    regular: L::Mask,
    /// Pixels left to the scalar form.
    irregular: L::Mask,
}

impl<'a> Row<'a> {
    /// The pixels from `first` on, which have so many orders each; `None` if none has any.
    #[inline(always)]
    pub(super) fn block<L: Lanes>(&self, lanes: L, first: usize, count: &[u8; BLOCK]) -> Option<Block<'a, L>> {
        if *count == [0; BLOCK] {
            return None;
        }
        let wanted = lanes.is_greater(lanes.words_of_bytes(count), lanes.word(0));
        let (pixels, regular) = Pixels::of(lanes, self, first);
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
    fn give_up(&mut self, pixels: L::Mask) {
        self.irregular = self.lanes.or(self.irregular, pixels);
        self.regular = self.lanes.and_not(self.regular, pixels);
    }

    /// Pixels that are asked about here, a bit each.
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
