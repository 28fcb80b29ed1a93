//! Conversion of one row of each layout, as described in the V4L2 documentation of the kernel.
//!
//! In: a row of the source, at least as long as the minimum stride of the format. Out: a row of the result. The caller
//! has checked the sizes. The loops run over groups of a fixed number of bytes without branches, so that the compiler
//! vectorizes them.

/// Converts a row of the source to a row of the result.
pub(super) type Row = fn(&[u8], &mut [u8]);

/// R + 2 G + B of white.
const GREATEST_SUM: u16 = 4 * 255;

/// Copies rows of `row_bytes`, or all rows at once if the source has no gaps.
pub(super) fn copy(source: &[u8], stride_bytes: usize, row_bytes: usize, out: &mut [u8]) {
    if stride_bytes == row_bytes {
        out.copy_from_slice(&source[..out.len()]);
    } else {
        each(source, stride_bytes, row_bytes, out, |row, out| out.copy_from_slice(&row[..out.len()]));
    }
}

/// Unpacks row by row; a row of the result has `row_bytes`.
pub(super) fn each(source: &[u8], stride_bytes: usize, row_bytes: usize, out: &mut [u8], unpack: Row) {
    // An image without pixels has no rows; `chunks` must not get 0.
    let rows = source.chunks(stride_bytes.max(1));
    for (row, out) in rows.zip(out.chunks_exact_mut(row_bytes.max(1))) {
        unpack(row, out);
    }
}

/// `Y16_BE`.
pub(super) fn y16_big_endian(row: &[u8], out: &mut [u8]) {
    groups(row, out, |&[high, low]| [u16::from_be_bytes([high, low])]);
}

/// `Y012`.
pub(super) fn y012(row: &[u8], out: &mut [u8]) {
    groups(row, out, |&bytes: &[u8; 2]| [u16::from_le_bytes(bytes) >> 4]);
}

/// `Y10B`.
pub(super) fn y10_bit_packed(row: &[u8], out: &mut [u8]) {
    groups(row, out, |bytes: &[u8; 5]| {
        let [a, b, c, d, e] = bytes.map(u16::from);
        [a << 2 | b >> 6, (b & 0x3f) << 4 | c >> 4, (c & 0x0f) << 6 | d >> 2, (d & 0x03) << 8 | e]
    });
}

/// `Y10P`.
pub(super) fn y10_mipi(row: &[u8], out: &mut [u8]) {
    groups(row, out, |bytes: &[u8; 5]| {
        let [a, b, c, d, low] = bytes.map(u16::from);
        [a << 2 | low & 3, b << 2 | low >> 2 & 3, c << 2 | low >> 4 & 3, d << 2 | low >> 6]
    });
}

/// `Y12P`.
pub(super) fn y12_mipi(row: &[u8], out: &mut [u8]) {
    groups(row, out, |bytes: &[u8; 3]| {
        let [a, b, low] = bytes.map(u16::from);
        [a << 4 | low & 0x0f, b << 4 | low >> 4]
    });
}

/// `Y14P`.
pub(super) fn y14_mipi(row: &[u8], out: &mut [u8]) {
    groups(row, out, |bytes: &[u8; 7]| {
        let [a, b, c, d, low0, low1, low2] = bytes.map(u16::from);
        [
            a << 6 | low0 & 0x3f,
            b << 6 | (low1 & 0x0f) << 2 | low0 >> 6,
            c << 6 | (low2 & 0x03) << 4 | low1 >> 4,
            d << 6 | low2 >> 2,
        ]
    });
}

/// `Mono10p`.
pub(super) fn mono_10p(row: &[u8], out: &mut [u8]) {
    groups(row, out, |bytes: &[u8; 5]| {
        let [a, b, c, d, e] = bytes.map(u16::from);
        [a | (b & 0x03) << 8, b >> 2 | (c & 0x0f) << 6, c >> 4 | (d & 0x3f) << 4, d >> 6 | e << 2]
    });
}

/// `Mono12p`.
pub(super) fn mono_12p(row: &[u8], out: &mut [u8]) {
    groups(row, out, |bytes: &[u8; 3]| {
        let [a, b, c] = bytes.map(u16::from);
        [a | (b & 0x0f) << 8, b >> 4 | c << 4]
    });
}

/// View 0 of `Y12I`.
pub(super) fn y12_interleaved_0(row: &[u8], out: &mut [u8]) {
    pixels_of_three_bytes(row, out, |[a, b, _]| u16::from_le_bytes([a, b]) & 0x0fff);
}

/// View 1 of `Y12I`.
pub(super) fn y12_interleaved_1(row: &[u8], out: &mut [u8]) {
    pixels_of_three_bytes(row, out, |[_, b, c]| u16::from_le_bytes([b, c]) >> 4);
}

/// View 0 of `Y16I`.
pub(super) fn y16_interleaved_0(row: &[u8], out: &mut [u8]) {
    groups(row, out, |&pair: &[u8; 4]| [u32::from_le_bytes(pair) as u16]);
}

/// View 1 of `Y16I`.
pub(super) fn y16_interleaved_1(row: &[u8], out: &mut [u8]) {
    groups(row, out, |&pair: &[u8; 4]| [(u32::from_le_bytes(pair) >> 16) as u16]);
}

/// `RGB3` and `BGR3`: R + 2 G + B. Nothing is rounded, so no precision is lost. Here and below, the sum is the largest
/// one if a colour is saturated, so that it counts as saturated too.
pub(super) fn colours_of_three_bytes(row: &[u8], out: &mut [u8]) {
    pixels_of_three_bytes(row, out, |[a, b, c]| {
        let sum = u16::from(a) + 2 * u16::from(b) + u16::from(c);
        if a.max(b).max(c) == u8::MAX { GREATEST_SUM } else { sum }
    });
}

/// Colours in the first three of four bytes: R + 2 G + B.
pub(super) fn colours_before_a_byte(row: &[u8], out: &mut [u8]) {
    groups(row, out, |&pixel: &[u8; 4]| [colour_sum(u32::from_le_bytes(pixel))]);
}

/// Colours in the last three of four bytes: R + 2 G + B.
pub(super) fn colours_after_a_byte(row: &[u8], out: &mut [u8]) {
    groups(row, out, |&pixel: &[u8; 4]| [colour_sum(u32::from_le_bytes(pixel) >> 8)]);
}

/// The sum of the low three bytes, the second counted twice.
fn colour_sum(pixel: u32) -> u16 {
    let [first, green, third] = [pixel & 0xff, pixel >> 8 & 0xff, pixel >> 16 & 0xff];
    let is_saturated = first.max(green).max(third) == 0xff;
    if is_saturated { GREATEST_SUM } else { (first + 2 * green + third) as u16 }
}

/// `YUYV` and `YVYU`, and view 0 of `Y8I`.
pub(super) fn first_of_pairs(row: &[u8], out: &mut [u8]) {
    every_second(row, out, |pair| pair as u8);
}

/// `UYVY` and `VYUY`, and view 1 of `Y8I`.
pub(super) fn second_of_pairs(row: &[u8], out: &mut [u8]) {
    every_second(row, out, |pair| (pair >> 8) as u8);
}

/// Reads pairs as 16-bit little-endian numbers, so that the compiler vectorizes the shifts and casts.
fn every_second(row: &[u8], out: &mut [u8], grey_of: impl Fn(u16) -> u8) {
    for (grey, &pair) in out.iter_mut().zip(row.as_chunks::<2>().0) {
        *grey = grey_of(u16::from_le_bytes(pair));
    }
}

/// Unpacks pixels of three bytes. Four at a time are faster than single ones.
fn pixels_of_three_bytes(row: &[u8], out: &mut [u8], value: impl Fn([u8; 3]) -> u16) {
    let whole_bytes = out.len() / 8 * 12;
    let (fours, rest) = row.split_at_checked(whole_bytes).unwrap_or_default();
    let mut slots = out.chunks_exact_mut(8);
    for (slot, &[a, b, c, d, e, f, g, h, i, j, k, l]) in (&mut slots).zip(fours.as_chunks::<12>().0) {
        put(slot, [value([a, b, c]), value([d, e, f]), value([g, h, i]), value([j, k, l])]);
    }
    groups(rest, slots.into_remainder(), |&pixel| [value(pixel)]);
}

/// Unpacks groups of `BYTES` bytes to `PIXELS` grey levels each. Of the last group, only as many grey levels are
/// written as fit into the row.
fn groups<const BYTES: usize, const PIXELS: usize>(
    row: &[u8],
    out: &mut [u8],
    unpack: impl Fn(&[u8; BYTES]) -> [u16; PIXELS],
) {
    let (groups, _) = row.as_chunks::<BYTES>();
    let whole = out.len() / (2 * PIXELS);
    let mut slots = out.chunks_exact_mut(2 * PIXELS);
    for (slot, group) in (&mut slots).zip(groups) {
        put(slot, unpack(group));
    }
    if let Some(group) = groups.get(whole) {
        put(slots.into_remainder(), unpack(group));
    }
}

/// Writes as many grey levels as fit.
fn put<const PIXELS: usize>(slot: &mut [u8], greys: [u16; PIXELS]) {
    for (bytes, grey) in slot.as_chunks_mut::<2>().0.iter_mut().zip(greys) {
        *bytes = grey.to_le_bytes();
    }
}
