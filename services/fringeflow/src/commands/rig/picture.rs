//! The maps of the report as grey images, one pixel per grid point.

use std::path::Path;

use fringeflow_dataset::{GreyImage, write_png};
use fringeflow_lab::rig_report::{Evaluation, PixelMap};
use fringeflow_message::PixelFormat;

use crate::failure::Failure;

/// Writes `periods.png` and `survivors.png`.
pub(super) fn write(folder: &Path, evaluation: &Evaluation) -> Result<(), Failure> {
    let maps = [("periods.png", &evaluation.periods_map), ("survivors.png", &evaluation.survivors_map)];
    for (name, map) in maps {
        write_png(&folder.join(name), &image(map))?;
    }
    Ok(())
}

/// Draws a map: grey levels 55 to 255 for values from 0 to the largest, black without a value.
fn image(map: &PixelMap) -> GreyImage {
    let max = map.values.iter().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
    let grey = |value: &Option<f64>| value.map_or(0, |v| 55 + (200.0 * v / max).round() as u8);
    let pixels = map.values.iter().map(grey).collect();
    GreyImage { width: map.width, height: map.height, format: PixelFormat::Grey, pixels }
}
