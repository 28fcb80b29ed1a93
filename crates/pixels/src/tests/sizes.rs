//! Names and codes, and sizes that are refused.

use proptest::prelude::*;

use fringeflow_base::grey::PixelFormat;

use crate::{
    BayerGrey, BayerOrder, BayerSamples, DeviceImages, DeviceImagesError, SourceFormat, StereoLayout, UnpackError,
};

use super::{raw_formats, unpack};

#[test]
fn codes_and_names_are_those_of_v4l2() {
    for format in SourceFormat::ALL {
        assert_eq!(format.name().parse(), Ok(format));
        assert_eq!(SourceFormat::from_code(format.code()).unwrap().code(), format.code());
        // The packing of GenICam has no codes of its own.
        let has_code = format.name().len() <= 4 || format == SourceFormat::Y16BigEndian;
        assert_eq!(SourceFormat::from_code(format.code()) == Some(format), has_code, "{format}");
    }
    // V4L2_PIX_FMT_…, as computed by the header of the kernel.
    let codes = [
        ("GREY", 0x5945_5247),
        ("Y16", 0x2036_3159),
        ("Y16_BE", 0xa036_3159),
        ("Y10BPACK", 0x4230_3159),
        ("SBGGR8", 0x3138_4142),
        ("SGRBG10", 0x3031_4142),
        ("SGRBG10P", 0x4141_6770),
        ("SBGGR16", 0x3252_5942),
        ("Y8I", 0x2049_3859),
        ("XBGR32", 0x3432_5258),
        ("Mono10p", 0x5030_3159),
        ("BayerGR12p", 0x4343_6770),
    ];
    for (name, code) in codes {
        assert_eq!(name.parse::<SourceFormat>().unwrap().code(), code, "{name}");
    }
    assert_eq!("MJPEG".parse(), Ok(SourceFormat::Mjpeg));
    assert_eq!(SourceFormat::from_code(u32::from_le_bytes(*b"HSV3")), None);
    let refused = "grey".parse::<SourceFormat>().unwrap_err().to_string();
    assert!(refused.starts_with("\"grey\" is not a readable pixel format; it must be one of GREY, Y10, "), "{refused}");
    for format in PixelFormat::ALL {
        let source = SourceFormat::from(format);
        assert_eq!((source.pixel_format(), source.name(), source.code()), (format, format.name(), format.code()));
    }
}

#[test]
fn every_mosaic_has_names() {
    let samples =
        SourceFormat::ALL.map(|format| if let SourceFormat::Bayer(_, samples) = format { Some(samples) } else { None });
    let samples: Vec<BayerSamples> = samples.into_iter().flatten().collect();
    assert_eq!(samples.len(), 40);
    for order in BayerOrder::ALL {
        for &samples in &samples {
            let format = SourceFormat::Bayer(order, samples);
            assert_eq!(SourceFormat::ALL.into_iter().filter(|&known| known == format).count(), 1, "{format:?}");
            assert!(!samples.grey_format().name().is_empty());
        }
    }
}

#[test]
fn arrangements_that_do_not_fit_are_refused() {
    let images = |format: &str, layout| DeviceImages::new(format.parse().unwrap(), None, Some(layout));
    let (beside, below) = (StereoLayout::SideBySide, StereoLayout::TopBottom);
    let text = |refused: Result<[usize; 2], DeviceImagesError>| refused.unwrap_err().to_string();
    let odd = "an image of 1281 × 720 pixels cannot hold two views side-by-side: its width is odd";
    assert_eq!(text(images("GREY", beside).unwrap().view_px([1281, 720])), odd);
    assert!(text(images("MJPG", below).unwrap().view_px([1280, 721])).ends_with("top-bottom: its height is odd"));
    let cut = "two views of 322 × 240 pixels side-by-side cut a group of pixels that Y10P stores together; the side \
               that is divided must be a multiple of 4";
    assert_eq!(text(images("Y10P", beside).unwrap().image_px([322, 240])), cut);
    assert_eq!(text(images("Y10P", beside).unwrap().view_px([644, 240])), cut);
    assert!(text(images("YUYV", beside).unwrap().image_px([321, 240])).contains("multiple of 2"));
    assert!(text(images("RGGB", beside).unwrap().image_px([321, 240])).contains("multiple of 2"));
    assert!(text(images("RGGB", below).unwrap().image_px([320, 241])).contains("multiple of 2"));
    for (format, layout, view_px, image_px) in [
        ("GREY", beside, [321, 240], [642, 240]),
        ("YUYV", below, [321, 241], [321, 482]),
        ("RGGB", below, [321, 240], [321, 480]),
        ("Y12P", beside, [322, 240], [644, 240]),
    ] {
        let images = images(format, layout).unwrap();
        assert_eq!((images.image_px(view_px), images.view_px(image_px)), (Ok(image_px), Ok(view_px)), "{format}");
    }
    let refused = images("Y8I", beside).unwrap_err().to_string();
    assert!(refused.contains("remove the layout side-by-side"), "{refused}");
    let refused = DeviceImages::new(SourceFormat::Y12, Some(BayerGrey::Green), None).unwrap_err().to_string();
    assert_eq!(
        refused,
        "Y12 images are no Bayer mosaic: remove the choice \"green\", or use a Bayer format such as RGGB"
    );
    let green = DeviceImages::new("RGGB".parse().unwrap(), Some(BayerGrey::Green), None).unwrap();
    let refused = green.check_binning(2).unwrap_err().to_string();
    assert!(refused.contains("remove the choice \"green\", or use binning 1"), "{refused}");
    let interpolated = DeviceImages::new("RGGB".parse().unwrap(), Some(BayerGrey::Weighted), None).unwrap();
    let small = interpolated.image_px([1, 9]).unwrap_err().to_string();
    assert!(small.contains("a mosaic of 1 × 9 pixels is too small"), "{small}");
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
