//! Which columns of a row of pixels are wanted, in blocks as wide as the patches of the segment table.

use std::ops::Range;

use super::patches::PATCH_PX;

/// The wanted blocks of a row of pixels.
#[derive(Clone, Debug, Default)]
pub(super) struct WantedBlocks(Vec<bool>);

impl WantedBlocks {
    /// Wants no column of a row of `width` pixels.
    pub(super) fn reset(&mut self, width: usize) {
        self.0.clear();
        self.0.resize(width.div_ceil(PATCH_PX), false);
    }

    /// Wants the blocks of a range of columns.
    pub(super) fn want(&mut self, columns: Range<usize>) {
        self.0[columns.start / PATCH_PX..columns.end.div_ceil(PATCH_PX)].fill(true);
    }

    /// Whether any block is wanted.
    pub(super) fn any(&self) -> bool {
        self.0.contains(&true)
    }

    /// For each block whether it is wanted.
    pub(super) fn blocks(&self) -> &[bool] {
        &self.0
    }
}
