//! Pictures of a reconstruction.

use std::path::{Path, PathBuf};

use fringeflow_base::atomic_file::check_writable;
use fringeflow_lab::preview::{
    Picture, confidence_picture, delta_histogram_picture, depth_picture, judgement_picture, modulation_picture,
    outcome_picture, phase_picture,
};

use crate::failure::Failure;
use crate::input::Input;
use crate::method::MethodOutput;
use crate::proposed::ProposedOutput;
use crate::truth;

/// Writes every picture that the method and the input allow to a folder. Writes none if one of the files is not
/// writable.
pub(crate) fn write(folder: &Path, input: &Input, output: &MethodOutput) -> Result<(), Failure> {
    let pictures: Vec<(PathBuf, Picture)> =
        draw(input, output)?.into_iter().map(|(name, picture)| (folder.join(name), picture)).collect();
    for (path, _) in &pictures {
        check_writable(path)?;
    }
    for (path, picture) in &pictures {
        picture.write_png(path)?;
    }
    Ok(())
}

fn draw(input: &Input, output: &MethodOutput) -> Result<Vec<(&'static str, Picture)>, Failure> {
    let size_px = input.setup().image_size_px;
    let mut pictures = vec![("depth.png", depth_picture(&output.cloud, size_px))];
    if let Some(ProposedOutput { reconstruction, .. }) = &output.proposed {
        let matches = &reconstruction.matches;
        let deltas: Vec<f32> = output.cloud.points.iter().map(|p| p.delta_rad).collect();
        pictures.extend([
            ("cam1-phase.png", phase_picture(&reconstruction.cam1)),
            ("cam2-phase.png", phase_picture(&reconstruction.cam2)),
            ("cam1-modulation.png", modulation_picture(&reconstruction.cam1)),
            ("cam2-modulation.png", modulation_picture(&reconstruction.cam2)),
            ("decisions.png", outcome_picture(&matches.outcomes, size_px)),
            ("confidence.png", confidence_picture(&output.cloud, size_px)),
            ("delta.png", delta_histogram_picture(&deltas, matches.delta.threshold_rad() as f32)),
        ]);
    }
    if let Some(evaluation) = truth::evaluate(input, &output.cloud, output.middle_image())? {
        pictures.push(("judgement.png", judgement_picture(&evaluation.judgements, size_px)));
    }
    Ok(pictures)
}
