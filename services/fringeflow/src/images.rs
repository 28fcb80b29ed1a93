//! The phase images of one cloud, chosen from an input by number.

use std::ops::Range;

use fringeflow_config::Configuration;
use fringeflow_dataset::evenly_spaced;

use crate::failure::Failure;
use crate::input::Input;

/// Phase images of one cloud, by number, in the order of their exposures.
pub(crate) struct Images {
    pub(crate) numbers: Vec<usize>,
    /// Phase shifts of one cycle, rad. With more images than shifts, the reconstruction compensates motion.
    pub(crate) cycle_rad: Vec<f64>,
    /// Index of the first image in the cycle.
    pub(crate) first_step: usize,
}

impl Images {
    /// Consecutive images, which show the steps of the cycle in order. Fewer than a cycle count as a cycle of their
    /// own.
    ///
    /// # Errors
    /// The images do not show the steps in order.
    pub(crate) fn consecutive(input: &Input, images: Range<usize>) -> Result<Self, Failure> {
        let (numbers, shifts): (Vec<usize>, Vec<f64>) =
            images.filter_map(|number| Some((number, input.shift_rad(number)?))).unzip();
        let cycle_rad = input.setup().cycle_shifts_rad();
        if numbers.len() < cycle_rad.len() {
            return Ok(Self { numbers, cycle_rad: shifts, first_step: 0 });
        }
        let first_step = cycle_rad.iter().position(|shift| Some(shift) == shifts.first()).unwrap_or(0);
        match shifts.iter().zip(cycle_rad.iter().cycle().skip(first_step)).position(|(shift, next)| shift != next) {
            None => Ok(Self { numbers, cycle_rad: cycle_rad.to_vec(), first_step }),
            Some(place) => Err(input.unusable(&format!(
                "image {} has a phase shift of {} rad, which is not the next of its cycle; give --frames that show the \
                 steps in order",
                numbers[place], shifts[place]
            ))),
        }
    }

    /// Windows of an input, evenly spaced over it, at most `count`. With `steps`, each is thinned out to that many images;
    /// else it has the images beyond a cycle that the settings ask for.
    ///
    /// # Errors
    /// As the other constructors.
    pub(crate) fn windows(
        input: &Input,
        configuration: &Configuration,
        count: usize,
        steps: Option<usize>,
    ) -> Result<Vec<Self>, Failure> {
        let (cycles, cycle_steps) = (input.cycles()?, input.setup().steps);
        let extra = configuration.settings.window_images(cycle_steps) - cycle_steps;
        let images = |cycle: &Range<usize>| match steps {
            Some(steps) => Self::evenly_spaced(input, cycle.clone(), steps),
            None => Self::consecutive(input, input.widened(cycle.clone(), extra)),
        };
        cycles.iter().step_by(cycles.len().div_ceil(count)).map(images).collect()
    }

    /// `steps` of the images, evenly spaced, as a cycle of their own.
    ///
    /// # Errors
    /// `steps` does not divide the number of images.
    pub(crate) fn evenly_spaced(input: &Input, images: Range<usize>, steps: usize) -> Result<Self, Failure> {
        let numbers = evenly_spaced(images, steps).map_err(Failure::unusable)?;
        let cycle_rad = numbers.iter().filter_map(|&number| input.shift_rad(number)).collect();
        Ok(Self { numbers, cycle_rad, first_step: 0 })
    }
}
