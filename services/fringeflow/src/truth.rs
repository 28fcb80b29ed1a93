//! Compares a cloud with the truth of its input.

use fringeflow::cloud::Cloud;
use fringeflow_dataset::Truth;
use fringeflow_lab::evaluation::{Evaluation, against_captured, against_rendered_at};

use crate::failure::Failure;
use crate::input::Input;

/// Compares a cloud with the truth of its input; returns `None` if the input has no truth.
///
/// `image` is the mean number of the images of the cloud, as the input numbers them. With `None` the cloud is taken to
/// show the object at the time of the truth.
pub(crate) fn evaluate(input: &Input, cloud: &Cloud, image: Option<f64>) -> Result<Option<Evaluation>, Failure> {
    let setup = input.setup();
    let reference = setup.motion.as_ref().map(|motion| motion.reference);
    let image = image.or(reference).unwrap_or_default();
    let evaluation = match input.truth()? {
        Some(Truth::Rendered(truth)) => against_rendered_at(cloud, setup, &truth, image),
        Some(Truth::Captured(_)) if reference.is_some_and(|reference| reference != image) => {
            let what = "a captured truth is valid only at field motion.t_ref; give --frames with their middle there";
            return Err(input.unusable(&what));
        }
        Some(Truth::Captured(truth)) => against_captured(cloud, setup.image_size_px, &truth),
        None => return Ok(None),
    };
    evaluation.map(Some).map_err(|e| input.unusable(&e))
}
