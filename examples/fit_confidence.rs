//! Fits the confidence model to scenes of the list to build with, and prints its factors in the form of
//! `src/correspondence/moments/confidence.rs`: `cargo run --release --example fit_confidence -- [scenes]`.
//!
//! In: for every point its grounds, and from the exact truth whether it is false. Out: the factors of maximum likelihood
//! (logistic regression by Newton's method), fitted to the scenes with even numbers; and, for the points of the others,
//! what probability they state and how many are true. Scenes that are lost as a whole are left out of both.

#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a program for people")]

use std::error::Error;

use nalgebra::{DMatrix, DVector};

use fringeflow::correspondence::{CONFIDENCE_TERMS, match_phases_with_grounds};
use fringeflow::reconstruction::Settings;
use fringeflow_lab::evaluation::Judgement;
use fringeflow_lab::scene_lists::{SceneError, SceneList};

/// Scenes taken by default.
const SCENES: usize = 144;
/// True points are many and similar: one in this number is sampled, with this weight.
const THINNING: usize = 20;
/// Share of false points from which on a scene is lost as a whole: no ground of a single point tells that.
const LOST: f64 = 0.3;
/// Ridge penalty that draws every value towards zero, in points.
const RIDGE: f64 = 10.0;
/// Newton steps; the last ones change nothing.
const NEWTON_STEPS: usize = 25;
/// Parts of the points, by their stated probability, for each of which it is compared with the truth.
const PARTS: usize = 10;

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
    let scenes = std::env::args().nth(1).map_or(Ok(SCENES), |count| count.parse())?;
    let (mut fitted, mut judged) = (Vec::new(), Vec::new());
    for number in 0..scenes {
        match samples_of(number) {
            Ok(samples) if is_lost(&samples) => {
                eprintln!("scene {number} is left out: too many of its points are false");
            }
            Ok(samples) => (if number % 2 == 0 { &mut fitted } else { &mut judged }).extend(samples),
            Err(e) => eprintln!("scene {number} is left out: {e}"),
        }
    }
    let factors = fit(&fitted).ok_or("the samples do not determine the model; add more scenes")?;
    let rounded: Vec<String> = factors.iter().map(|factor| format!("{factor:.2}")).collect();
    println!("[{}]", rounded.join(", "));
    print_calibration(&mut judged, &factors);
    Ok(())
}

fn is_lost(samples: &[Sample]) -> bool {
    let points: f64 = samples.iter().map(|sample| sample.weight).sum();
    let false_points: f64 = samples.iter().filter(|sample| !sample.is_true).map(|sample| sample.weight).sum();
    false_points > LOST * points
}

/// The samples of a scene.
fn samples_of(number: usize) -> Result<Vec<Sample>, Box<dyn Error>> {
    let scene = SceneList::Build.scene(number);
    let mut settings = Settings::default();
    // Keep all points: the model is fitted to doubtful ones too.
    settings.matching.min_confidence = 0.0;
    let table = scene.simulation()?.segment_table().map_err(SceneError::from)?;
    let (result, evaluation) = scene.reconstruct(settings)?;
    let (_, grounds) = match_phases_with_grounds(&result.cam1, &result.cam2, &table, &settings.matching)?;
    let has_point = |pixel: &usize| result.matches.outcomes[*pixel].is_found();
    let mut samples = Vec::new();
    for (index, pixel) in (0..grounds.len()).filter(has_point).enumerate() {
        let judgement = evaluation.judgements[pixel];
        let is_true = !judgement.is_false();
        if judgement == Judgement::Unjudged || (is_true && !index.is_multiple_of(THINNING)) {
            continue;
        }
        let weight = if is_true { THINNING as f64 } else { 1.0 };
        samples.push(Sample { terms: grounds[pixel].terms(), is_true, weight });
    }
    Ok(samples)
}

/// Finds the factors of maximum likelihood. Returns `None` if the samples do not determine them.
fn fit(samples: &[Sample]) -> Option<DVector<f64>> {
    let mut factors = DVector::zeros(CONFIDENCE_TERMS);
    for _ in 0..NEWTON_STEPS {
        let mut hessian = DMatrix::identity(CONFIDENCE_TERMS, CONFIDENCE_TERMS) * RIDGE;
        let mut gradient = &factors * -RIDGE;
        for sample in samples {
            let p = probability(sample, &factors);
            let pull = sample.weight * (f64::from(u8::from(sample.is_true)) - p);
            let curvature = sample.weight * p * (1.0 - p);
            let terms = DVector::from_iterator(CONFIDENCE_TERMS, sample.terms.iter().map(|&term| f64::from(term)));
            gradient += &terms * pull;
            hessian.ger(curvature, &terms, &terms, 1.0);
        }
        factors += hessian.cholesky()?.solve(&gradient);
    }
    Some(factors)
}

fn probability(sample: &Sample, factors: &DVector<f64>) -> f64 {
    let nats: f64 = sample.terms.iter().zip(factors).map(|(&term, factor)| f64::from(term) * factor).sum();
    1.0 / (1.0 + (-nats).exp())
}

/// Prints, for equal parts of the points, the least sure ones first, the probability that they state and the share of
/// them that is true.
fn print_calibration(samples: &mut [Sample], factors: &DVector<f64>) {
    samples.sort_by(|a, b| probability(a, factors).total_cmp(&probability(b, factors)));
    let points: f64 = samples.iter().map(|sample| sample.weight).sum();
    let (mut before, mut part, mut sums) = (0.0, 1, [0.0; 3]);
    for sample in &*samples {
        let is_true = f64::from(u8::from(sample.is_true));
        let of_sample = [1.0, probability(sample, factors), is_true].map(|value| sample.weight * value);
        sums.iter_mut().zip(of_sample).for_each(|(sum, value)| *sum += value);
        before += sample.weight;
        if before >= points * f64::from(part) / PARTS as f64 {
            let [count, stated, found] = sums;
            println!("part {part}: {count:>9} points, stated {:.4}, true {:.4}", stated / count, found / count);
            (part, sums) = (part + 1, [0.0; 3]);
        }
    }
}
