//! Names and codes, and sizes that are refused.

use proptest::prelude::*;

use fringeflow_base::grey::PixelFormat;

use crate::{SourceFormat, UnpackError, unpack};

use super::raw_formats;

#[test]
fn codes_and_names_are_those_of_v4l2() {
    for (index, format) in SourceFormat::ALL.into_iter().enumerate() {
        assert_eq!(format as usize, index);
        assert_eq!(SourceFormat::from_code(format.code()), Some(format));
        assert_eq!(format.name().parse(), Ok(format));
    }
    // V4L2_PIX_FMT_…, as computed by the header of the kernel.
    let codes = [("GREY", 0x5945_5247), ("Y16", 0x2036_3159), ("Y16_BE", 0xa036_3159), ("Y10BPACK", 0x4230_3159)];
    for (name, code) in codes {
        assert_eq!(name.parse::<SourceFormat>().unwrap().code(), code, "{name}");
    }
    assert_eq!("MJPEG".parse(), Ok(SourceFormat::Mjpeg));
    assert_eq!(SourceFormat::from_code(u32::from_le_bytes(*b"RGB3")), None);
    let refused = "grey".parse::<SourceFormat>().unwrap_err().to_string();
    assert!(refused.starts_with("\"grey\" is not a readable pixel format; it must be one of GREY, Y10, "), "{refused}");
    for format in PixelFormat::ALL {
        let source = SourceFormat::from(format);
        assert_eq!((source.pixel_format(), source.name(), source.code()), (format, format.name(), format.code()));
    }
}

#[test]
fn sizes_of_rows_and_images_are_correct() {
    let bytes = |name: &str, width_px| name.parse::<SourceFormat>().unwrap().least_stride_bytes(width_px);
    let of_1280 = ["GREY", "Y10", "Y10P", "Y12P", "Y14P", "YUYV", "NV12", "MJPG"].map(|name| bytes(name, 1280));
    assert_eq!(of_1280, [1280, 2560, 1600, 1920, 2240, 2560, 1280, 0]);
    // A row consists of whole groups.
    assert_eq!(["Y10P", "Y12P", "Y14P", "YUYV"].map(|name| bytes(name, 5)), [10, 9, 14, 12]);
    assert_eq!(SourceFormat::Y10Mipi.least_bytes([1280, 1024], 1664), 1023 * 1664 + 1600);
    assert_eq!(SourceFormat::Y16.least_bytes([usize::MAX, 2], usize::MAX), usize::MAX);
}

#[test]
fn wrong_sizes_are_refused_with_the_numbers() {
    let refused = |source: usize, stride_bytes, out: usize| {
        unpack(SourceFormat::Y10Mipi, &vec![0; source], stride_bytes, [8, 3], &mut vec![0; out]).unwrap_err()
    };
    let format = SourceFormat::Y10Mipi;
    let short = UnpackError::Short { format, width_px: 8, height_px: 3, stride_bytes: 16, found: 41, least: 42 };
    assert_eq!(refused(41, 16, 48), short);
    assert_eq!(refused(100, 9, 48), UnpackError::Stride { format, width_px: 8, stride_bytes: 9, least: 10 });
    for found in [47, 49, 24] {
        assert_eq!(
            refused(42, 16, found),
            UnpackError::Output { format, width_px: 8, height_px: 3, found, expected: 48 }
        );
    }
    assert!(unpack(format, &[0; 42], 16, [8, 3], &mut [0; 48]).is_ok());
}

proptest! {
    #[test]
    fn no_size_and_no_bytes_cause_a_panic(
        source in prop::collection::vec(any::<u8>(), 0..200),
        stride_bytes in prop_oneof![0..40_usize, any::<usize>()],
        width_px in prop_oneof![0..12_usize, any::<usize>()],
        height_px in prop_oneof![0..12_usize, any::<usize>()],
        out in 0..300_usize,
    ) {
        for format in SourceFormat::ALL {
            let _ = unpack(format, &source, stride_bytes, [width_px, height_px], &mut vec![0; out]);
        }
        for format in raw_formats().filter(|_| width_px < 12 && height_px < 12) {
            let mut buffer = vec![0; width_px * height_px * format.pixel_format().bytes()];
            let fits = stride_bytes >= format.least_stride_bytes(width_px)
                && source.len() >= format.least_bytes([width_px, height_px], stride_bytes);
            prop_assert_eq!(unpack(format, &source, stride_bytes, [width_px, height_px], &mut buffer).is_ok(), fits);
        }
    }
}
