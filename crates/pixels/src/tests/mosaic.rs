//! Grey levels of Bayer mosaics, against sums pixel by pixel.

use proptest::prelude::*;

use fringeflow::geometry::Readout;
use fringeflow_base::grey::PixelFormat;

use crate::{BayerGrey, BayerOrder, BayerSamples, DeviceImages, ImageReader, SourceFormat};

use super::{numbers, numbers_of, unpack};

/// Colour of a pixel, from the name of the order.
fn colour(order: BayerOrder, column: usize, row: usize) -> char {
    let letters = match order {
        BayerOrder::Rggb => ["RG", "GB"],
        BayerOrder::Grbg => ["GR", "BG"],
        BayerOrder::Gbrg => ["GB", "RG"],
        BayerOrder::Bggr => ["BG", "GR"],
    };
    letters[row % 2].chars().nth(column % 2).unwrap()
}

/// Index with the same colour within `0..side`.
fn mirrored(index: isize, side: usize) -> usize {
    let last = side as isize - 1;
    (if index < 0 {
        -index
    } else if index > last {
        2 * last - index
    } else {
        index
    }) as usize
}

/// Grey level of a pixel in units of 1 / `scale` values, rounded half up.
fn grey_level(grey: BayerGrey, order: BayerOrder, at: impl Fn(isize, isize) -> u64, [x, y]: [usize; 2]) -> (u64, u64) {
    let around = |dx: isize, dy: isize| at(x as isize + dx, y as isize + dy);
    match grey {
        BayerGrey::Weighted => {
            let weight = |d: isize| 2 - d.unsigned_abs() as u64;
            let square = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
            (square.map(|(dx, dy)| weight(dx) * weight(dy) * around(dx, dy)).sum(), 16)
        }
        BayerGrey::Green if colour(order, x, y) == 'G' => (4 * around(0, 0), 4),
        BayerGrey::Green => (around(-1, 0) + around(1, 0) + around(0, -1) + around(0, 1), 4),
        BayerGrey::Raw => (around(0, 0), 1),
    }
}

/// Whether a value behind the grey level of a pixel is the largest one.
fn is_saturated(
    grey: BayerGrey,
    order: BayerOrder,
    at: impl Fn(isize, isize) -> u64,
    [x, y]: [usize; 2],
    most: u64,
) -> bool {
    let square = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx: isize| (dx, dy)));
    square.filter(|(dx, dy)| at(x as isize + dx, y as isize + dy) == most).any(|(dx, dy)| match grey {
        BayerGrey::Weighted => true,
        BayerGrey::Green if colour(order, x, y) == 'G' => (dx, dy) == (0, 0),
        BayerGrey::Green => dx.abs() + dy.abs() == 1,
        BayerGrey::Raw => (dx, dy) == (0, 0),
    })
}

const SAMPLES: [BayerSamples; 7] = [
    BayerSamples::Grey,
    BayerSamples::Y10,
    BayerSamples::Y10Mipi,
    BayerSamples::Y12,
    BayerSamples::Mono12p,
    BayerSamples::Y14Mipi,
    BayerSamples::Y16,
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn grey_levels_are_those_of_the_definition(
        width_px in 2..70_usize,
        height_px in 2..40_usize,
        gap_bytes in prop_oneof![Just(0_usize), 1..40_usize],
        has_region in any::<bool>(),
        corner in (0..5_usize, 0..5_usize),
        seed in any::<u64>(),
    ) {
        let mut random = numbers(seed);
        let region = (has_region && width_px >= 22 && height_px >= 22)
            .then(|| [corner.0, corner.1, width_px - 4 - corner.0 / 2, height_px - 4 - corner.1 / 2]);
        let sensor_px = [width_px, height_px];
        let readout = match region {
            Some(region) => Readout::new(sensor_px, Some(region), 1).unwrap(),
            None => Readout::whole(sensor_px),
        };
        let [x0, y0, width, height] = readout.region();
        for (order, samples) in BayerOrder::ALL.into_iter().flat_map(|order| SAMPLES.map(|samples| (order, samples))) {
            let format = SourceFormat::Bayer(order, samples);
            let stored = format.pixel_format();
            let stride_bytes = format.least_stride_bytes(width_px) + gap_bytes;
            let mut source: Vec<u8> = (0..stride_bytes * height_px).map(|_| random() as u8).collect();
            if format.samples() == stored.into() && stored.bytes() == 2 {
                // Rows of 16-bit numbers, with bits beyond the depth in the gaps only.
                for row in source.chunks_mut(stride_bytes) {
                    for value in row[..2 * width_px].as_chunks_mut::<2>().0 {
                        *value = (u16::from_le_bytes(*value) & stored.max_value()).to_le_bytes();
                    }
                }
            }
            source.truncate(format.least_bytes(sensor_px, stride_bytes));
            let mut mosaic = vec![0; width_px * height_px * stored.bytes()];
            unpack(format, &source, stride_bytes, sensor_px, &mut mosaic).unwrap();
            let mosaic = numbers_of(stored.bytes(), &mosaic);
            let at = |x, y| u64::from(mosaic[mirrored(y, height_px) * width_px + mirrored(x, width_px)]);
            for grey in BayerGrey::ALL {
                let images = DeviceImages::new(format, Some(grey), None).unwrap();
                let mut reader = ImageReader::new(images, readout).unwrap();
                let pixel_format = reader.pixel_format();
                let mut out = vec![0xee; reader.image_bytes()];
                reader.read(0, &source, stride_bytes, &mut out).unwrap();
                let found = numbers_of(pixel_format.bytes(), &out);
                for (v, u) in (0..height).flat_map(|v| (0..width).map(move |u| (v, u))) {
                    let (sum, scale) = grey_level(grey, order, at, [x0 + u, y0 + v]);
                    // 16 bits have no room for the bits of the sum.
                    let shift = u32::from(stored.bits()) + scale.ilog2() - u32::from(pixel_format.bits());
                    // A saturated value saturates the grey level.
                    let most = u64::from(stored.max_value());
                    let sum = if is_saturated(grey, order, at, [x0 + u, y0 + v], most) { scale * most } else { sum };
                    let expected = if shift == 0 { sum } else { (sum + (1 << (shift - 1))) >> shift };
                    prop_assert_eq!(u64::from(found[v * width + u]), expected, "{} {:?} at {}, {}", format, grey, u, v);
                }
            }
        }
    }
}

/// The mosaic of a surface of one colour.
fn uniform([width, height]: [usize; 2], order: BayerOrder, [red, green, blue]: [u8; 3]) -> Vec<u8> {
    let value = |x, y| match colour(order, x, y) {
        'R' => red,
        'G' => green,
        _ => blue,
    };
    (0..height).flat_map(|y| (0..width).map(move |x| value(x, y))).collect()
}

#[test]
fn a_surface_of_one_colour_has_one_grey_level_up_to_the_border() {
    let (size_px, colours) = ([34, 32], [200, 90, 31]);
    for order in BayerOrder::ALL {
        let source = uniform(size_px, order, colours);
        let format = SourceFormat::Bayer(order, BayerSamples::Grey);
        let read = |grey, binning| {
            let readout = Readout::new(size_px, None, binning).unwrap();
            let mut reader = ImageReader::new(DeviceImages::new(format, Some(grey), None).unwrap(), readout).unwrap();
            let mut out = vec![0; reader.image_bytes()];
            reader.read(0, &source, size_px[0], &mut out).unwrap();
            (reader.pixel_format(), numbers_of(reader.pixel_format().bytes(), &out))
        };
        let (format, weighted) = read(BayerGrey::Weighted, 1);
        // 16 (R + 2 G + B) / 4.
        assert_eq!((format, weighted), (PixelFormat::Y12, vec![4 * (200 + 2 * 90 + 31); 34 * 32]), "{order:?}");
        assert_eq!(read(BayerGrey::Green, 1), (PixelFormat::Y10, vec![4 * 90; 34 * 32]), "{order:?}");
        // A square is summed without interpolation.
        for grey in [BayerGrey::Weighted, BayerGrey::Raw] {
            assert_eq!(read(grey, 2), (PixelFormat::Y10, vec![200 + 2 * 90 + 31; 17 * 16]), "{order:?}");
        }
    }
}

#[test]
fn bits_beyond_the_depth_do_not_overflow() {
    let format: SourceFormat = "RG12".parse().unwrap();
    for grey in BayerGrey::ALL {
        let mut reader =
            ImageReader::new(DeviceImages::new(format, Some(grey), None).unwrap(), Readout::whole([4, 4])).unwrap();
        let mut out = vec![0; reader.image_bytes()];
        reader.read(0, &[0xff; 32], 8, &mut out).unwrap();
        let most = reader.pixel_format().max_value();
        let expected = match grey {
            BayerGrey::Weighted => 16 * 4095,
            BayerGrey::Green => most - 3,
            BayerGrey::Raw => u16::MAX,
        };
        assert_eq!(numbers_of(2, &out), vec![expected; 16], "{grey:?}");
    }
}
