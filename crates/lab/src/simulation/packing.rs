//! Packs simulated images in the format and arrangement in which a device sends them.
//!
//! In: the values of one view or two, one image for each colour. Out: the bytes of the device, in rows without gaps.
//! Colours of luma formats are neutral.

use fringeflow_dataset::GreyImage;
use fringeflow_pixels::{DeviceImages, SourceFormat, StereoLayout};

/// Value of a colour difference without colour, and of bytes without meaning.
const NEUTRAL: u8 = 128;
/// A multiple of the pixels that any format stores together.
const GROUP_PX: usize = 4;

/// Values of a row: those of all colours of the first pixel, then of the next.
type Row = Vec<u16>;

/// Returns the bytes of an image of a device, from the images of each view, one for each colour. The number of views and
/// colours is that of the format; compressed formats have no such bytes.
pub(super) fn packed(images: DeviceImages, views: &[Vec<GreyImage>]) -> Vec<u8> {
    let format = images.format();
    let rows = arranged(images, &views.iter().map(|colours| rows_of(colours)).collect::<Vec<_>>());
    let width = rows.first().map_or(0, |row| row.len() / values_per_pixel(format));
    let row_bytes = format.least_stride_bytes(width);
    let mut bytes: Vec<u8> = rows.iter().flat_map(|row| packed_row(format, row, row_bytes)).collect();
    bytes.resize(format.whole_bytes([width, rows.len()]), NEUTRAL);
    bytes
}

/// Number of values in a row for each pixel of its width.
fn values_per_pixel(format: SourceFormat) -> usize {
    match format {
        format if format.is_rgb() => 3,
        format if format.is_interleaved() => 2,
        _ => 1,
    }
}

/// Rows of a view, from its colours.
fn rows_of(colours: &[GreyImage]) -> Vec<Row> {
    let Some(first) = colours.first() else { return Vec::new() };
    let value = |colour: &GreyImage, pixel: usize| match colour.format.bytes() {
        1 => u16::from(colour.pixels[pixel]),
        _ => u16::from_le_bytes([colour.pixels[2 * pixel], colour.pixels[2 * pixel + 1]]),
    };
    let row = |v: usize| {
        let pixels = v * first.width..(v + 1) * first.width;
        pixels.flat_map(|pixel| colours.iter().map(move |colour| value(colour, pixel))).collect()
    };
    (0..first.height).map(row).collect()
}

/// Rows of a whole image, from those of its views.
fn arranged(images: DeviceImages, views: &[Vec<Row>]) -> Vec<Row> {
    let beside = |join: fn(&Row, &Row) -> Row| match views {
        [first, second] => first.iter().zip(second).map(|(a, b)| join(a, b)).collect(),
        _ => Vec::new(),
    };
    match images.layout() {
        Some(StereoLayout::SideBySide) => beside(|a, b| [&a[..], b].concat()),
        None if images.holds_both_views() => beside(|a, b| a.iter().zip(b).flat_map(|(&a, &b)| [a, b]).collect()),
        Some(StereoLayout::TopBottom) | None => views.concat(),
    }
}

fn packed_row(format: SourceFormat, row: &[u16], row_bytes: usize) -> Vec<u8> {
    let mut row = row.to_vec();
    if !format.is_rgb() {
        row.resize(row.len().next_multiple_of(GROUP_PX), 0);
    }
    let in_groups = |pixels: usize, pack: &dyn Fn(&[u16]) -> Vec<u8>| row.chunks(pixels).flat_map(pack).collect();
    let of_colours = |pack: fn([u8; 3]) -> Vec<u8>| {
        let colours = row.as_chunks::<3>().0.iter();
        colours.flat_map(|colours| pack(colours.map(|value| value as u8))).collect()
    };
    let mut bytes: Vec<u8> = match format.samples() {
        SourceFormat::Y10
        | SourceFormat::Y12
        | SourceFormat::Y14
        | SourceFormat::Y16
        | SourceFormat::Y16Interleaved => row.iter().flat_map(|value| value.to_le_bytes()).collect(),
        SourceFormat::Y16BigEndian => row.iter().flat_map(|value| value.to_be_bytes()).collect(),
        SourceFormat::Y012 => row.iter().flat_map(|value| (value << 4).to_le_bytes()).collect(),
        SourceFormat::Y10BitPacked => in_groups(4, &|group| downwards(group, 10)),
        SourceFormat::Y10Mipi => in_groups(4, &|group| mipi(group, 2)),
        SourceFormat::Y12Mipi => in_groups(2, &|group| mipi(group, 4)),
        SourceFormat::Y14Mipi => in_groups(4, &|group| mipi(group, 6)),
        SourceFormat::Mono10p => in_groups(4, &|group| upwards(group, 10)),
        SourceFormat::Mono12p | SourceFormat::Y12Interleaved => in_groups(2, &|group| upwards(group, 12)),
        SourceFormat::Yuyv | SourceFormat::Yvyu => row.iter().flat_map(|&luma| [luma as u8, NEUTRAL]).collect(),
        SourceFormat::Uyvy | SourceFormat::Vyuy => row.iter().flat_map(|&luma| [NEUTRAL, luma as u8]).collect(),
        SourceFormat::Rgb24 => of_colours(|[r, g, b]| vec![r, g, b]),
        SourceFormat::Bgr24 => of_colours(|[r, g, b]| vec![b, g, r]),
        SourceFormat::Xbgr32 | SourceFormat::Abgr32 | SourceFormat::Bgr32 => {
            of_colours(|[r, g, b]| vec![b, g, r, NEUTRAL])
        }
        SourceFormat::Rgbx32 | SourceFormat::Rgba32 => of_colours(|[r, g, b]| vec![r, g, b, NEUTRAL]),
        SourceFormat::Bgrx32 | SourceFormat::Bgra32 => of_colours(|[r, g, b]| vec![NEUTRAL, b, g, r]),
        SourceFormat::Xrgb32 | SourceFormat::Argb32 | SourceFormat::Rgb32 => {
            of_colours(|[r, g, b]| vec![NEUTRAL, r, g, b])
        }
        _ => row.iter().map(|&value| value as u8).collect(),
    };
    bytes.truncate(row_bytes);
    bytes
}

/// Packs values from the high bits downwards.
fn downwards(values: &[u16], bits: usize) -> Vec<u8> {
    let number = values.iter().fold(0_u64, |number, &value| number << bits | u64::from(value));
    number.to_be_bytes()[8 - values.len() * bits / 8..].to_vec()
}

/// Packs values from the low bits upwards.
fn upwards(values: &[u16], bits: usize) -> Vec<u8> {
    let number = values.iter().rev().fold(0_u64, |number, &value| number << bits | u64::from(value));
    number.to_le_bytes()[..values.len() * bits / 8].to_vec()
}

/// Packs the high bytes of values, then their low bits.
fn mipi(values: &[u16], low_bits: usize) -> Vec<u8> {
    let low: Vec<u16> = values.iter().map(|value| value & ((1 << low_bits) - 1)).collect();
    let high = values.iter().map(|value| (value >> low_bits) as u8);
    high.chain(upwards(&low, low_bits)).collect()
}

#[cfg(test)]
mod tests {
    use fringeflow::geometry::Readout;
    use fringeflow_base::grey::PixelFormat;
    use fringeflow_pixels::{BayerGrey, ImageReader};

    use super::*;

    /// An image with values of this depth, different for each `seed`.
    fn image([width, height]: [usize; 2], format: PixelFormat, seed: usize) -> GreyImage {
        let value = |i: usize| ((i * 7919 + seed * 104_729) >> 3) as u16 & format.max_value();
        let bytes = |i: usize| value(i).to_le_bytes().into_iter().take(format.bytes());
        GreyImage { width, height, format, pixels: (0..width * height).flat_map(bytes).collect() }
    }

    #[test]
    fn readers_find_the_values_in_every_format_and_arrangement() {
        let size_px = [20, 18];
        for format in SourceFormat::ALL.into_iter().filter(|format| !format.is_compressed()) {
            let raw = format.bayer_order().map(|_| BayerGrey::Raw);
            let layouts: &[Option<StereoLayout>] = match format.is_interleaved() {
                true => &[None],
                false => &[None, Some(StereoLayout::SideBySide), Some(StereoLayout::TopBottom)],
            };
            for &layout in layouts {
                let images = DeviceImages::new(format, raw, layout).unwrap();
                let depth = if format.is_rgb() { PixelFormat::Grey } else { format.pixel_format() };
                let colours = if format.is_rgb() { 3 } else { 1 };
                let view = |view| (0..colours).map(|colour| image(size_px, depth, 3 * view + colour)).collect();
                let views: Vec<Vec<GreyImage>> = (0..images.views()).map(view).collect();
                let bytes = packed(images, &views);
                let image_px = images.image_px(size_px).unwrap();
                assert_eq!(bytes.len(), format.whole_bytes(image_px), "{format} {layout:?}");
                let mut reader = ImageReader::new(images, Readout::whole(size_px)).unwrap();
                for (view, colours) in views.iter().enumerate() {
                    let mut out = vec![0; reader.image_bytes()];
                    reader.read(view, &bytes, format.least_stride_bytes(image_px[0]), &mut out).unwrap();
                    let expected = match &colours[..] {
                        [grey] => grey.pixels.clone(),
                        [red, green, blue] => (0..red.pixels.len())
                            .map(|i| [red, green, blue].map(|colour| u16::from(colour.pixels[i])))
                            .map(|[r, g, b]| if r.max(g).max(b) == 255 { 1020 } else { r + 2 * g + b })
                            .flat_map(u16::to_le_bytes)
                            .collect(),
                        _ => unreachable!(),
                    };
                    assert!(out == expected, "{format} {layout:?} view {view}");
                }
            }
        }
    }
}
