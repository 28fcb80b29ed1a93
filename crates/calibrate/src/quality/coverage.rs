//! Which parts of a device's image the board has covered.

use fringeflow::geometry::Pixel;

/// Cells across and down.
pub const CELLS: [usize; 2] = [8, 6];

/// Number of points of the board in each cell of an image, row by row.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Coverage {
    /// `CELLS[0] · CELLS[1]` numbers.
    pub counts: Vec<usize>,
}

impl Coverage {
    /// Counts the points of an image of `size_px` (width, height).
    #[must_use]
    pub fn of(points: impl Iterator<Item = Pixel>, size_px: [usize; 2]) -> Self {
        let mut counts = vec![0; CELLS[0] * CELLS[1]];
        for pixel in points {
            let cell = |position: f64, size: usize, cells: usize| {
                let share = (position + 0.5) / size as f64;
                ((share * cells as f64) as usize).min(cells - 1)
            };
            let [i, j] = [cell(pixel.x, size_px[0], CELLS[0]), cell(pixel.y, size_px[1], CELLS[1])];
            counts[j * CELLS[0] + i] += 1;
        }
        Self { counts }
    }

    /// Share of the cells that hold a point.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.counts.iter().filter(|&&count| count > 0).count() as f64 / self.counts.len() as f64
    }
}
