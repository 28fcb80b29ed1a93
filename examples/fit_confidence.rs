//! Fits the confidence model to datasets with exact ground truth, and prints its curves in the form of
//! `src/correspondence/semi_global/confidence.rs`.
//!
//! ```text
//! for sd in 0.041 0.42; do for object in plane prism machine nose elephant clutter crumbs; do
//!     fringeflow simulate -o scenes/$object-$sd --object $object --steps 4 --sd $sd
//!     fringeflow simulate -o scenes/$object-$sd-deep --object $object --steps 4 --sd $sd --depth 110
//!     fringeflow simulate -o scenes/$object-$sd-noisy --object $object --steps 3 --sd $sd --noise high
//!     fringeflow simulate -o scenes/$object-$sd-small --object $object --steps 4 --sd $sd --size 320x256 --board dark
//! done; done
//! rm -r scenes/clutter-0.42-deep
//! for object in prism machine nose elephant clutter tooth; do for board in 10 60 200; do
//!     fringeflow simulate -o scenes/$object-board-$board --object $object --steps 4 --board $board
//! done; done
//! for board in -30 -12; do
//!     fringeflow simulate -o scenes/board$board --object elephant --steps 4 --board=$board
//! done
//! for object in elephant prism; do fringeflow simulate -o scenes/$object-hand --object $object --steps 4 --hand; done
//! cargo run --release --example fit_confidence -- scenes/*
//! ```
//!
//! One scene is left out: with ten times the usual calibration error and twenty periods on a segment, the drift itself
//! is not found, and no pixel can show that.
//!
//! In: for every pixel with a selected candidate its grounds, and from the ground truth whether the candidate is false.
//! Out: the log odds of maximum likelihood (logistic regression by Newton's method). A slight ridge penalty draws them
//! towards zero; it also decides how a constant is divided among the curves.

#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a program for people")]

use std::error::Error;
use std::path::Path;

use nalgebra::{DMatrix, DVector};

use fringeflow::correspondence::{CONFIDENCE_TERMS, SegmentTable, match_phases_with_grounds};
use fringeflow::phase::PhaseShifts;
use fringeflow::reconstruction::{Reconstructor, Settings};
use fringeflow_dataset::{CameraId, Dataset, GreyImage, Truth};
use fringeflow_lab::evaluation::{Frames, Judgement, against_rendered};

/// True points are many and similar: one in this number is sampled, with this weight.
const THINNING: usize = 20;
/// Ridge penalty that draws every value towards zero, in points.
const RIDGE: f64 = 10.0;
/// Newton steps; the last ones change nothing.
const NEWTON_STEPS: usize = 25;

type Terms = [f32; CONFIDENCE_TERMS];

/// A point of a scene.
struct Sample {
    /// Its grounds, as terms of the model.
    terms: Terms,
    is_true: bool,
    /// Number of points that it represents.
    weight: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut samples = Vec::new();
    for folder in std::env::args().skip(1) {
        let before = samples.len();
        match add_samples(Path::new(&folder), &mut samples) {
            Ok(points) => eprintln!("{folder}: {points} points, {} samples", samples.len() - before),
            Err(e) => eprintln!("{folder}: left out: {e}"),
        }
    }
    if samples.is_empty() {
        return Err(
            "no samples; name dataset folders with exact ground truth, as fringeflow simulate writes them".into()
        );
    }
    let values = fit(&samples).ok_or("the samples do not determine the model; add more scenes")?;
    print_curves(&values);
    print_calibration(&samples, &values);
    Ok(())
}

/// Adds the samples of a dataset. Returns the number of its points.
fn add_samples(folder: &Path, samples: &mut Vec<Sample>) -> Result<usize, Box<dyn Error>> {
    let dataset = Dataset::open(folder, None)?;
    let Some(Truth::Rendered(truth)) = dataset.truth()? else { return Err("it has no exact ground truth".into()) };
    let setup = &dataset.setup;
    let volume = setup.volume.ok_or("it has no measurement volume")?;
    let shifts_rad = &setup.sequence.shifts_rad;
    let image_numbers: Vec<usize> = (0..shifts_rad.len()).collect();

    let mut settings = Settings::default();
    // Keep all points: the model is fitted to doubtful ones too.
    settings.matching.min_confidence = 0.0;
    let table = SegmentTable::build(&setup.rig, &volume, &setup.sequence.pattern)?;
    let mut reconstructor =
        Reconstructor::new(&setup.rig, &setup.sequence.pattern, table, &PhaseShifts::new(shifts_rad)?, settings)?;
    let [cam1, cam2] = CameraId::BOTH.map(|camera| dataset.phase_images(camera, &image_numbers));
    let result = reconstructor.reconstruct(0, &GreyImage::levels_of(&cam1?), &GreyImage::levels_of(&cam2?), None)?;
    let (_, grounds) =
        match_phases_with_grounds(&result.cam1, &result.cam2, reconstructor.table(), &settings.matching)?;

    let judgements =
        against_rendered(&result.cloud, setup.image_size_px, &truth, &Frames::from_setup(setup))?.judgements;
    let has_point = |pixel: &usize| result.matches.outcomes[*pixel].is_found();
    for (index, pixel) in (0..judgements.len()).filter(has_point).enumerate() {
        let is_true = !judgements[pixel].is_false();
        if judgements[pixel] == Judgement::Unjudged || (is_true && !index.is_multiple_of(THINNING)) {
            continue;
        }
        let weight = if is_true { THINNING as f64 } else { 1.0 };
        samples.push(Sample { terms: grounds[pixel].terms(), is_true, weight });
    }
    Ok(result.cloud.points.len())
}

/// Finds the values of maximum likelihood. Returns `None` if the samples do not determine them.
fn fit(samples: &[Sample]) -> Option<DVector<f64>> {
    let mut values = DVector::zeros(CONFIDENCE_TERMS);
    for _ in 0..NEWTON_STEPS {
        let mut hessian = DMatrix::identity(CONFIDENCE_TERMS, CONFIDENCE_TERMS) * RIDGE;
        let mut gradient = &values * -RIDGE;
        for sample in samples {
            let p = probability(sample, &values);
            let pull = sample.weight * (f64::from(u8::from(sample.is_true)) - p);
            let curvature = sample.weight * p * (1.0 - p);
            // Most terms are zero.
            let nonzero: Vec<(usize, f64)> =
                sample.terms.iter().enumerate().filter(|(_, t)| **t != 0.0).map(|(i, &t)| (i, t.into())).collect();
            for &(i, a) in &nonzero {
                gradient[i] += pull * a;
                nonzero.iter().for_each(|&(j, b)| hessian[(i, j)] += curvature * a * b);
            }
        }
        values += hessian.cholesky()?.solve(&gradient);
    }
    Some(values)
}

fn probability(sample: &Sample, values: &DVector<f64>) -> f64 {
    let nats: f64 = sample.terms.iter().zip(values).map(|(&term, value)| f64::from(term) * value).sum();
    1.0 / (1.0 + (-nats).exp())
}

/// Prints the values of all curves in one line, one curve after the other.
fn print_curves(values: &DVector<f64>) {
    let rounded: Vec<String> = values.iter().map(|value| format!("{value:.2}")).collect();
    println!("{}", rounded.join(", "));
}

/// Prints, for each range of stated probability, the share of points that are true.
fn print_calibration(samples: &[Sample], values: &DVector<f64>) {
    const EDGES: [f64; 12] = [0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 0.999, 1.01];
    for edges in EDGES.windows(2) {
        let (mut points, mut stated, mut found) = (0.0, 0.0, 0.0);
        for sample in samples {
            let p = probability(sample, values);
            if (edges[0]..edges[1]).contains(&p) {
                points += sample.weight;
                stated += sample.weight * p;
                found += sample.weight * f64::from(u8::from(sample.is_true));
            }
        }
        println!("{:.3}: {points:>9} points, stated {:.4}, true {:.4}", edges[0], stated / points, found / points);
    }
}
