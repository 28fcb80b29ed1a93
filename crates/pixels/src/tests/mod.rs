mod jpeg;
mod layouts;
mod mosaic;
mod read_out;
mod sizes;
mod stereo;

use fringeflow::geometry::Readout;

use super::{BayerGrey, DeviceImages, ImageReader, SourceFormat, UnpackError};

/// Formats that are not compressed.
fn raw_formats() -> impl Iterator<Item = SourceFormat> {
    SourceFormat::ALL.into_iter().filter(|format| !format.is_compressed())
}

/// One view in each image; of a mosaic, its values.
fn values_of(format: SourceFormat) -> DeviceImages {
    DeviceImages::new(format, format.bayer_order().map(|_| BayerGrey::Raw), None).unwrap()
}

/// Converts a whole image.
fn unpack(
    format: SourceFormat,
    source: &[u8],
    stride_bytes: usize,
    size_px: [usize; 2],
    out: &mut [u8],
) -> Result<(), UnpackError> {
    ImageReader::new(values_of(format), Readout::whole(size_px)).unwrap().read(0, source, stride_bytes, out)
}

/// A generator of numbers for images.
fn numbers(seed: u64) -> impl FnMut() -> u16 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 48) as u16
    }
}

/// Numbers behind the bytes of a converted image.
fn numbers_of(bytes_of_a_value: usize, bytes: &[u8]) -> Vec<u16> {
    match bytes_of_a_value {
        1 => bytes.iter().map(|&byte| byte.into()).collect(),
        _ => bytes.chunks_exact(2).map(|two| u16::from_le_bytes([two[0], two[1]])).collect(),
    }
}
