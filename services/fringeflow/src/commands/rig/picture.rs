//! The maps of the report as grey images, a pixel of the grid each.

use std::path::Path;

use fringeflow::dataset::{GreyImage, Problem, write_png};
use fringeflow::rig_report::{Evaluation, PixelMap};

use crate::failure::Failure;

/// Refuses a folder that is not there, before the report is computed.
pub(super) fn check_folder(folder: &Path) -> Result<(), Failure> {
    let missing = || Failure::Usage(format!("--preview {}: is not a folder; create it first", folder.display()));
    folder.is_dir().then_some(()).ok_or_else(missing)
}

/// Writes `periods.png` and `survivors.png`.
pub(super) fn write(folder: &Path, evaluation: &Evaluation) -> Result<(), Failure> {
    let maps = [("periods.png", &evaluation.periods_map), ("survivors.png", &evaluation.survivors_map)];
    for (name, map) in maps {
        let file = folder.join(name);
        write_png(&file, &image(map)).map_err(|problem: Problem| Failure::Picture { file, problem })?;
    }
    Ok(())
}

/// Grey levels 55 to 255 from 0 to the largest figure; black where there is none.
fn image(map: &PixelMap) -> GreyImage {
    let max = map.values.iter().flatten().copied().fold(f64::MIN_POSITIVE, f64::max);
    let grey = |value: &Option<f64>| value.map_or(0, |v| 55 + (200.0 * v / max).round() as u8);
    GreyImage { width: map.width, height: map.height, pixels: map.values.iter().map(grey).collect() }
}
