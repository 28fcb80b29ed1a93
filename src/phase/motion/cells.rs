//! Sums over the surroundings of a pixel, which share one motion. In: moments of pixels. Out: their sums over
//! 3 × 3 cells of 2 × 2 pixels. Cost: some three operations per pixel and moment.
//!
//! A *strip* is four rows of pixels, two rows of cells. The cells of 32 × 4 pixels fill the lanes: first 16 cells of
//! the upper row, then 16 of the lower one.

use fringeflow_simd::{HALF, Lanes};

/// Side of a cell, pixels, and rows of pixels in a strip.
pub(super) const CELL: usize = 2;
pub(super) const STRIP_ROWS: usize = 2 * CELL;
/// Cells on either side of a row, without moments.
const MARGIN: usize = 1;

/// Sums of products of z and z'.
#[derive(Clone, Copy)]
pub(super) struct Moments<L: Lanes> {
    /// |z|².
    pub(super) power: L::Reals,
    /// z².
    pub(super) square: [L::Reals; 2],
    /// Im(z'·z*).
    pub(super) slope: L::Reals,
    /// z'·z.
    pub(super) product: [L::Reals; 2],
}

/// Number of real moments.
const MOMENTS: usize = 6;

impl<L: Lanes> Moments<L> {
    #[inline(always)]
    fn to_array(self) -> [L::Reals; MOMENTS] {
        let Self { power, square: [square_re, square_im], slope, product: [product_re, product_im] } = self;
        [power, square_re, square_im, slope, product_re, product_im]
    }

    #[inline(always)]
    fn from_array([power, square_re, square_im, slope, product_re, product_im]: [L::Reals; MOMENTS]) -> Self {
        Self { power, square: [square_re, square_im], slope, product: [product_re, product_im] }
    }

    /// Moments of nothing.
    #[inline(always)]
    pub(super) fn zero(lanes: L) -> Self {
        Self::from_array([lanes.real(0.0); MOMENTS])
    }

    #[inline(always)]
    pub(super) fn plus(self, lanes: L, other: Self) -> Self {
        let (mut sums, others) = (self.to_array(), other.to_array());
        let mut k = 0;
        while k < MOMENTS {
            sums[k] = lanes.add_real(sums[k], others[k]);
            k += 1;
        }
        Self::from_array(sums)
    }

    /// The moments if z' were greater by `i·motion_rad·z`.
    #[inline(always)]
    pub(super) fn turned(self, lanes: L, motion_rad: f32) -> Self {
        let (l, motion_rad) = (lanes, lanes.real(motion_rad));
        let [square_re, square_im] = self.square;
        Self {
            slope: l.add_real(self.slope, l.times_real(motion_rad, self.power)),
            product: [
                l.sub_real(self.product[0], l.times_real(motion_rad, square_im)),
                l.add_real(self.product[1], l.times_real(motion_rad, square_re)),
            ],
            ..self
        }
    }
}

/// Moments of the cells of a strip.
#[derive(Clone, Debug, Default)]
pub(super) struct StripCells {
    /// Upper and lower row of cells, by moment.
    rows: [[Vec<f32>; MOMENTS]; 2],
}

impl StripCells {
    /// Clears the cells of `blocks` blocks.
    pub(super) fn clear(&mut self, blocks: usize) {
        for cells in self.rows.as_flattened_mut() {
            cells.clear();
            cells.resize(blocks * HALF + 2 * MARGIN, 0.0);
        }
    }

    /// Sets the cells of a block in the upper or lower row from the sums of the moments of its two rows of pixels.
    #[inline(always)]
    pub(super) fn set<L: Lanes>(&mut self, lanes: L, [row, block]: [usize; 2], sums: Moments<L>, expected_rad: f32) {
        // Neighbours may follow another motion. Only deviations from the expected motion are comparable.
        let sums = sums.turned(lanes, -expected_rad).to_array();
        let begin = MARGIN + block * HALF;
        let (pairs, _) = self.rows[row].as_chunks_mut::<2>();
        let mut k = 0;
        while k < MOMENTS / 2 {
            let [first, second] = &mut pairs[k];
            if let (Some(first), Some(second)) = (first[begin..].first_chunk_mut(), second[begin..].first_chunk_mut()) {
                lanes.store_halves(lanes.pair_sums(sums[2 * k], sums[2 * k + 1]), first, second);
            }
            k += 1;
        }
    }
}

/// Sums of the moments over the 3 × 3 cells around each cell of a block of a strip, which lies between two others.
#[inline(always)]
pub(super) fn sums_around<L: Lanes>(
    lanes: L,
    [above, strip, below]: [&StripCells; 3],
    block: usize,
    expected_rad: f32,
) -> Moments<L> {
    let l = lanes;
    let mut sums = [l.real(0.0); MOMENTS];
    let mut k = 0;
    while k < MOMENTS {
        let (upper, lower) = (&strip.rows[0][k], &strip.rows[1][k]);
        let (over, under) = (&above.rows[1][k], &below.rows[0][k]);
        let mut column = 0;
        while column < 2 * MARGIN + 1 {
            let begin = block * HALF + column;
            // The own row of each cell, the row over it and the row under it.
            let around = l.add_real(cells(l, [over, upper], begin), cells(l, [lower, under], begin));
            sums[k] = l.add_real(sums[k], l.add_real(cells(l, [upper, lower], begin), around));
            column += 1;
        }
        k += 1;
    }
    Moments::from_array(sums).turned(l, expected_rad)
}

/// The cells of two rows, from `begin` on.
#[inline(always)]
fn cells<L: Lanes>(lanes: L, [first, second]: [&[f32]; 2], begin: usize) -> L::Reals {
    match (first[begin..].first_chunk(), second[begin..].first_chunk()) {
        (Some(first), Some(second)) => lanes.load_halves(first, second),
        // The rows hold all cells of their blocks.
        _ => lanes.real(0.0),
    }
}
