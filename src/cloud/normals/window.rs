//! The rows around one row of an image, arranged for the computation of normals.

use fringeflow_simd::LANES;

use super::PointImage;

/// Pixels to each side of the centre that a plane is fitted to.
pub(super) const REACH_PX: usize = 3;
/// Side of that square, pixels.
const SIDE: usize = 2 * REACH_PX + 1;
/// Number of pixels in that square.
pub(super) const COUNT: usize = SIDE * SIDE;
/// Maximum residual of the second fit, in standard deviations of noise and bend together.
pub(super) const MAX_DEVIATION: f32 = 3.0;

/// A pixel of the square, relative to its centre.
#[derive(Clone, Copy)]
pub(super) struct Offset {
    column: isize,
    row: isize,
    /// Index in [`OFFSETS`] of the pixel one step nearer to the centre.
    pub(super) inner: usize,
}

/// The pixels of the square: the centre first, then ring by ring outwards.
pub(super) const OFFSETS: [Offset; COUNT] = offsets();

const fn offsets() -> [Offset; COUNT] {
    let mut offsets = [Offset { column: 0, row: 0, inner: 0 }; COUNT];
    let (mut count, mut ring) = (1, 1);
    while ring <= REACH_PX as isize {
        let mut row = -ring;
        while row <= ring {
            let mut column = -ring;
            while column <= ring {
                if row.abs() == ring || column.abs() == ring {
                    let towards = [nearer(column, ring), nearer(row, ring)];
                    offsets[count] = Offset { column, row, inner: index_of(&offsets, count, towards) };
                    count += 1;
                }
                column += 1;
            }
            row += 1;
        }
        ring += 1;
    }
    offsets
}

const fn nearer(along: isize, ring: isize) -> isize {
    if along.abs() == ring { along - along.signum() } else { along }
}

const fn index_of(offsets: &[Offset; COUNT], count: usize, [column, row]: [isize; 2]) -> usize {
    let mut index = 0;
    while index + 1 < count && (offsets[index].column != column || offsets[index].row != row) {
        index += 1;
    }
    index
}

/// The rows around one row of an image, as arrays of numbers. NaN marks pixels without a point, as outside the image.
#[derive(Clone, Debug, Default)]
pub(super) struct Window {
    size_px: [usize; 2],
    /// Length of a row, with a margin on both sides.
    stride: usize,
    /// The image rows that the arrays hold, each counted from [`REACH_PX`] rows above the image, at its number modulo
    /// [`SIDE`].
    held: [Option<usize>; SIDE],
    /// The row in the middle.
    middle: usize,
    /// ρ and η of the ray `(ρ, η, 1)`.
    pub(super) rays: [Vec<f32>; 2],
    /// 1/m.
    pub(super) inverse_depth: Vec<f32>,
    /// Square of the largest deviation that noise explains, 1/m².
    pub(super) noise: Vec<f32>,
}

impl Window {
    /// Arranges the arrays for an image. They then hold no row.
    pub(super) fn arrange(&mut self, size_px: [usize; 2]) {
        self.held = [None; SIDE];
        if self.size_px == size_px {
            return;
        }
        self.size_px = size_px;
        self.stride = size_px[0].next_multiple_of(LANES) + 2 * REACH_PX;
        let Self { rays: [x, y], inverse_depth, noise, .. } = self;
        for plane in [x, y, inverse_depth, noise] {
            plane.clear();
            plane.resize(self.stride * SIDE, f32::NAN);
        }
    }

    /// Moves the window to a row of the image.
    pub(super) fn move_to(&mut self, points: &PointImage, row: usize) {
        self.middle = row;
        for above in row..row + SIDE {
            if self.held[above % SIDE] != Some(above) {
                self.held[above % SIDE] = Some(above);
                self.fill(points, above);
            }
        }
    }

    /// Reads the row `above - REACH_PX` of the image, which may lie outside.
    fn fill(&mut self, points: &PointImage, above: usize) {
        let [width, height] = self.size_px;
        let slot = (above % SIDE) * self.stride;
        let Some(row) = above.checked_sub(REACH_PX).filter(|&row| row < height) else {
            self.inverse_depth[slot..][..self.stride].fill(f32::NAN);
            return;
        };
        let pixels = &points.pixels[row * width..][..width];
        let first = slot + REACH_PX;
        let [rho, eta] = self.rays.each_mut().map(|plane| &mut plane[first..][..width]);
        let inverse = &mut self.inverse_depth[first..][..width];
        let noise = &mut self.noise[first..][..width];
        for (u, [x, y, z, sigma_m]) in pixels.iter().enumerate() {
            let inverse_depth = 1.0 / z;
            rho[u] = x * inverse_depth;
            eta[u] = y * inverse_depth;
            inverse[u] = inverse_depth;
            let deviation = MAX_DEVIATION * sigma_m * inverse_depth * inverse_depth;
            noise[u] = deviation * deviation;
        }
    }

    /// Returns for each pixel of the square the index in the arrays that belongs to the first column.
    pub(super) fn starts(&self) -> [usize; COUNT] {
        OFFSETS.map(|Offset { column, row, .. }| {
            let slot = (self.middle + REACH_PX).wrapping_add_signed(row) % SIDE;
            (slot * self.stride + REACH_PX).wrapping_add_signed(column)
        })
    }
}
