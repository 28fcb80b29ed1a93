//! The pictures of a reconstruction.

use std::path::Path;

use fringeflow::dataset::Dataset;
use fringeflow::preview::{
    Picture, delta_histogram_picture, depth_picture, judgement_picture, modulation_picture, outcome_picture,
    phase_picture,
};

use crate::failure::Failure;
use crate::method::Made;
use crate::truth;

/// Writes all pictures that can be drawn into a folder.
pub(crate) fn write(folder: &Path, dataset: &Dataset, made: &Made) -> Result<(), Failure> {
    let size_px = dataset.image_size_px;
    let write = |name: &str, picture: Picture| picture.write_png(&folder.join(name));
    write("depth.png", depth_picture(&made.cloud, size_px))?;
    if let Some(reconstruction) = &made.reconstruction {
        for (name, map) in [("cam1", &reconstruction.cam1), ("cam2", &reconstruction.cam2)] {
            write(&format!("{name}-phase.png"), phase_picture(map))?;
            write(&format!("{name}-modulation.png"), modulation_picture(map))?;
        }
        let matches = &reconstruction.matches;
        write("decisions.png", outcome_picture(&matches.outcomes, size_px))?;
        let deltas: Vec<f32> = made.cloud.points.iter().map(|p| p.delta_rad).collect();
        write("delta.png", delta_histogram_picture(&deltas, matches.delta.threshold_rad() as f32))?;
    }
    if let Some(evaluation) = truth::evaluate(dataset, &made.cloud)? {
        write("judgement.png", judgement_picture(&evaluation.judgements, size_px))?;
    }
    Ok(())
}
