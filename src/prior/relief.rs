//! Coarse depth map of camera 1. In: points. Out: the mean inverse depth of each square of 16 × 16 pixels.

/// Side of a cell, pixels.
pub const CELL_PX: usize = 16;
/// Inverse depth of one unit, 1/m. Covers depths from 33 mm; resolves 0.04 mm at 0.3 m.
const UNIT_PER_M: f64 = 30.0 / 65535.0;

/// Coarse depth map: mean inverse depths of cells of [`CELL_PX`] × [`CELL_PX`] pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Relief {
    size_px: [usize; 2],
    /// Units of [`UNIT_PER_M`], row by row; 0 where nothing was seen.
    cells: Vec<u16>,
}

impl Relief {
    /// Columns and rows of cells in an image of this size.
    #[must_use]
    pub fn cell_counts(size_px: [usize; 2]) -> [usize; 2] {
        size_px.map(|length| length.div_ceil(CELL_PX))
    }

    /// The map of points, given by their pixel of C1 (column, row) and depth in metres.
    #[must_use]
    pub fn from_points(size_px: [usize; 2], points: impl Iterator<Item = ([u16; 2], f32)>) -> Self {
        let [columns, rows] = Self::cell_counts(size_px);
        let mut sums = vec![(0.0, 0u32); columns * rows];
        points.for_each(|([u, v], depth_m)| {
            let [u, v] = [u, v].map(usize::from);
            let is_seen = u < size_px[0] && v < size_px[1] && depth_m > 0.0;
            if let Some((sum, count)) = sums.get_mut(v / CELL_PX * columns + u / CELL_PX).filter(|_| is_seen) {
                *sum += 1.0 / f64::from(depth_m);
                *count += 1;
            }
        });
        let cell = |(sum, count): (f64, u32)| (sum / f64::from(count.max(1)) / UNIT_PER_M).round() as u16;
        Self { size_px, cells: sums.into_iter().map(cell).collect() }
    }

    /// A map of cells as [`Self::cells`] returns them; `None` if their number does not fit the size of the image.
    #[must_use]
    pub fn from_cells(size_px: [usize; 2], cells: Vec<u16>) -> Option<Self> {
        let [columns, rows] = Self::cell_counts(size_px);
        (cells.len() == columns * rows).then_some(Self { size_px, cells })
    }

    /// Width and height of the image, pixels.
    #[must_use]
    pub fn size_px(&self) -> [usize; 2] {
        self.size_px
    }

    /// All cells, row by row.
    #[must_use]
    pub fn cells(&self) -> &[u16] {
        &self.cells
    }

    /// Centre (column, row; pixels) and mean depth (metres) of squares of `side` × `side` cells that hold any point.
    pub(super) fn square_depths(&self, side: usize) -> impl Iterator<Item = ([f64; 2], f64)> + '_ {
        let [columns, rows] = Self::cell_counts(self.size_px);
        let squares = (0..rows).step_by(side).flat_map(move |row| (0..columns).step_by(side).map(move |c| [c, row]));
        squares.filter_map(move |[column, row]| {
            let (mut sum, mut middle, mut count) = (0.0, [0.0; 2], 0.0);
            for v in row..(row + side).min(rows) {
                for u in column..(column + side).min(columns) {
                    let cell = self.cells[v * columns + u];
                    if cell > 0 {
                        sum += f64::from(cell);
                        count += 1.0;
                        for (middle, place) in middle.iter_mut().zip([u, v]) {
                            *middle += (place * CELL_PX) as f64 + 0.5 * (CELL_PX as f64 - 1.0);
                        }
                    }
                }
            }
            (count > 0.0).then(|| (middle.map(|sum| sum / count), count / (sum * UNIT_PER_M)))
        })
    }
}
