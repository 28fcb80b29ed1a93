//! The pictures of a reconstruction.

use std::path::{Path, PathBuf};

use fringeflow_base::atomic_file::check_writable;
use fringeflow_lab::preview::{
    Picture, confidence_picture, delta_histogram_picture, depth_picture, judgement_picture, modulation_picture,
    outcome_picture, phase_picture,
};

use crate::failure::Failure;
use crate::input::Input;
use crate::method::Made;
use crate::proposed::Proposed;
use crate::truth;

/// Writes all pictures that can be drawn into a folder, none if one of them cannot be written.
pub(crate) fn write(folder: &Path, input: &Input, made: &Made) -> Result<(), Failure> {
    let pictures: Vec<(PathBuf, Picture)> =
        draw(input, made)?.into_iter().map(|(name, picture)| (folder.join(name), picture)).collect();
    for (path, _) in &pictures {
        check_writable(path)?;
    }
    for (path, picture) in &pictures {
        picture.write_png(path)?;
    }
    Ok(())
}

fn draw(input: &Input, made: &Made) -> Result<Vec<(&'static str, Picture)>, Failure> {
    let size_px = input.setup().image_size_px;
    let mut pictures = vec![("depth.png", depth_picture(&made.cloud, size_px))];
    if let Some(Proposed { reconstruction, .. }) = &made.proposed {
        let matches = &reconstruction.matches;
        let deltas: Vec<f32> = made.cloud.points.iter().map(|p| p.delta_rad).collect();
        pictures.extend([
            ("cam1-phase.png", phase_picture(&reconstruction.cam1)),
            ("cam2-phase.png", phase_picture(&reconstruction.cam2)),
            ("cam1-modulation.png", modulation_picture(&reconstruction.cam1)),
            ("cam2-modulation.png", modulation_picture(&reconstruction.cam2)),
            ("decisions.png", outcome_picture(&matches.outcomes, size_px)),
            ("confidence.png", confidence_picture(&made.cloud, size_px)),
            ("delta.png", delta_histogram_picture(&deltas, matches.delta.threshold_rad() as f32)),
        ]);
    }
    if let Some(evaluation) = truth::evaluate(input, &made.cloud, made.image())? {
        pictures.push(("judgement.png", judgement_picture(&evaluation.judgements, size_px)));
    }
    Ok(pictures)
}
