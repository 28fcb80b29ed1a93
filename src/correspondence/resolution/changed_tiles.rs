//! Where in the image decisions have changed, so that nobody is asked twice about what stayed as it was.

use super::continuity::FAR;
use super::grid::Grid;
use super::opinions::Directions;

/// Rows of a tile, which is a block wide: no walk leads beyond the tiles beside its own.
const ROWS: usize = FAR as usize + 1;

/// The tiles of an image, those marked in which a decision changed.
#[derive(Clone, Debug)]
pub(super) struct ChangedTiles {
    marked: Vec<bool>,
    /// Blocks of a row, margins included.
    blocks: usize,
}

impl ChangedTiles {
    /// The tiles of an image, all or none of them marked.
    pub(super) fn new(grid: Grid, marked: bool) -> Self {
        // A row of tiles more above and below.
        let rows = (grid.all_blocks() / grid.blocks).div_ceil(ROWS) + 2;
        Self { marked: vec![marked; rows * grid.blocks], blocks: grid.blocks }
    }

    /// Marks the tile of a block.
    #[inline]
    pub(super) fn mark(&mut self, block: usize) {
        let tile = self.tile_of(block);
        self.marked[tile] = true;
    }

    /// Whether a walk from a block of the image may meet a decision that changed.
    #[inline]
    pub(super) fn reach(&self, block: usize) -> bool {
        let tile = self.tile_of(block);
        [tile, tile - 1, tile + 1, tile - self.blocks, tile + self.blocks].into_iter().any(|t| self.marked[t])
    }

    #[inline]
    fn tile_of(&self, block: usize) -> usize {
        (block / self.blocks / ROWS + 1) * self.blocks + block % self.blocks
    }
}

/// Where decisions changed since each kind of their neighbours were last asked.
pub(super) struct Unheard {
    /// Open pixels, along the epipolar direction.
    along: ChangedTiles,
    /// Open pixels, across it too.
    across: ChangedTiles,
    /// Decided pixels, for contradictions.
    pub(super) by_decided: ChangedTiles,
}

impl Unheard {
    /// Nobody has been asked yet.
    pub(super) fn all(grid: Grid) -> Self {
        let all = ChangedTiles::new(grid, true);
        Self { along: all.clone(), across: all.clone(), by_decided: all }
    }

    pub(super) fn mark(&mut self, block: usize) {
        self.along.mark(block);
        self.across.mark(block);
        self.by_decided.mark(block);
    }

    pub(super) fn of(&mut self, directions: Directions) -> &mut ChangedTiles {
        match directions {
            Directions::Along => &mut self.along,
            Directions::AlongAndAcross => &mut self.across,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::simd::LANES;

    use super::*;

    #[test]
    fn whoever_a_walk_can_bring_to_a_change_is_reached() {
        let (width, height) = (150, 60);
        let grid = Grid::new([width, height]);
        let block = |u: usize, v: usize| grid.place(v * width + u) / LANES;
        for (u, v) in [(0, 0), (33, 17), (width - 1, height - 1)] {
            let mut tiles = ChangedTiles::new(grid, false);
            tiles.mark(block(u, v));
            for (of_u, of_v) in (0..width).flat_map(|u| (0..height).map(move |v| (u, v))) {
                let (du, dv) = (of_u.abs_diff(u), of_v.abs_diff(v));
                let on_a_walk = (du == 0 && dv <= FAR as usize) || (dv == 0 && du <= FAR as usize);
                let reached = tiles.reach(block(of_u, of_v));
                assert!(!on_a_walk || reached, "{u} {v}: {of_u} {of_v}");
                assert!(du < 2 * LANES && dv < 2 * ROWS || !reached, "{u} {v}: {of_u} {of_v}");
            }
        }
        assert!(ChangedTiles::new(grid, true).reach(block(7, 7)));
    }
}
