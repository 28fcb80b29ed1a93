//! Regions and binning, pixel by pixel.

use fringeflow::geometry::Readout;
use fringeflow_base::grey::{GreyLevels, PixelFormat};

use crate::{ImageReader, SourceFormat};

use super::{raw_formats, unpack, values_of};

const SENSOR_PX: [usize; 2] = [72, 50];
/// A region with odd corners, and the whole image.
const REGIONS: [Option<[usize; 4]>; 2] = [Some([11, 7, 52, 38]), None];

/// Returns the bytes of an image whose rows have gaps, and its stride.
fn source(format: SourceFormat) -> (Vec<u8>, usize) {
    let stride_bytes = format.least_stride_bytes(SENSOR_PX[0]) + 10;
    let len = format.least_bytes(SENSOR_PX, stride_bytes);
    let mut bytes: Vec<u8> = (0..len).map(|i| (i * i / 7 + i * 31) as u8).collect();
    // Cameras do not set bits beyond their depth.
    if format.pixel_format().bytes() == 2 && format.samples() == format.pixel_format().into() {
        for value in bytes.as_chunks_mut::<2>().0 {
            *value = (u16::from_le_bytes(*value) & format.pixel_format().max_value()).to_le_bytes();
        }
    }
    (bytes, stride_bytes)
}

fn greys(format: PixelFormat, bytes: &[u8]) -> Vec<f32> {
    let levels = GreyLevels { format, bytes };
    (0..levels.pixels()).map(|pixel| levels.grey(pixel)).collect()
}

#[test]
fn each_pixel_is_the_mean_of_its_square() {
    for format in raw_formats() {
        let (bytes, stride_bytes) = source(format);
        let pixel_format = format.pixel_format();
        let mut whole = vec![0; SENSOR_PX[0] * SENSOR_PX[1] * pixel_format.bytes()];
        unpack(format, &bytes, stride_bytes, SENSOR_PX, &mut whole).unwrap();
        let whole = greys(pixel_format, &whole);
        for (region, binning) in REGIONS.into_iter().flat_map(|region| [(region, 1), (region, 2)]) {
            let readout = Readout::new(SENSOR_PX, region, binning).unwrap();
            let mut reader = ImageReader::new(values_of(format), readout).unwrap();
            let mut out = vec![0xaa; reader.image_bytes()];
            reader.read(0, &bytes, stride_bytes, &mut out).unwrap();
            let (found, [width, height]) = (greys(reader.pixel_format(), &out), readout.image_size_px());
            let [x, y, ..] = readout.region();
            for (v, u) in (0..height).flat_map(|v| (0..width).map(move |u| (v, u))) {
                let at = |dv: usize, du: usize| whole[(y + v * binning + dv) * SENSOR_PX[0] + x + u * binning + du];
                let mean = match binning {
                    1 => at(0, 0),
                    _ => (at(0, 0) + at(0, 1) + at(1, 0) + at(1, 1)) / 4.0,
                };
                // Only the means of 16-bit values are rounded.
                let error = (found[v * width + u] - mean).abs();
                let tolerance = if reader.pixel_format() == PixelFormat::Y16 { 0.5 / 256.0 } else { 0.0 };
                assert!(error <= tolerance, "{format}, {region:?} / {binning}, {u}, {v}: error {error}");
            }
        }
    }
}

#[test]
fn short_buffers_are_refused() {
    let readout = Readout::new(SENSOR_PX, REGIONS[0], 2).unwrap();
    for format in raw_formats() {
        let (bytes, stride_bytes) = source(format);
        let mut reader = ImageReader::new(values_of(format), readout).unwrap();
        let mut out = vec![0; reader.image_bytes()];
        assert!(reader.read(0, &bytes[..bytes.len() - 1], stride_bytes, &mut out).is_err(), "{format}");
        assert!(reader.read(0, &bytes, format.least_stride_bytes(SENSOR_PX[0]) - 1, &mut out).is_err(), "{format}");
        assert!(reader.read(0, &bytes, stride_bytes, &mut out[1..]).is_err(), "{format}");
    }
}
