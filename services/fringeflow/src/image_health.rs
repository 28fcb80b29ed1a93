//! What the images of an input show by themselves: whether they hold fringes, well exposed. In: the first cycle. Out:
//! faults. Cost: decoding one cycle.

use fringeflow::phase::{PhaseShifts, ShiftError};
use fringeflow::worker::{PhasePair, PhaseWorker};
use fringeflow_config::Configuration;
use fringeflow_dataset::{GreyImage, Setup};
use fringeflow_telemetry::HealthFigures;
use fringeflow_telemetry::health::HealthLimits;
use fringeflow_wire::health::image_measures;
use fringeflow_wire::maps::fit;

use crate::failure::Failure;
use crate::images::Images;
use crate::input::Input;
use crate::statistics::faults;

/// The health of decoded images, without a result.
pub(crate) fn image_health(maps: &PhasePair, limits: &HealthLimits) -> HealthFigures {
    let fits = [&maps.cam1, &maps.cam2].map(fit);
    HealthFigures::of_window(&image_measures([&fits[0], &fits[1]], 0), limits)
}

/// What is wrong with the images of the first cycle of an input, a line each.
pub(crate) fn image_faults(input: &Input, configuration: &Configuration) -> Result<Vec<String>, Failure> {
    let images = Images::consecutive(input, input.cycles()?.swap_remove(0))?;
    image_faults_of(&input.images(&images.numbers)?, input.setup(), configuration).map_err(|e| input.unusable(&e))
}

/// What is wrong with a cycle of images of both cameras, which may begin at any step.
///
/// # Errors
/// The phase shifts determine no phase.
pub(crate) fn image_faults_of(
    [cam1, cam2]: &[Vec<GreyImage>; 2],
    setup: &Setup,
    configuration: &Configuration,
) -> Result<Vec<String>, ShiftError> {
    let shifts = PhaseShifts::new(setup.cycle_shifts_rad())?;
    let validity = configuration.settings.validity;
    let mut worker = PhaseWorker::new(&setup.rig, &setup.sequence.pattern, &shifts, validity);
    let [cam1, cam2] = [cam1, cam2].map(|images| GreyImage::levels_of(images));
    let mut maps = PhasePair::default();
    Ok(match worker.step(0, &cam1, &cam2, None, &mut maps) {
        Ok(()) => faults(&image_health(&maps, &configuration.health), None),
        Err(error) => vec![error.to_string()],
    })
}
