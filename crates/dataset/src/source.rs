//! Images as cameras sent them: the field `source` of `meta.json`, and how the files become grey images.
//!
//! In: `phase_00.raw`, the rows of a camera format without gaps, or a PNG with the values of a mosaic or with colours.
//! Out: the grey image of one camera, converted as live. Region and binning of the field `readout` act here.

use std::path::Path;

use serde::{Deserialize, Serialize};

use fringeflow::geometry::Readout;
use fringeflow_base::grey::PixelFormat;
use fringeflow_pixels::{BayerGrey, DeviceImages, ImageReader, SourceFormat, StereoLayout};

use super::error::Problem;
use super::fields::field_problem;
use super::image::{GreyImage, read_grey, read_rgb};
use super::image_files::is_of_source;

/// The field `source`.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSource {
    format: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    bayer: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stereo_layout: Option<String>,
}

impl From<DeviceImages> for RawSource {
    fn from(images: DeviceImages) -> Self {
        Self {
            format: images.format().name().to_owned(),
            bayer: images.bayer().map(|grey| grey.name().to_owned()),
            stereo_layout: images.layout().map(|layout| layout.name().to_owned()),
        }
    }
}

impl RawSource {
    /// Checks the field, and that images of this format can have the size of the sensor.
    pub(super) fn checked(&self, readout: &Readout) -> Result<DeviceImages, Problem> {
        let format = self.format.parse::<SourceFormat>();
        let format = format.map_err(|e| field_problem("source.format", e.to_string()))?;
        let bayer = BayerGrey::ALL.map(|grey| (grey.name(), grey));
        let layout = StereoLayout::ALL.map(|layout| (layout.name(), layout));
        let images = DeviceImages::new(
            format,
            self.bayer.as_deref().map(|name| one_of("source.bayer", name, &bayer)).transpose()?,
            self.stereo_layout.as_deref().map(|name| one_of("source.stereo_layout", name, &layout)).transpose()?,
        );
        let images = images.map_err(|e| field_problem("source", e.to_string()))?;
        ImageReader::new(images, *readout).map_err(|e| field_problem("source", e.to_string()))?;
        Ok(images)
    }
}

/// Returns the value with this name.
fn one_of<T: Copy>(field: &'static str, name: &str, known: &[(&str, T)]) -> Result<T, Problem> {
    let found = known.iter().find(|(known, _)| *known == name);
    let names = || known.iter().map(|(name, _)| *name).collect::<Vec<_>>();
    found
        .map(|(_, value)| *value)
        .ok_or_else(|| field_problem(field, format!("is {name:?}; it must be one of {:?}", names())))
}

/// Reads a file as the grey image of a view.
pub(super) fn read(path: &Path, images: DeviceImages, readout: Readout, view: usize) -> Result<GreyImage, Problem> {
    let refused = |e: String| Problem::SourceImage(e);
    let mut reader = ImageReader::new(images, readout).map_err(|e| refused(e.to_string()))?;
    let image_px = images.image_px(readout.sensor_px()).map_err(|e| refused(e.to_string()))?;
    let bytes = bytes_of(path, images.format(), image_px)?;
    let ([width, height], format) = (reader.image_size_px(), reader.pixel_format());
    let mut pixels = vec![0; reader.image_bytes()];
    let stride_bytes = images.format().least_stride_bytes(image_px[0]);
    reader.read(view, &bytes, stride_bytes, &mut pixels).map_err(|e| refused(e.to_string()))?;
    Ok(GreyImage { width, height, format, pixels })
}

/// Reads the bytes of an image without gaps.
fn bytes_of(path: &Path, format: SourceFormat, [width, height]: [usize; 2]) -> Result<Vec<u8>, Problem> {
    if is_of_source(path) {
        let bytes = std::fs::read(path).map_err(Problem::Unreadable)?;
        let (expected, found) = (format.whole_bytes([width, height]), bytes.len());
        if !format.is_compressed() && found != expected {
            return Err(Problem::RawLength { format, width, height, found, expected });
        }
        return Ok(bytes);
    }
    let stored = PixelFormat::ALL.into_iter().find(|&stored| format.stores_values_as(stored));
    match (format, stored) {
        (_, Some(stored)) => read_grey(path, Some([width, height]), Some(stored)).map(|image| image.pixels),
        (SourceFormat::Rgb24, _) => read_rgb(path, [width, height]),
        _ => Err(Problem::NotAPng { format }),
    }
}
