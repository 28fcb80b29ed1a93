//! Planes: images with a margin on all sides, in blocks of [`LANES`] pixels. Code that looks beside a block needs no
//! test for the ends of rows.

use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};

use rayon::prelude::*;

use fringeflow_simd::LANES;

/// Rows above and below the image that can be read.
const MARGIN_ROWS: usize = 3;
/// Enough for images of 2^16 × 2^16 pixels: the blocks of a row times all blocks fit.
const RECIPROCAL_BITS: u32 = 39;

/// The layout of such planes: where each pixel has its place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Grid {
    width: usize,
    height: usize,
    /// Blocks of a row, including one of margin on either side.
    pub(super) blocks: usize,
    /// 2^[`RECIPROCAL_BITS`] / `blocks`, rounded up. Multiplying by it is much faster than a division.
    reciprocal: u64,
}

impl Grid {
    pub(super) fn new([width, height]: [usize; 2]) -> Self {
        let blocks = width.div_ceil(LANES) + 2;
        Self { width, height, blocks, reciprocal: (1_u64 << RECIPROCAL_BITS).div_ceil(blocks as u64) }
    }

    /// Places from one row to the next.
    #[inline]
    pub(super) fn stride(self) -> usize {
        self.blocks * LANES
    }

    /// Places of all rows.
    #[cfg(test)]
    pub(super) fn places(self) -> usize {
        self.all_blocks() * LANES
    }

    /// Blocks of all rows.
    pub(super) fn all_blocks(self) -> usize {
        self.blocks * (self.height + 2 * MARGIN_ROWS)
    }

    /// Blocks of the image in row `v`.
    pub(super) fn blocks_of_row(self, v: usize) -> std::ops::Range<usize> {
        let first = (v + MARGIN_ROWS) * self.blocks + 1;
        first..first + self.blocks - 2
    }

    /// Blocks of the image, row by row.
    pub(super) fn blocks_of_image(self) -> impl Iterator<Item = usize> {
        (0..self.height).flat_map(move |v| self.blocks_of_row(v))
    }

    /// Place of the first pixel of a row.
    #[inline]
    pub(super) fn row(self, v: usize) -> usize {
        (v + MARGIN_ROWS) * self.stride() + LANES
    }

    /// Place of a pixel, counted row by row.
    #[cfg(test)]
    pub(super) fn place(self, pixel: usize) -> usize {
        self.row(pixel / self.width) + pixel % self.width
    }

    /// Column and row of a place in the image.
    #[inline]
    pub(super) fn column_and_row(self, place: usize) -> [usize; 2] {
        let row = self.row_with_margin(place);
        [place - row * self.stride() - LANES, row - MARGIN_ROWS]
    }

    /// The pixel of a place in the image, counted row by row.
    #[inline]
    pub(super) fn pixel(self, place: usize) -> usize {
        let row = self.row_with_margin(place);
        place - row * self.stride() - LANES + (row - MARGIN_ROWS) * self.width
    }

    /// Row of a place, counted from the first row of the margin.
    #[inline]
    fn row_with_margin(self, place: usize) -> usize {
        (((place / LANES) as u64 * self.reciprocal) >> RECIPROCAL_BITS) as usize
    }

    /// The rows of the image without the margin above and below, with the margins left and right.
    pub(super) fn rows<T>(self, plane: &mut [T]) -> &mut [T] {
        let row = plane.len() / (self.height + 2 * MARGIN_ROWS);
        &mut plane[MARGIN_ROWS * row..(MARGIN_ROWS + self.height) * row]
    }

    /// As [`Self::rows`], read only.
    pub(super) fn rows_of<T>(self, plane: &[T]) -> &[T] {
        let row = plane.len() / (self.height + 2 * MARGIN_ROWS);
        &plane[MARGIN_ROWS * row..(MARGIN_ROWS + self.height) * row]
    }

    /// For each row of the image the values of it and of `reach` rows above and below. `rows` holds a value per row,
    /// including the rows of the margin.
    pub(super) fn rows_around<T: Sync>(self, rows: &[T], reach: usize) -> impl IndexedParallelIterator<Item = &[T]> {
        (MARGIN_ROWS..MARGIN_ROWS + self.height)
            .into_par_iter()
            .map(move |row| &rows[row.saturating_sub(reach)..rows.len().min(row + reach + 1)])
    }

    pub(super) fn width(self) -> usize {
        self.width
    }

    pub(super) fn height(self) -> usize {
        self.height
    }
}

/// A plane of 16-bit words, each block in one cache line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plane<T> {
    blocks: Vec<Block>,
    words: PhantomData<T>,
}

/// Words of a block.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
struct Block([u16; LANES]);

impl<T> Plane<T> {
    /// A plane of zeros.
    pub(super) fn new(grid: Grid) -> Self {
        Self { blocks: vec![Block([0; LANES]); grid.all_blocks()], words: PhantomData }
    }
}

impl<T> Default for Plane<T> {
    fn default() -> Self {
        Self::new(Grid::default())
    }
}

impl<T: bytemuck::Pod> Deref for Plane<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        bytemuck::cast_slice(&self.blocks)
    }
}

impl<T: bytemuck::Pod> DerefMut for Plane<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        bytemuck::cast_slice_mut(&mut self.blocks)
    }
}

/// Words of a plane from a place on.
#[inline(always)]
pub(super) fn words<T: bytemuck::Pod>(plane: &[T], place: usize) -> &[u16; LANES] {
    let words: &[u16] = bytemuck::cast_slice(plane);
    match words[place..].first_chunk() {
        Some(words) => words,
        None => &[0; LANES],
    }
}

/// The 32 bits from `place` on, of a plane with a bit per place.
#[inline(always)]
pub(super) fn bits_from(plane: &[u32], place: usize) -> u32 {
    let (block, first) = (place / LANES, place % LANES);
    let both = u64::from(plane[block]) | u64::from(plane[block + 1]) << 32;
    (both >> first) as u32
}

/// The bit of a place.
#[inline(always)]
pub(super) fn bit(plane: &[u32], place: usize) -> bool {
    plane[place / LANES] >> (place % LANES) & 1 == 1
}

/// The numbers of the bits that are set, in ascending order.
pub(super) fn ones(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let first = bits.trailing_zeros() as usize;
        let next = bits & bits.wrapping_sub(1);
        let has = std::mem::replace(&mut bits, next) != 0;
        has.then_some(first)
    })
}

/// The places of a block whose bits are set.
pub(super) fn places_of(block: usize, bits: u32) -> impl Iterator<Item = usize> {
    ones(bits).map(move |k| block * LANES + k)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_has_a_place_with_room_around() {
        let grid = Grid::new([70, 5]);
        let large = Grid::new([0xffff, 0xffff]);
        for v in [0, 1, 0x7fff, 0xfffe] {
            assert_eq!(large.pixel(large.row(v)), v * 0xffff);
            assert_eq!(large.pixel(large.row(v) + 0xfffe), v * 0xffff + 0xfffe);
        }
        for pixel in 0..70 * 5 {
            let place = grid.place(pixel);
            assert_eq!(grid.pixel(place), pixel);
            assert_eq!(grid.column_and_row(place), [pixel % 70, pixel / 70]);
            assert!(place >= 3 * grid.stride() + LANES);
            assert!(place + 3 * grid.stride() + LANES < grid.places());
        }
    }

    #[test]
    fn bits_are_read_across_blocks() {
        let plane = [0x8000_0001, 0x0000_0003, 0];
        assert_eq!(bits_from(&plane, 31), 0b111);
        assert!(bit(&plane, 33) && !bit(&plane, 34));
        assert_eq!(ones(plane[0]).collect::<Vec<_>>(), [0, 31]);
    }
}
