//! Runs the measurements.

use std::time::Instant;

use fringeflow_lab::paper_experiment::{Figures, Measurement, STEPS, TracedObject, Trial, Way, options};
use fringeflow_lab::preview::judgement_picture;
use fringeflow_lab::simulation::Object;

use super::{Experiment, NamedPicture};
use crate::commands::evaluate::sweep;
use crate::failure::Failure;
use crate::output_folder;
use crate::progress;

/// Ways and numbers of steps with pictures.
const PICTURED: [(Way, usize); 2] = [(Way::PaPaper, 16), (Way::PaProduct, 4)];

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// The whole experiment: ten seeds.
    Whole,
    /// One seed and small images.
    Quick,
}

impl Extent {
    fn seeds(self) -> u64 {
        match self {
            Self::Whole => 10,
            Self::Quick => 1,
        }
    }

    fn size_px(self) -> [usize; 2] {
        match self {
            Self::Whole => [640, 512],
            Self::Quick => [400, 320],
        }
    }

    /// Objects before which the false candidates become more and more.
    fn objects_of_claims(self) -> &'static [Object] {
        match self {
            Self::Whole => &[Object::Elephant, Object::Machine, Object::Teeth],
            Self::Quick => &[Object::Elephant],
        }
    }
}

/// Runs the whole experiment, with a progress bar. A measurement that fails is listed.
pub(super) fn run(extent: Extent) -> Result<Experiment, Failure> {
    let start = Instant::now();
    let points = sweep::claims(extent == Extent::Quick);
    let scenes = Object::PAPER.len() as u64 * extent.seeds() + (points.len() * extent.objects_of_claims().len()) as u64;
    let bar = progress::bar("scenes", scenes);
    let (mut measurements, mut failures, mut pictures) = (Vec::new(), Vec::new(), Vec::new());
    for object in Object::PAPER {
        bar.set_message(object.name());
        let traced = TracedObject::new(options(object, extent.size_px()))?;
        for seed in 1..=extent.seeds() {
            measure(&traced, seed, (&mut measurements, &mut failures, &mut pictures))?;
            bar.inc(1);
        }
    }
    let claims = sweep::measure_all(extent.objects_of_claims(), &points, extent.size_px(), &bar);
    bar.finish_and_clear();
    let seconds = start.elapsed().as_secs_f64();
    let (seeds, size_px) = (extent.seeds(), extent.size_px());
    Ok(Experiment { seeds, size_px, seconds, measurements, claims, failures, pictures })
}

/// Keeps a picture of the judgements of the ways that the paper and this program recommend, for the first seed.
fn keep_picture(measurement: &Measurement, pictures: &mut Vec<NamedPicture>) {
    let Figures { object, seed, way, steps, .. } = measurement.figures;
    if seed == 1 && PICTURED.contains(&(way, steps)) {
        let name = format!("{object}-{}-{steps}.png", way.name());
        let title = format!("{object}, {} from {steps} images", way.title());
        pictures.push(NamedPicture {
            name,
            title,
            picture: judgement_picture(&measurement.judgements, measurement.size_px),
        });
    }
}

/// Measures an object with a seed by every way with every number of steps.
fn measure(
    traced: &TracedObject,
    seed: u64,
    (measurements, failures, pictures): (&mut Vec<Figures>, &mut Vec<String>, &mut Vec<NamedPicture>),
) -> Result<(), Failure> {
    // The images are removed when the seed is done.
    let folder = output_folder::temporary()?;
    let trial: Trial = match traced.trial(seed, &folder.path().join("images")) {
        Ok(trial) => trial,
        Err(error) => {
            failures.push(format!("{}, seed {seed}: {error}", traced.object().name()));
            return Ok(());
        }
    };
    for steps in STEPS {
        for way in Way::ALL {
            match trial.measure(way, steps) {
                Ok(measurement) => {
                    keep_picture(&measurement, pictures);
                    measurements.push(measurement.figures);
                }
                Err(error) => failures.push(format!(
                    "{}, seed {seed}, {steps} steps, {}: {error}",
                    traced.object().name(),
                    way.title()
                )),
            }
        }
    }
    Ok(())
}
