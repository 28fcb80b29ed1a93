//! Where in the image decisions have changed, so that nobody is asked twice about what stayed as it was.

use super::super::neighbourhood::Reach;

/// Side of a tile, pixels: no walk leads beyond the tiles beside its own.
const SIDE: usize = Reach::Far as usize;

/// The tiles of an image, those marked in which a decision changed.
#[derive(Clone, Debug)]
pub(super) struct ChangedTiles {
    marked: Vec<bool>,
    width_px: usize,
    /// Tiles side by side, one more than the image has on either side.
    across: usize,
}

impl ChangedTiles {
    /// The tiles of an image of so many pixels a row and in all, all or none of them marked.
    pub(super) fn new(width_px: usize, pixels: usize, marked: bool) -> Self {
        let across = width_px.div_ceil(SIDE) + 2;
        let down = pixels.div_ceil(width_px.max(1)).div_ceil(SIDE) + 2;
        Self { marked: vec![marked; across * down], width_px, across }
    }

    /// Forgets all marks.
    pub(super) fn clear(&mut self) {
        self.marked.fill(false);
    }

    /// Marks the tile of a pixel.
    #[inline]
    pub(super) fn mark(&mut self, pixel: usize) {
        let tile = self.tile_of(pixel);
        self.marked[tile] = true;
    }

    /// Whether a walk from a pixel may meet a decision that changed.
    #[inline]
    pub(super) fn reach(&self, pixel: usize) -> bool {
        let tile = self.tile_of(pixel);
        [tile, tile - 1, tile + 1, tile - self.across, tile + self.across].into_iter().any(|t| self.marked[t])
    }

    #[inline]
    fn tile_of(&self, pixel: usize) -> usize {
        let (u, v) = (pixel % self.width_px, pixel / self.width_px);
        (v / SIDE + 1) * self.across + u / SIDE + 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_a_walk_can_bring_to_a_change_is_reached() {
        let (width, height) = (50, 40);
        for changed in [0, 17 * width + 33, height * width - 1] {
            let mut tiles = ChangedTiles::new(width, width * height, false);
            tiles.mark(changed);
            let (u, v) = (changed % width, changed / width);
            for pixel in 0..width * height {
                let (du, dv) = ((pixel % width).abs_diff(u), (pixel / width).abs_diff(v));
                let on_a_walk = (du == 0 && dv <= SIDE) || (dv == 0 && du <= SIDE);
                assert!(!on_a_walk || tiles.reach(pixel), "{changed} {pixel}");
                assert!(du + dv < 4 * SIDE || !tiles.reach(pixel), "{changed} {pixel}");
            }
        }
        assert!((0..width * height).all(|p| ChangedTiles::new(width, width * height, true).reach(p)));
    }
}
