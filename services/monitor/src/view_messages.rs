//! Encodes small copies of images, phase maps, clouds and the model as binary messages for the page.
//!
//! A message consists of the length of its JSON header (`u32`, little-endian), the header, and the data. The header is
//! padded so that the data begins at a multiple of eight bytes. Nothing is compressed: a picture costs one pass over a
//! part of the pixels.

use serde_json::{Value, json};

use fringeflow::cloud::{RECORD_BYTES, decode_record};
use fringeflow_base::grey::PixelFormat;
use fringeflow_message::{Block, CloudHeader, FrameHeader, MODEL_POINT_BYTES, MapsHeader, ModelHeader};
use fringeflow_wire as wire;

/// Largest width of a picture, pixels.
const MAX_WIDTH_PX: usize = 320;
/// Largest number of points of a cloud.
const MAX_POINTS: usize = 40_000;
/// Largest absolute value of a quantized coordinate.
const MAX_STEPS: f32 = 32_767.0;

/// Size of a picture that takes every `stride`-th pixel of an image, horizontally and vertically.
struct Downsampling {
    stride: usize,
    width: usize,
    height: usize,
}

impl Downsampling {
    fn new(width_px: usize, height_px: usize) -> Self {
        let stride = width_px.div_ceil(MAX_WIDTH_PX).max(1);
        Self { stride, width: width_px / stride, height: height_px / stride }
    }

    /// Returns the values of the picture's pixels, given by column and row of the image.
    fn map<T>(&self, mut value: impl FnMut(usize, usize) -> T) -> Vec<T> {
        let mut values = Vec::with_capacity(self.width * self.height);
        for row in 0..self.height {
            values.extend((0..self.width).map(|column| value(column * self.stride, row * self.stride)));
        }
        values
    }
}

/// The pictures of one message.
#[derive(Debug, Default)]
pub(crate) struct Pictures {
    entries: Vec<Value>,
    data: Vec<u8>,
}

impl Pictures {
    /// Adds an image of a camera. An image that contradicts its header is ignored.
    pub(crate) fn add_frame(&mut self, header: &FrameHeader, image: &[u8]) {
        let Some(format) = PixelFormat::from_code(header.pixel_format) else { return };
        let [width, height, stride] =
            [header.width_px, header.height_px, header.stride_bytes].map(|number| number as usize);
        let is_consistent = width * format.bytes() <= stride && stride.checked_mul(height) == Some(image.len());
        let name = match header.camera {
            1 if is_consistent => "camera1",
            2 if is_consistent => "camera2",
            _ => return,
        };
        let downsampling = Downsampling::new(width, height);
        // Formats of more than eight bits show their upper eight.
        let shift = format.bits().saturating_sub(8);
        let grey = |u: usize, v: usize| match format.bytes() {
            1 => image[v * stride + u],
            _ => {
                let at = v * stride + 2 * u;
                (u16::from_le_bytes([image[at], image[at + 1]]) >> shift).min(255) as u8
            }
        };
        let values = downsampling.map(grey);
        self.add(name, "u8", &downsampling, &values, json!({}));
    }

    /// Adds phase and modulation of camera 1. Maps that contradict their header are ignored.
    pub(crate) fn add_maps(&mut self, header: &MapsHeader, payload: &[Block]) {
        let Ok([cam1, _]) = wire::maps::view(header, payload) else { return };
        let width = header.width_px as usize;
        let downsampling = Downsampling::new(width, header.height_px as usize);
        let if_valid = |value: &dyn Fn(usize) -> u8| {
            downsampling.map(|u, v| {
                let pixel = v * width + u;
                if cam1.valid[pixel] == 0 { 0 } else { value(pixel).max(1) }
            })
        };
        // From 65536 steps per turn to 254 codes, 1 to 254; code 0 means invalid.
        let phase = if_valid(&|pixel| 1 + ((u32::from(cam1.phase[pixel]) * 254) >> 16) as u8);
        let modulation = if_valid(&|pixel| (2.0 * cam1.modulation[pixel].grey()).round() as u8);
        self.add("phase", "u8", &downsampling, &phase, json!({}));
        self.add("modulation", "u8", &downsampling, &modulation, json!({}));
    }

    /// Adds the depth of a cloud at the pixels of camera 1, whose images have size `size_px`.
    pub(crate) fn add_depth(&mut self, records: &[u8], size_px: [usize; 2]) {
        let downsampling = Downsampling::new(size_px[0], size_px[1]);
        let mut depth_mm = vec![f32::NAN; downsampling.width * downsampling.height];
        for point in records.as_chunks::<RECORD_BYTES>().0.iter().map(decode_record) {
            let [u, v] = point.cam1_px.map(|pixel| usize::from(pixel) / downsampling.stride);
            if u < downsampling.width && v < downsampling.height {
                depth_mm[v * downsampling.width + u] = 1000.0 * point.position_m[2];
            }
        }
        let (nearest, farthest) = depth_mm.iter().fold((f32::MAX, f32::MIN), |(least, greatest), &z| {
            if z.is_nan() { (least, greatest) } else { (least.min(z), greatest.max(z)) }
        });
        if nearest > farthest {
            return;
        }
        // Code 0 means no point; the others count steps from the nearest depth.
        let step_mm = ((farthest - nearest) / 65_534.0).max(1e-6);
        let code = |z: f32| if z.is_nan() { 0 } else { 1 + ((z - nearest) / step_mm).round().min(65_534.0) as u16 };
        let codes: Vec<u8> = depth_mm.into_iter().flat_map(|z| code(z).to_le_bytes()).collect();
        self.add("depth", "u16", &downsampling, &codes, json!({"base_mm": nearest, "step_mm": step_mm}));
    }

    fn add(&mut self, name: &str, format: &str, downsampling: &Downsampling, values: &[u8], mut entry: Value) {
        entry["name"] = name.into();
        entry["format"] = format.into();
        entry["width"] = downsampling.width.into();
        entry["height"] = downsampling.height.into();
        entry["offset"] = self.data.len().into();
        self.entries.push(entry);
        self.data.extend_from_slice(values);
        pad(&mut self.data, 0);
    }

    /// Encodes the message; `None` if there are no pictures.
    pub(crate) fn message(self, id: u64, wall_ms: f64) -> Option<Vec<u8>> {
        let header = json!({"type": "pictures", "id": id, "wall_ms": wall_ms, "pictures": self.entries});
        (!self.entries.is_empty()).then(|| message(&header, &self.data))
    }
}

/// Encodes a cloud: evenly thinned, coordinates in whole steps from the centre. Returns `None` for an empty cloud.
pub(crate) fn cloud_message(header: &CloudHeader, records: &[u8], id: u64, wall_ms: f64) -> Option<Vec<u8>> {
    let records = records.as_chunks::<RECORD_BYTES>().0;
    let stride = records.len().div_ceil(MAX_POINTS).max(1);
    let point = |record| {
        let point = decode_record(record);
        PagePoint { position_m: point.position_m, intensity: point.intensity }
    };
    let points: Vec<PagePoint> = records.iter().step_by(stride).map(point).collect();
    points_message("cloud", header.points, &points, id, wall_ms)
}

/// Encodes the points of a model message like [`cloud_message`].
pub(crate) fn model_message(header: &ModelHeader, payload: &[u8], id: u64, wall_ms: f64) -> Option<Vec<u8>> {
    let float = |point: &[u8; MODEL_POINT_BYTES], at: usize| {
        f32::from_le_bytes([point[at], point[at + 1], point[at + 2], point[at + 3]])
    };
    let point = |point: &[u8; MODEL_POINT_BYTES]| PagePoint {
        position_m: [0, 4, 8].map(|at| float(point, at)),
        intensity: point[18],
    };
    let points: Vec<PagePoint> = payload.as_chunks().0.iter().map(point).collect();
    points_message("model", header.model_points, &points, id, wall_ms)
}

/// A point as the page draws it.
struct PagePoint {
    position_m: [f32; 3],
    intensity: u8,
}

/// Encodes `points` of a cloud or model that has `total_points`. Each coordinate becomes an `i16`, each intensity a
/// byte.
fn points_message(kind: &str, total_points: u64, points: &[PagePoint], id: u64, wall_ms: f64) -> Option<Vec<u8>> {
    let (mut least, mut greatest) = ([f32::MAX; 3], [f32::MIN; 3]);
    for point in points {
        for axis in 0..3 {
            least[axis] = least[axis].min(point.position_m[axis]);
            greatest[axis] = greatest[axis].max(point.position_m[axis]);
        }
    }
    let extent_m = (0..3).map(|axis| greatest[axis] - least[axis]).fold(0.0, f32::max);
    if points.is_empty() || !extent_m.is_finite() {
        return None;
    }
    let centre_m: [f32; 3] = std::array::from_fn(|axis| least[axis].midpoint(greatest[axis]));
    let step_m = (extent_m / (2.0 * MAX_STEPS)).max(1e-9);
    let mut data = Vec::with_capacity(points.len() * 7 + 8);
    for point in points {
        for axis in 0..3 {
            let steps = ((point.position_m[axis] - centre_m[axis]) / step_m).round().clamp(-MAX_STEPS, MAX_STEPS);
            data.extend_from_slice(&(steps as i16).to_le_bytes());
        }
    }
    let intensities = data.len();
    data.extend(points.iter().map(|point| point.intensity));
    let header = json!({
        "type": kind, "id": id, "wall_ms": wall_ms, "points": total_points, "shown": points.len(),
        "centre_m": centre_m, "step_m": step_m, "positions": 0, "intensities": intensities,
    });
    Some(message(&header, &data))
}

fn message(header: &Value, data: &[u8]) -> Vec<u8> {
    let mut header = header.to_string().into_bytes();
    while !(4 + header.len()).is_multiple_of(8) {
        header.push(b' ');
    }
    let mut message = Vec::with_capacity(4 + header.len() + data.len());
    message.extend_from_slice(&(header.len() as u32).to_le_bytes());
    message.extend_from_slice(&header);
    message.extend_from_slice(data);
    message
}

fn pad(bytes: &mut Vec<u8>, with: u8) {
    bytes.resize(bytes.len().next_multiple_of(8), with);
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow::cloud::{CloudPoint, write_records};

    /// Header and data of a message.
    fn split(message: &[u8]) -> (Value, &[u8]) {
        let length = u32::from_le_bytes(message[..4].try_into().unwrap()) as usize;
        assert_eq!((4 + length) % 8, 0);
        (serde_json::from_slice(&message[4..4 + length]).unwrap(), &message[4 + length..])
    }

    fn records(points: &[([f32; 3], [u16; 2])]) -> Vec<u8> {
        let point = |&(position_m, cam1_px): &([f32; 3], [u16; 2])| CloudPoint {
            position_m,
            intensity: 7,
            cam1_px,
            ..CloudPoint::default()
        };
        let mut bytes = Vec::new();
        write_records(&mut bytes, &points.iter().map(point).collect::<Vec<_>>()).unwrap();
        bytes
    }

    #[test]
    fn large_images_are_downsampled_and_deep_ones_shown_in_eight_bits() {
        let header = FrameHeader {
            width_px: 640,
            height_px: 4,
            stride_bytes: 1290,
            pixel_format: PixelFormat::Y12.code(),
            camera: 2,
            ..FrameHeader::default()
        };
        let mut image = vec![0; 4 * 1290];
        image[2 * 1290 + 4..2 * 1290 + 6].copy_from_slice(&0x0abc_u16.to_le_bytes());
        let mut pictures = Pictures::default();
        pictures.add_frame(&header, &image);
        pictures.add_frame(&FrameHeader { height_px: 5, ..header }, &image);
        let message = pictures.message(3, 0.0).unwrap();
        let (header, data) = split(&message);
        let [entry] = &header["pictures"].as_array().unwrap()[..] else { panic!("the second image is too short") };
        assert_eq!(
            (entry["name"].as_str(), entry["width"].as_u64(), entry["height"].as_u64()),
            (Some("camera2"), Some(320), Some(2))
        );
        assert_eq!((data[320 + 1], data.iter().filter(|&&grey| grey != 0).count()), (0xab, 1));
        assert!(Pictures::default().message(0, 0.0).is_none());
    }

    #[test]
    fn depth_stands_at_the_pixels_of_camera_1() {
        let mut pictures = Pictures::default();
        pictures.add_depth(&records(&[([0.0, 0.0, 0.3], [0, 0]), ([0.0, 0.0, 0.4], [2, 1])]), [4, 2]);
        let message = pictures.message(0, 0.0).unwrap();
        let (header, data) = split(&message);
        let entry = &header["pictures"][0];
        let depth_mm = |pixel: usize| match u16::from_le_bytes([data[2 * pixel], data[2 * pixel + 1]]) {
            0 => None,
            code => Some(entry["base_mm"].as_f64().unwrap() + f64::from(code - 1) * entry["step_mm"].as_f64().unwrap()),
        };
        assert!((depth_mm(0).unwrap() - 300.0).abs() < 0.01 && (depth_mm(6).unwrap() - 400.0).abs() < 0.01);
        assert_eq!((0..8).filter(|&pixel| depth_mm(pixel).is_none()).count(), 6);
    }

    #[test]
    fn a_decoded_cloud_is_exact_to_a_step() {
        let points: Vec<_> = (0..3 * MAX_POINTS).map(|i| ([i as f32 * 1e-6, -0.1, 0.25], [0, 0])).collect();
        let header = CloudHeader { points: points.len() as u64, ..CloudHeader::default() };
        let message = cloud_message(&header, &records(&points), 9, 0.0).unwrap();
        let (header, data) = split(&message);
        let shown = header["shown"].as_u64().unwrap() as usize;
        assert_eq!((shown, header["points"].as_u64()), (MAX_POINTS, Some(3 * MAX_POINTS as u64)));
        assert_eq!((data.len(), data[6 * shown]), (7 * shown, 7));
        for (index, (position_m, _)) in points.iter().step_by(3).enumerate() {
            for axis in 0..3 {
                let at = 6 * index + 2 * axis;
                let steps = f64::from(i16::from_le_bytes([data[at], data[at + 1]]));
                let found = header["centre_m"][axis].as_f64().unwrap() + steps * header["step_m"].as_f64().unwrap();
                assert!((found - f64::from(position_m[axis])).abs() < 2e-6);
            }
        }
        assert!(cloud_message(&CloudHeader::default(), &[], 0, 0.0).is_none());
    }
}
