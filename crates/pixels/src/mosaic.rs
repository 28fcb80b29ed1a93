//! Grey levels of a Bayer mosaic at full size.
//!
//! ```text
//! for each row y of the region:
//!     hold the values of the rows y − 1, y, y + 1 as 16-bit numbers, with one more pixel at both ends
//!     weighted:  c[x] = above[x] + 2 row[x] + below[x];   grey[x] = c[x − 1] + 2 c[x] + c[x + 1]
//!     green:     grey[x] = 4 row[x] if x is green, else row[x − 1] + row[x + 1] + above[x] + below[x]
//! ```
//!
//! A grey level of which a value is saturated is the largest one, so that it counts as saturated too.
//!
//! A row or column outside the image is replaced by the one two further in, which has the same colours. Each row of the
//! camera is unpacked once. Memory: a few rows.

use std::ops::Add;

use fringeflow::geometry::Readout;
use fringeflow_base::grey::PixelFormat;

use super::bayer::{BayerGrey, BayerOrder};
use super::rows::Row;

/// Number of rows that contribute to a grey level.
const HELD_ROWS: usize = 3;
/// Pixels that are added at each end of a row.
const END_PX: usize = 1;

/// Where the values of a mosaic are stored.
#[derive(Clone, Copy)]
pub(super) struct MosaicSource<'a> {
    /// The bytes, from the first row of the view on.
    pub(super) bytes: &'a [u8],
    /// Bytes from one row to the next.
    pub(super) stride_bytes: usize,
    /// Format of the values in memory.
    pub(super) samples: PixelFormat,
    /// The conversion of a row to that format; `None` if the rows are stored in it.
    pub(super) unpack: Option<Row>,
}

/// Rows of a mosaic, for interpolation.
#[derive(Clone, Debug, Default)]
pub(super) struct MosaicRows {
    /// Row `y` of the view is at index `y % HELD_ROWS`, if it is held.
    held: [HeldRow; HELD_ROWS],
    unpacked: Vec<u8>,
    /// The largest of the three values of each column.
    peaks: Vec<u16>,
    narrow_sums: Vec<u16>,
    wide_sums: Vec<u32>,
    /// All bits set where a column is green, in turn.
    is_green: Vec<u16>,
}

#[derive(Clone, Debug, Default)]
struct HeldRow {
    number: Option<usize>,
    values: Vec<u16>,
}

impl MosaicRows {
    /// Writes the grey levels of the region of `readout` to `out`, in rows without gaps, as 16-bit numbers. The view
    /// has the size of the sensor of `readout`; both its sides are at least 2. The caller has checked the sizes.
    pub(super) fn interpolate(
        &mut self,
        source: MosaicSource<'_>,
        readout: &Readout,
        grey: BayerGrey,
        order: BayerOrder,
        out: &mut [u8],
    ) {
        let ([x, y, width, _], [view_width, view_height]) = (readout.region(), readout.sensor_px());
        self.held.iter_mut().for_each(|row| row.number = None);
        self.is_green.clear();
        self.is_green.extend((0..=width).map(|column| if column % 2 == 0 { u16::MAX } else { 0 }));
        for (y, out) in (y..).zip(out.chunks_exact_mut((2 * width).max(1))) {
            let above = if y == 0 { 1 } else { y - 1 };
            let below = if y + 1 == view_height { y - 1 } else { y + 1 };
            for number in [above, y, below] {
                self.hold(number, source, view_width);
            }
            let rows = [above, y, below].map(|number| &self.held[number % HELD_ROWS].values[x..][..width + 2 * END_PX]);
            let is_green = &self.is_green[usize::from(!order.is_green(x, y))..][..width];
            let (out, most) = (out.as_chunks_mut().0, source.samples.max_value());
            let Self { peaks, narrow_sums, wide_sums, .. } = self;
            match (grey, source.samples) {
                (BayerGrey::Green, PixelFormat::Y16) => {
                    green(rows, is_green, most, out, |sum: u32| ((sum + 2) >> 2) as u16);
                }
                (BayerGrey::Green, _) => green(rows, is_green, most, out, |sum: u16| sum),
                (_, PixelFormat::Y16) => weighted(rows, most, peaks, wide_sums, out, |sum| ((sum + 8) >> 4) as u16),
                (_, PixelFormat::Y14) => weighted(rows, most, peaks, wide_sums, out, |sum| ((sum + 2) >> 2) as u16),
                _ => weighted(rows, most, peaks, narrow_sums, out, |sum| sum),
            }
        }
    }

    /// Makes a row of the view available as numbers.
    fn hold(&mut self, number: usize, source: MosaicSource<'_>, width: usize) {
        let row = &mut self.held[number % HELD_ROWS];
        if row.number.replace(number) == Some(number) {
            return;
        }
        let mut bytes = source.bytes.get(number * source.stride_bytes..).unwrap_or_default();
        let row_bytes = width * source.samples.bytes();
        if let Some(unpack) = source.unpack {
            self.unpacked.resize(row_bytes, 0);
            unpack(bytes, &mut self.unpacked);
            bytes = &self.unpacked;
        }
        let bytes = &bytes[..row_bytes];
        let values = &mut row.values;
        values.clear();
        values.push(0);
        match source.samples {
            PixelFormat::Grey => values.extend(bytes.iter().map(|&byte| u16::from(byte))),
            // Bits beyond the depth, which a camera should not set, must not make the sums overflow.
            deep => {
                let most = deep.max_value();
                values.extend(bytes.as_chunks().0.iter().map(|&value| u16::from_le_bytes(value).min(most)));
            }
        }
        // The first and the last pixel have neighbours of the same colour two pixels away.
        values[0] = values[2];
        values.push(values[width - 1]);
    }
}

/// Weighted sums of squares of 3 × 3 pixels. The rows have one pixel more than `out` at both ends.
fn weighted<S: Copy + From<u16> + Add<Output = S>>(
    [above, row, below]: [&[u16]; HELD_ROWS],
    most: u16,
    peaks: &mut Vec<u16>,
    sums: &mut Vec<S>,
    out: &mut [[u8; 2]],
    value_of: impl Fn(S) -> u16,
) {
    let sum = |a: S, b: S, c: S| a + b + b + c;
    let columns = above.iter().zip(row).zip(below);
    sums.clear();
    sums.extend(columns.map(|((&a, &b), &c)| sum(a.into(), b.into(), c.into())));
    peaks.clear();
    peaks.extend(above.iter().zip(row).zip(below).map(|((&a, &b), &c)| a.max(b).max(c)));
    let of_column = sum(most.into(), most.into(), most.into());
    let greatest = value_of(sum(of_column, of_column, of_column));
    let neighbours = sums.iter().zip(&sums[1..]).zip(&sums[2..]);
    let peaks = peaks.iter().zip(&peaks[1..]).zip(&peaks[2..]);
    let pixels = out.iter_mut().zip(neighbours.zip(peaks));
    for (out, (((&left, &middle), &right), ((&a, &b), &c))) in pixels {
        let value = value_of(sum(left, middle, right));
        *out = if a.max(b).max(c) == most { greatest } else { value }.to_le_bytes();
    }
}

/// Four times a green value, or the sum of the four green neighbours. The rows have one pixel more than `out` at both
/// ends; a number of `is_green` is zero or all ones.
fn green<S: Copy + From<u16> + Add<Output = S>>(
    [above, row, below]: [&[u16]; HELD_ROWS],
    is_green: &[u16],
    most: u16,
    out: &mut [[u8; 2]],
    value_of: impl Fn(S) -> u16,
) {
    let sum = |a: u16, b: u16, c: u16, d: u16| value_of((S::from(a) + S::from(b)) + (S::from(c) + S::from(d)));
    let vertical = above[1..].iter().zip(&below[1..]);
    let horizontal = row.iter().zip(&row[1..]).zip(&row[2..]);
    let pixels = out.iter_mut().zip(is_green).zip(vertical.zip(horizontal));
    for ((out, &is_green), ((&up, &down), ((&left, &own), &right))) in pixels {
        let is_saturated = up.max(down).max(left.max(right)) == most;
        let between = if is_saturated { sum(most, most, most, most) } else { sum(up, down, left, right) };
        let value = sum(own, own, own, own) & is_green | between & !is_green;
        *out = value.to_le_bytes();
    }
}
