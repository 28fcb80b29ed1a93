//! Judging a cloud by the truth of its input.

use fringeflow::cloud::Cloud;
use fringeflow::dataset::Truth;
use fringeflow::evaluation::{Evaluation, Frames, against_captured, against_rendered};

use crate::failure::Failure;
use crate::input::Input;

/// Compares a cloud with the truth of its input; `None` where there is no truth.
pub(crate) fn evaluate(input: &Input, cloud: &Cloud) -> Result<Option<Evaluation>, Failure> {
    let setup = input.setup();
    let evaluation = match input.truth()? {
        Some(Truth::Rendered(truth)) => against_rendered(cloud, setup.image_size_px, &truth, &Frames::of(setup)),
        Some(Truth::Captured(truth)) => against_captured(cloud, setup.image_size_px, &truth),
        None => return Ok(None),
    };
    evaluation.map(Some).map_err(|e| input.unusable(&e))
}
