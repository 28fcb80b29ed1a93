//! Judging a cloud by the truth of its dataset.

use fringeflow::cloud::Cloud;
use fringeflow::dataset::{Dataset, Truth};
use fringeflow::evaluation::{Evaluation, Frames, against_captured, against_rendered};
use fringeflow::geometry::Pose;

use crate::failure::Failure;

/// Compares a cloud with the truth of its dataset; `None` where there is no truth.
pub(crate) fn evaluate(dataset: &Dataset, cloud: &Cloud) -> Result<Option<Evaluation>, Failure> {
    let evaluation = match dataset.truth()? {
        Some(Truth::Rendered(truth)) => against_rendered(cloud, dataset.setup.image_size_px, &truth, &frames(dataset)),
        Some(Truth::Captured(truth)) => against_captured(cloud, dataset.setup.image_size_px, &truth),
        None => return Ok(None),
    };
    evaluation.map(Some).map_err(|e| Failure::Usage(format!("{}: {e}", dataset.folder.display())))
}

/// The frames of the cloud and the truth; those of C1 where the dataset has no volume.
fn frames(dataset: &Dataset) -> Frames {
    let cam1_from_volume = dataset.setup.volume.as_ref().map_or_else(Pose::identity, |v| *v.cam1_from_volume());
    Frames {
        cam1_from_volume,
        exact_cam1_from_volume: dataset.setup.exact_cam1_from_volume.unwrap_or(cam1_from_volume),
        unit_m: dataset.setup.unit.in_metres(),
    }
}
