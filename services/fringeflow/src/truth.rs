//! Judging a cloud by the truth of its input.

use fringeflow::cloud::Cloud;
use fringeflow::dataset::{Setup, Truth};
use fringeflow::evaluation::{Evaluation, Frames, against_captured, against_rendered};
use fringeflow::geometry::Pose;

use crate::failure::Failure;
use crate::input::Input;

/// Compares a cloud with the truth of its input; `None` where there is no truth.
pub(crate) fn evaluate(input: &Input, cloud: &Cloud) -> Result<Option<Evaluation>, Failure> {
    let setup = input.setup();
    let evaluation = match input.truth()? {
        Some(Truth::Rendered(truth)) => against_rendered(cloud, setup.image_size_px, &truth, &frames(setup)),
        Some(Truth::Captured(truth)) => against_captured(cloud, setup.image_size_px, &truth),
        None => return Ok(None),
    };
    evaluation.map(Some).map_err(|e| input.unusable(&e))
}

/// The frames of the cloud and the truth; those of C1 where there is no volume.
fn frames(setup: &Setup) -> Frames {
    let cam1_from_volume = setup.volume.as_ref().map_or_else(Pose::identity, |v| *v.cam1_from_volume());
    Frames {
        cam1_from_volume,
        exact_cam1_from_volume: setup.exact_cam1_from_volume.unwrap_or(cam1_from_volume),
        unit_m: setup.unit.in_metres(),
    }
}
