//! Runs the measurements.

use std::time::Instant;

use fringeflow_lab::paper_experiment::{Figures, Measurement, STEPS, Trial, Way, options};
use fringeflow_lab::preview::judgement_picture;
use fringeflow_lab::simulation::{Object, Simulation};

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
    let mut experiment = Experiment { seeds: extent.seeds(), size_px: extent.size_px(), ..Experiment::default() };
    for object in Object::PAPER {
        bar.set_message(object.name());
        let traced = Simulation::new(options(object, extent.size_px()))?;
        for seed in 1..=extent.seeds() {
            experiment.measure(&traced, seed)?;
            bar.inc(1);
        }
    }
    experiment.claims = sweep::measure_all(extent.objects_of_claims(), &points, extent.size_px(), &bar);
    bar.finish_and_clear();
    experiment.seconds = start.elapsed().as_secs_f64();
    Ok(experiment)
}

impl Experiment {
    /// Measures an object with a seed by every way with every number of steps.
    fn measure(&mut self, traced: &Simulation, seed: u64) -> Result<(), Failure> {
        // The images are removed when the seed is done.
        let folder = output_folder::temporary()?;
        let object = traced.options().object.name();
        let trial = match Trial::new(traced, seed, &folder.path().join("images")) {
            Ok(trial) => trial,
            Err(error) => {
                self.failures.push(format!("{object}, seed {seed}: {error}"));
                return Ok(());
            }
        };
        for (steps, way) in STEPS.into_iter().flat_map(|steps| Way::ALL.map(|way| (steps, way))) {
            match trial.measure(way, steps) {
                Ok(measurement) => self.add(measurement),
                Err(error) => {
                    self.failures.push(format!("{object}, seed {seed}, {steps} steps, {}: {error}", way.title()));
                }
            }
        }
        Ok(())
    }

    /// Adds a measurement. Of the first seed it keeps pictures of the judgements, by the ways that the paper and this
    /// program recommend.
    fn add(&mut self, Measurement { figures, judgements, size_px }: Measurement) {
        let Figures { object, seed, way, steps, .. } = figures;
        if seed == 1 && PICTURED.contains(&(way, steps)) {
            self.pictures.push(NamedPicture {
                name: format!("{object}-{}-{steps}.png", way.name()),
                title: format!("{object}, {} from {steps} images", way.title()),
                picture: judgement_picture(&judgements, size_px),
            });
        }
        self.measurements.push(figures);
    }
}
