//! JPEG images, compressed with libjpeg at quality 95 from the luma below, and damaged ones.

use proptest::prelude::*;

use crate::{SourceFormat, UnpackError};

use super::unpack;

const SIZE_PX: [usize; 2] = [80, 72];
const GREY: &[u8] = include_bytes!("grey.jpg");
/// Colours at half the width and height.
const COLOUR: &[u8] = include_bytes!("colour_420.jpg");
/// Colours at half the width; without Huffman tables, as sent by many cameras.
const WITHOUT_TABLES: &[u8] = include_bytes!("colour_422_without_tables.jpg");
const PROGRESSIVE: &[u8] = include_bytes!("progressive.jpg");

fn luma() -> impl Iterator<Item = u8> {
    (0..SIZE_PX[1]).flat_map(|v| (0..SIZE_PX[0]).map(move |u| (20 + 2 * u + v) as u8))
}

/// Decodes twice, into zeros and into ones, to check that all bytes are written.
fn decoded(source: &[u8], size_px: [usize; 2]) -> Result<Vec<u8>, UnpackError> {
    let [one, other] = [0, 255].map(|before| {
        let mut out = vec![before; size_px[0] * size_px[1]];
        unpack(SourceFormat::Mjpeg, source, 0, size_px, &mut out).map(|()| out)
    });
    assert_eq!(one, other, "some bytes were not written");
    one
}

#[test]
fn decoding_restores_the_luma() {
    for image in [GREY, COLOUR, WITHOUT_TABLES] {
        let difference = decoded(image, SIZE_PX).unwrap().into_iter().zip(luma()).map(|(a, b)| a.abs_diff(b)).max();
        assert!(difference.is_some_and(|difference| difference <= 2), "{difference:?}");
        // Drivers pad the image.
        let padded = [image, &[0; 50]].concat();
        assert_eq!(decoded(&padded, SIZE_PX), decoded(image, SIZE_PX));
    }
}

#[test]
fn an_image_of_another_size_is_refused() {
    for expected_px in [[80, 71], [81, 72], [72, 80], [160, 144]] {
        assert_eq!(decoded(GREY, expected_px), Err(UnpackError::JpegSize { found_px: SIZE_PX, expected_px }));
    }
}

#[test]
fn a_truncated_image_is_refused() {
    for image in [GREY, COLOUR, WITHOUT_TABLES] {
        for length in 0..image.len() {
            assert!(decoded(&image[..length], SIZE_PX).is_err(), "{length} of {} bytes", image.len());
        }
        // Most of the scan is missing, but the end marker exists.
        let scan = image.len() - image.windows(2).rev().position(|mark| mark == [0xff, 0xda]).unwrap();
        let shortened = [&image[..scan + 20], &[0xff, 0xd9]].concat();
        assert!(decoded(&shortened, SIZE_PX).is_err());
    }
}

#[test]
fn other_kinds_of_images_are_refused() {
    let message = |image: &[u8]| decoded(image, SIZE_PX).unwrap_err().to_string();
    assert!(message(PROGRESSIVE).contains("it is coded as SOF2"), "{}", message(PROGRESSIVE));
    assert!(message(b"GIF89a").contains("a marker is missing"), "{}", message(b"GIF89a"));
    let twice = [&GREY[..GREY.len() - 2], &GREY[2..]].concat();
    assert!(message(&twice).contains("more than one scan"), "{}", message(&twice));
}

proptest! {
    #[test]
    fn no_changed_byte_causes_a_panic(
        which in 0..3_usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut image = [GREY, COLOUR, WITHOUT_TABLES][which].to_vec();
        for (index, byte) in changes {
            let index = index.index(image.len());
            image[index] = byte;
        }
        let _ = decoded(&image, SIZE_PX);
    }
}
