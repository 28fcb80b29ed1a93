//! What the images of an input show by themselves: whether they hold fringes, well exposed. In: the first cycle. Out:
//! faults. Cost: decoding one cycle.

use fringeflow::phase::PhaseShifts;
use fringeflow::worker::{PhasePair, PhaseWorker};
use fringeflow_config::Configuration;
use fringeflow_dataset::GreyImage;
use fringeflow_telemetry::HealthFigures;
use fringeflow_telemetry::health::HealthLimits;
use fringeflow_wire::health::image_measures;
use fringeflow_wire::maps::fit;

use crate::failure::Failure;
use crate::input::Input;
use crate::proposed::Images;
use crate::statistics::faults;

/// The health of decoded images, without a result.
pub(crate) fn image_health(maps: &PhasePair, limits: &HealthLimits) -> HealthFigures {
    let fits = [&maps.cam1, &maps.cam2].map(fit);
    HealthFigures::of_window(&image_measures([&fits[0], &fits[1]], 0), limits)
}

/// What is wrong with the images of the first cycle, a line each.
pub(crate) fn image_faults(input: &Input, configuration: &Configuration) -> Result<Vec<String>, Failure> {
    let images = Images::consecutive(input, input.cycles()?.swap_remove(0))?;
    let shifts = PhaseShifts::new(images.cycle_rad()).map_err(|e| input.unusable(&e))?;
    let setup = input.setup();
    let validity = configuration.settings.validity;
    let mut worker = PhaseWorker::new(&setup.rig, &setup.sequence.pattern, &shifts, validity);
    let [cam1, cam2] = input.images(&images.numbers)?;
    let [cam1, cam2] = [&cam1, &cam2].map(|images| GreyImage::levels_of(images));
    let mut maps = PhasePair::default();
    Ok(match worker.step(images.first_step(), &cam1, &cam2, None, &mut maps) {
        Ok(()) => faults(&image_health(&maps, &configuration.health), None),
        Err(error) => vec![error.to_string()],
    })
}
