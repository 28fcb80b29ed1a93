//! Fits the model of the confidence to datasets with exact truth, and prints its curves as
//! `src/correspondence/semi_global/confidence.rs` has them.
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
//! One scene is left out: where ten times the usual error meets twenty periods on a segment, the drift itself is not found, which
//! no pixel can tell.
//!
//! Of every pixel with a selected candidate the grounds are known, and by the truth of the scene whether it is false. The
//! logarithms of the odds are those of the greatest likelihood (logistic regression by Newton's method), drawn slightly
//! towards zero, which also settles what a constant is shared out among the curves.

#![expect(clippy::print_stdout, clippy::print_stderr, reason = "it prints what it finds")]

use std::error::Error;
use std::path::Path;

use nalgebra::{DMatrix, DVector};

use fringeflow::correspondence::{CONFIDENCE_TERMS, SegmentTable, match_phases_with_grounds};
use fringeflow::phase::PhaseShifts;
use fringeflow::reconstruction::{Reconstructor, Settings};
use fringeflow_dataset::{CameraId, Dataset, GreyImage, Truth};
use fringeflow_lab::evaluation::{Frames, Judgement, against_rendered};

/// True points are many and alike: one of so many is taken, and counts for all of them.
const THINNING: usize = 20;
/// Weight, in points, by which every value is drawn to zero.
const RIDGE: f64 = 10.0;
/// Newton's steps; the last ones change nothing.
const STEPS: usize = 25;

type Terms = [f32; CONFIDENCE_TERMS];

/// Grounds, whether the point is true, and for how many points it stands.
struct Sample {
    terms: Terms,
    is_true: bool,
    weight: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut samples = Vec::new();
    for folder in std::env::args().skip(1) {
        let before = samples.len();
        match take(Path::new(&folder), &mut samples) {
            Ok(points) => eprintln!("{folder}: {points} points, {} samples", samples.len() - before),
            Err(e) => eprintln!("{folder}: left out: {e}"),
        }
    }
    if samples.is_empty() {
        return Err("no sample; give dataset folders with exact truth, as fringeflow simulate writes them".into());
    }
    let values = fit(&samples).ok_or("the samples do not determine the model; give more scenes")?;
    print(&values);
    print_calibration(&samples, &values);
    Ok(())
}

/// Adds the samples of a dataset; the number of its points.
fn take(folder: &Path, samples: &mut Vec<Sample>) -> Result<usize, Box<dyn Error>> {
    let dataset = Dataset::open(folder, None)?;
    let Some(Truth::Rendered(truth)) = dataset.truth()? else { return Err("it has no exact truth".into()) };
    let setup = &dataset.setup;
    let volume = setup.volume.clone().ok_or("it has no measurement volume")?;
    let shifts_rad = &setup.sequence.shifts_rad;
    let numbers: Vec<usize> = (0..shifts_rad.len()).collect();

    let mut settings = Settings::default();
    settings.matching.min_confidence = 0.0;
    let table = SegmentTable::build(&setup.rig, &volume, &setup.sequence.pattern)?;
    let mut reconstructor =
        Reconstructor::new(&setup.rig, &setup.sequence.pattern, table, &PhaseShifts::new(shifts_rad)?, settings)?;
    let [cam1, cam2] = CameraId::BOTH.map(|camera| dataset.phase_images(camera, &numbers));
    let made = reconstructor.reconstruct(0, &GreyImage::levels_of(&cam1?), &GreyImage::levels_of(&cam2?), None)?;
    let (_, grounds) = match_phases_with_grounds(&made.cam1, &made.cam2, reconstructor.table(), &settings.matching)?;

    let judgements = against_rendered(&made.cloud, setup.image_size_px, &truth, &Frames::from_setup(setup))?.judgements;
    let is_judged = |pixel: &usize| made.matches.outcomes[*pixel].is_found();
    for (place, pixel) in (0..judgements.len()).filter(is_judged).enumerate() {
        let is_true = !judgements[pixel].is_false();
        if judgements[pixel] == Judgement::Unjudged || (is_true && !place.is_multiple_of(THINNING)) {
            continue;
        }
        let weight = if is_true { THINNING as f64 } else { 1.0 };
        samples.push(Sample { terms: grounds[pixel].terms(), is_true, weight });
    }
    Ok(made.cloud.points.len())
}

/// The values of greatest likelihood; `None` if nothing determines them.
fn fit(samples: &[Sample]) -> Option<DVector<f64>> {
    let mut values = DVector::zeros(CONFIDENCE_TERMS);
    for _ in 0..STEPS {
        let mut hessian = DMatrix::identity(CONFIDENCE_TERMS, CONFIDENCE_TERMS) * RIDGE;
        let mut gradient = &values * -RIDGE;
        for sample in samples {
            let p = probability(sample, &values);
            let pull = sample.weight * (f64::from(u8::from(sample.is_true)) - p);
            let curvature = sample.weight * p * (1.0 - p);
            let used: Vec<(usize, f64)> =
                sample.terms.iter().enumerate().filter(|(_, t)| **t != 0.0).map(|(i, &t)| (i, t.into())).collect();
            for &(i, a) in &used {
                gradient[i] += pull * a;
                used.iter().for_each(|&(j, b)| hessian[(i, j)] += curvature * a * b);
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

/// One line a curve: its values lie one after the other.
fn print(values: &DVector<f64>) {
    let rounded: Vec<String> = values.iter().map(|value| format!("{value:.2}")).collect();
    println!("{}", rounded.join(", "));
}

/// How often points are true that are said to be so with a probability.
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
