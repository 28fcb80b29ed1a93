//! Images with two views.

use proptest::prelude::*;

use fringeflow::geometry::Readout;

use crate::{DeviceImages, ImageReader, SourceFormat, StereoLayout, UnpackError};

use super::{numbers, numbers_of, raw_formats, unpack};

/// Rows of a whole image, from the rows of both views.
fn arranged(layout: StereoLayout, views: &[Vec<Vec<u8>>; 2], gap_bytes: usize) -> (Vec<u8>, usize) {
    let rows: Vec<Vec<u8>> = match layout {
        StereoLayout::SideBySide => views[0].iter().zip(&views[1]).map(|(a, b)| [&a[..], b].concat()).collect(),
        StereoLayout::TopBottom => views.concat(),
    };
    let stride_bytes = rows[0].len() + gap_bytes;
    let mut bytes = Vec::new();
    for row in &rows {
        bytes.extend_from_slice(row);
        bytes.resize(bytes.len() + gap_bytes, 0xa5);
    }
    // A driver may omit the gap after the last row.
    bytes.truncate(bytes.len() - gap_bytes);
    (bytes, stride_bytes)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]
    #[test]
    fn a_view_is_read_as_an_image_of_its_own(
        width_px in (9..20_usize).prop_map(|fours| 4 * fours),
        height_px in (17..24_usize).prop_map(|twos| 2 * twos),
        gap_bytes in prop_oneof![Just(0_usize), 1..40_usize],
        part in prop::sample::select(vec![
            (None, 1),
            (None, 2),
            (Some([3, 1, 18, 32]), 1),
            (Some([2, 1, 34, 32]), 2),
        ]),
        seed in any::<u64>(),
    ) {
        let mut random = numbers(seed);
        let readout = Readout::new([width_px, height_px], part.0, part.1).unwrap();
        for format in raw_formats().filter(|format| !format.is_interleaved()) {
            let row_bytes = format.least_stride_bytes(width_px);
            let mut row = || (0..row_bytes).map(|_| random() as u8).collect::<Vec<u8>>();
            let views = [0, 1].map(|_| (0..height_px).map(|_| row()).collect::<Vec<_>>());
            let mut alone = ImageReader::new(format.into(), readout).unwrap();
            let expected = views.each_ref().map(|rows| {
                let mut out = vec![0; alone.image_bytes()];
                alone.read(0, &rows.concat(), row_bytes, &mut out).unwrap();
                out
            });
            for layout in StereoLayout::ALL {
                let images = DeviceImages::new(format, None, Some(layout)).unwrap();
                let mut reader = ImageReader::new(images, readout).unwrap();
                let (bytes, stride_bytes) = arranged(layout, &views, gap_bytes);
                let mut found = [0, 1].map(|_| vec![0xee; reader.image_bytes()]);
                let [first, second] = &mut found;
                reader.read_both(&bytes, stride_bytes, [first, second]).unwrap();
                prop_assert!(found == expected, "{} {}", format, layout);
                for (view, expected) in expected.iter().enumerate() {
                    let mut found = vec![0xee; reader.image_bytes()];
                    reader.read(view, &bytes, stride_bytes, &mut found).unwrap();
                    prop_assert!(&found == expected, "{} {} view {}", format, layout, view);
                }
                prop_assert!(reader.read(0, &bytes[..bytes.len() - 1], stride_bytes, &mut found[0]).is_err());
            }
        }
    }

    #[test]
    fn interleaved_views_are_separated(
        width_px in 1..70_usize,
        height_px in 1..5_usize,
        gap_bytes in prop_oneof![Just(0_usize), 1..40_usize],
        seed in any::<u64>(),
    ) {
        let mut random = numbers(seed);
        for (name, bits) in [("Y8I", 8), ("Y12I", 12), ("Y16I", 16)] {
            let format: SourceFormat = name.parse().unwrap();
            let pairs: Vec<[u16; 2]> =
                (0..width_px * height_px).map(|_| [random() >> (16 - bits), random() >> (16 - bits)]).collect();
            let stride_bytes = width_px * 2 * bits / 8 + gap_bytes;
            let mut source = Vec::new();
            for row in pairs.chunks(width_px) {
                let start = source.len();
                for &[left, right] in row {
                    let number = u32::from(left) | u32::from(right) << bits;
                    source.extend_from_slice(&number.to_le_bytes()[..2 * bits / 8]);
                }
                source.resize(start + stride_bytes, 0xa5);
            }
            let mut reader = ImageReader::new(format.into(), Readout::whole([width_px, height_px])).unwrap();
            let mut found = [0, 1].map(|_| vec![0; reader.image_bytes()]);
            let [first, second] = &mut found;
            reader.read_both(&source, stride_bytes, [first, second]).unwrap();
            for (view, found) in found.iter().enumerate() {
                let expected: Vec<u16> = pairs.iter().map(|pair| pair[view]).collect();
                prop_assert_eq!(numbers_of(reader.pixel_format().bytes(), found), expected, "{} {}", name, view);
            }
        }
    }
}

#[test]
fn both_views_of_a_jpeg_are_those_of_the_whole_image() {
    let (jpeg, [width, height]) = (include_bytes!("colour_420.jpg"), [80, 72]);
    let mut whole = vec![0; width * height];
    unpack(SourceFormat::Mjpeg, jpeg, 0, [width, height], &mut whole).unwrap();
    let rows: Vec<&[u8]> = whole.chunks(width).collect();
    let half = |from: usize| rows.iter().flat_map(|row| &row[from..][..width / 2]).copied().collect::<Vec<u8>>();
    let beside = [half(0), half(width / 2)];
    let below = [whole[..whole.len() / 2].to_vec(), whole[whole.len() / 2..].to_vec()];
    for (layout, view_px, expected) in
        [(StereoLayout::SideBySide, [40, 72], beside), (StereoLayout::TopBottom, [80, 36], below)]
    {
        let images = DeviceImages::new(SourceFormat::Mjpeg, None, Some(layout)).unwrap();
        let mut reader = ImageReader::new(images, Readout::whole(view_px)).unwrap();
        let mut found = [0, 1].map(|_| vec![0; reader.image_bytes()]);
        let [first, second] = &mut found;
        reader.read_both(jpeg, 0, [first, second]).unwrap();
        assert!(found == expected, "{layout}");
        let mut second = vec![0; reader.image_bytes()];
        reader.read(1, jpeg, 0, &mut second).unwrap();
        assert!(second == expected[1], "{layout}");
    }
}

#[test]
fn a_view_that_does_not_exist_is_refused() {
    let mut out = vec![0; 4];
    let read = |images: DeviceImages, view, out: &mut [u8]| {
        ImageReader::new(images, Readout::whole([2, 2])).unwrap().read(view, &[0; 64], 8, out)
    };
    let format = SourceFormat::Grey;
    assert_eq!(read(format.into(), 1, &mut out), Err(UnpackError::View { format, views: 1, view: 1 }));
    let format = SourceFormat::Y8Interleaved;
    assert_eq!(read(format.into(), 2, &mut out), Err(UnpackError::View { format, views: 2, view: 2 }));
    assert_eq!(read(format.into(), 1, &mut out), Ok(()));
}
