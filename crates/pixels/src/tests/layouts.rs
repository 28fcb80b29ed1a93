//! Examples from the documentation of the kernel, and round trips.

use proptest::prelude::*;

use fringeflow_base::grey::PixelFormat;

use crate::{BayerSamples, SourceFormat};

use super::{numbers, numbers_of, raw_formats, unpack};

/// Grey levels of an unpacked row.
fn greys(format: SourceFormat, row: &[u8], width_px: usize) -> Vec<u16> {
    unpacked(format, row, row.len(), [width_px, 1])
}

fn unpacked(format: SourceFormat, source: &[u8], stride_bytes: usize, size_px: [usize; 2]) -> Vec<u16> {
    let bytes = format.pixel_format().bytes();
    // The previous content of the buffer must not remain.
    let [zeros, ones] = [0, 0xff].map(|before| {
        let mut out = vec![before; size_px[0] * size_px[1] * bytes];
        unpack(format, source, stride_bytes, size_px, &mut out).unwrap();
        out
    });
    assert_eq!(zeros, ones, "{format}: some bytes were not written");
    numbers_of(bytes, &zeros)
}

#[test]
fn layouts_of_the_documentation() {
    // Each bit of every grey level in the documentation, written by hand.
    let cases: &[(&str, &[u8], &[u16])] = &[
        ("GREY", &[1, 2, 255], &[1, 2, 255]),
        ("Y10", &[0x34, 0x02, 0xff, 0x03], &[0x234, 0x3ff]),
        ("Y12", &[0x34, 0x0a], &[0xa34]),
        ("Y14", &[0x34, 0x2a], &[0x2a34]),
        ("Y16", &[0x34, 0xfa], &[0xfa34]),
        ("Y16_BE", &[0xfa, 0x34, 0x00, 0x01], &[0xfa34, 1]),
        // Y0[3:0] 0000, Y0[11:4].
        ("Y012", &[0x40, 0xa3], &[0xa34]),
        // Y0[9:2] | Y0[1:0] Y1[9:4] | Y1[3:0] Y2[9:6] | Y2[5:0] Y3[9:8] | Y3[7:0].
        ("Y10B", &[0b1000_0000, 0b0110_0000, 0b0001_1000, 0b0000_0110, 0b0000_0001], &[0x201, 0x201, 0x201, 0x201]),
        ("Y10B", &[0xff, 0xc0, 0x0f, 0xfc, 0x00], &[0x3ff, 0, 0x3ff, 0]),
        // Y0[9:2] | Y1[9:2] | Y2[9:2] | Y3[9:2] | Y3[1:0] Y2[1:0] Y1[1:0] Y0[1:0].
        ("Y10P", &[1, 2, 4, 0x80, 0b11_10_01_00], &[4, 9, 0x12, 0x203]),
        // Y0[11:4] | Y1[11:4] | Y1[3:0] Y0[3:0].
        ("Y12P", &[0x12, 0xfe, 0xa5], &[0x125, 0xfea]),
        // Y0[13:6] … Y3[13:6] | Y1[1:0] Y0[5:0] | Y2[3:0] Y1[5:2] | Y3[5:0] Y2[5:4].
        (
            "Y14P",
            &[1, 2, 3, 0x80, 0b0110_0001, 0b0011_1010, 0b1001_1010],
            &[1 << 6 | 0x21, 2 << 6 | 0x29, 3 << 6 | 0x23, 0x80 << 6 | 0x26],
        ),
        // Y0[7:0] | Y1[5:0] Y0[9:8] | Y2[3:0] Y1[9:6] | Y3[1:0] Y2[9:4] | Y3[9:2].
        ("Mono10p", &[0x01, 0b0000_1010, 0b0011_0000, 0b0110_0000, 0x80], &[0x201, 2, 0x203, 0x201]),
        // Y0[7:0] | Y1[3:0] Y0[11:8] | Y1[11:4].
        ("Mono12p", &[0x25, 0xa1, 0xfe], &[0x125, 0xfea]),
        ("BA81", &[1, 2, 255], &[1, 2, 255]),
        ("BG12", &[0x34, 0x0a], &[0xa34]),
        ("pgAA", &[1, 2, 4, 0x80, 0b11_10_01_00], &[4, 9, 0x12, 0x203]),
        ("pRCC", &[0x12, 0xfe, 0xa5], &[0x125, 0xfea]),
        ("BayerGB12p", &[0x25, 0xa1, 0xfe], &[0x125, 0xfea]),
        // View 0 of both: left bytes; left = 0xfff & word at 0, right = word at 1 >> 4.
        ("Y8I", &[1, 100, 2, 200], &[1, 2]),
        ("Y12I", &[0x25, 0xa1, 0xfe], &[0x125]),
        ("Y16I", &[0x25, 0xa1, 0xfe, 0xff], &[0xa125]),
        // R + 2 G + B.
        ("RGB3", &[1, 10, 100, 255, 255, 255], &[121, 1020]),
        ("BGR3", &[1, 10, 100, 255, 255, 255], &[121, 1020]),
        // A saturated colour saturates the sum.
        ("RGB3", &[1, 255, 2, 255, 0, 0, 254, 254, 254], &[1020, 1020, 1016]),
        ("XB24", &[1, 2, 255, 9, 1, 2, 3, 255], &[1020, 8]),
        // Bytes B G R X, and X R G B.
        ("XR24", &[1, 10, 100, 9, 2, 20, 200, 9], &[121, 242]),
        ("BX24", &[9, 1, 10, 100, 9, 2, 20, 200], &[121, 242]),
        ("YUYV", &[1, 100, 2, 200], &[1, 2]),
        ("YVYU", &[1, 100, 2, 200], &[1, 2]),
        ("UYVY", &[100, 1, 200, 2], &[1, 2]),
        ("VYUY", &[100, 1, 200, 2], &[1, 2]),
    ];
    for (name, bytes, expected) in cases {
        assert_eq!(greys(name.parse().unwrap(), bytes, expected.len()), *expected, "{name}");
    }
}

#[test]
fn luma_is_the_first_plane() {
    // 4 × 2 pixels of luma in rows of 6 bytes; colours follow.
    let source = [1, 2, 3, 4, 90, 91, 5, 6, 7, 8, 92, 93, 94, 95, 96, 97, 98, 99];
    for name in ["NV12", "NV21", "NV16", "NV61", "YU12", "YV12", "NM12", "NM21", "YM12", "YM21"] {
        let format: SourceFormat = name.parse().unwrap();
        assert_eq!(unpacked(format, &source, 6, [4, 2]), [1, 2, 3, 4, 5, 6, 7, 8], "{name}");
        assert_eq!(format.pixel_format(), PixelFormat::Grey);
    }
}

/// Red, green and blue with this sum R + 2 G + B.
fn colours(sum: u16) -> [u8; 3] {
    let green = (sum + 2) / 4;
    let red = (sum - 2 * green) / 2;
    [red, green, sum - 2 * green - red].map(|colour| colour as u8)
}

/// The largest value of a format; of colours, the largest sum of which none is saturated.
fn greatest(format: SourceFormat) -> u16 {
    if format.is_rgb() { 4 * 254 } else { format.pixel_format().max_value() }
}

/// Packs a row in the layout of a format, padded with ones to whole groups.
fn packed(format: SourceFormat, greys: &[u16]) -> Vec<u8> {
    let mut greys = greys.to_vec();
    greys.resize(greys.len().next_multiple_of(4), greatest(format));
    if let SourceFormat::Bayer(_, samples) = format {
        return packed(BayerSamples::grey_format(samples), &greys);
    }
    let bits = |greys: &[u16], bits: u32| {
        let number = greys.iter().fold(0_u64, |number, &grey| number << bits | u64::from(grey));
        number.to_be_bytes()[8 - greys.len() * bits as usize / 8..].to_vec()
    };
    // The low bits of the first pixel are stored in the lowest bits.
    let mipi = |greys: &[u16], low: u32| {
        let high = greys.iter().map(|grey| (grey >> low) as u8);
        let lows = greys.iter().rev().fold(0_u32, |number, &grey| number << low | u32::from(grey) & ((1 << low) - 1));
        high.chain(lows.to_le_bytes().into_iter().take(greys.len() * low as usize / 8)).collect::<Vec<u8>>()
    };
    // The first pixel is stored in the lowest bits.
    let upwards = |greys: &[u16], bits: usize| {
        let number = greys.iter().rev().fold(0_u64, |number, &grey| number << bits | u64::from(grey));
        number.to_le_bytes()[..greys.len() * bits / 8].to_vec()
    };
    match format {
        SourceFormat::Mono10p => greys.chunks(4).flat_map(|four| upwards(four, 10)).collect(),
        SourceFormat::Mono12p => greys.chunks(2).flat_map(|two| upwards(two, 12)).collect(),
        SourceFormat::Y8Interleaved => greys.iter().flat_map(|&grey| [grey as u8, 77]).collect(),
        SourceFormat::Y12Interleaved => greys.iter().flat_map(|&grey| upwards(&[grey, 0x777], 12)).collect(),
        SourceFormat::Y16Interleaved => greys.iter().flat_map(|&grey| upwards(&[grey, 0x7777], 16)).collect(),
        _ if format.colour_bytes() == Some([3, 0]) => greys.iter().flat_map(|&grey| colours(grey)).collect(),
        _ if format.colour_bytes() == Some([4, 0]) => {
            greys.iter().map(|&grey| colours(grey)).flat_map(|[a, b, c]| [a, b, c, 77]).collect()
        }
        _ if format.colour_bytes() == Some([4, 1]) => {
            greys.iter().map(|&grey| colours(grey)).flat_map(|[a, b, c]| [77, a, b, c]).collect()
        }
        SourceFormat::Y16BigEndian => greys.iter().flat_map(|grey| grey.to_be_bytes()).collect(),
        SourceFormat::Y012 => greys.iter().flat_map(|grey| (grey << 4).to_le_bytes()).collect(),
        SourceFormat::Y10BitPacked => greys.chunks(4).flat_map(|four| bits(four, 10)).collect(),
        SourceFormat::Y10Mipi => greys.chunks(4).flat_map(|four| mipi(four, 2)).collect(),
        SourceFormat::Y12Mipi => greys.chunks(2).flat_map(|two| mipi(two, 4)).collect(),
        SourceFormat::Y14Mipi => greys.chunks(4).flat_map(|four| mipi(four, 6)).collect(),
        SourceFormat::Yuyv | SourceFormat::Yvyu => greys.iter().flat_map(|&grey| [grey as u8, 77]).collect(),
        SourceFormat::Uyvy | SourceFormat::Vyuy => greys.iter().flat_map(|&grey| [77, grey as u8]).collect(),
        _ if format.pixel_format().bytes() == 2 => greys.iter().flat_map(|grey| grey.to_le_bytes()).collect(),
        _ => greys.iter().map(|&grey| grey as u8).collect(),
    }
}

proptest! {
    #[test]
    fn packed_values_are_unpacked_again(
        width_px in 1..70_usize,
        height_px in 1..5_usize,
        gap_bytes in prop_oneof![Just(0_usize), 1..40_usize],
        seed in any::<u64>(),
    ) {
        let mut random = numbers(seed);
        for format in raw_formats() {
            let bits = format.pixel_format().bits();
            let value = |_| (random() >> (16 - bits)).min(greatest(format));
            let image: Vec<u16> = (0..width_px * height_px).map(value).collect();
            let stride_bytes = format.least_stride_bytes(width_px) + gap_bytes;
            let mut source = Vec::new();
            for row in image.chunks(width_px) {
                let start = source.len();
                source.extend_from_slice(&packed(format, row)[..format.least_stride_bytes(width_px)]);
                source.resize(start + stride_bytes, 0xa5);
            }
            // A driver may omit the gap after the last row.
            source.truncate(format.least_bytes([width_px, height_px], stride_bytes));
            prop_assert_eq!(unpacked(format, &source, stride_bytes, [width_px, height_px]), image, "{}", format);
        }
    }
}
