//! The drift of one pair of images. In: candidates decided by surfaces, or all candidates of a sample of pixels. Out: a
//! [`Drift`].
//!
//! ```text
//! from decided candidates: refine the known drift
//! from all candidates:
//!     within = best start in the volume; beyond = best start in the volume and some way beyond
//!     refine both on more pixels; beyond is preferred only if it scores better and within is doubtful
//! best start: refine the start without drift
//!     if the result is implausible: also refine the best of many drawn starts, and take the best of all
//! ```

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::coordinates::{DepthRow, DriftCoordinates, Polynomial, TERMS};
use super::known::KnownDrift;
use super::mixture::{Coefficients, Guess, Sample, Solver, Usable};
use super::modes::DriftModes;
use crate::correspondence::candidates::DecidedCandidate;
use crate::correspondence::delta_statistics::DeltaStatistics;
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::segment_table::SegmentTable;
use crate::correspondence::view::View;

/// Pixels of the estimate, pixels on which starts are followed, and pixels by which drawn starts are compared.
const PIXELS: usize = 3000;
const PIXELS_OF_STARTS: usize = 500;
const PIXELS_OF_DRAWS: usize = 250;
/// Steps of expectation maximization: from every start, from the best few, and from the best on all pixels.
const FIRST_STEPS: usize = 15;
const STEPS: usize = 60;
const LAST_STEPS: usize = 60;
/// Decided pixels used, about.
const DECIDED_PIXELS: usize = 1000;
/// Starts followed to their end.
const BEST_STARTS: usize = 4;
/// Starts drawn if the start without drift fails, and how many of them are followed.
const DRAWN_STARTS: usize = 1000;
const FOLLOWED_STARTS: usize = 20;
/// Modes in which the starts differ; the others follow.
const LEADING_MODES: usize = 6;
/// efc (paper, Eq. 1) up to which false candidates are too few to mislead the estimate.
const FEW_FALSE_CANDIDATES: f64 = 0.3;
/// Share of pixels with a true candidate below which the scene may lie beyond the volume.
const MOST_PIXELS: f64 = 0.7;
/// How far beyond the volume candidates are then sought, in segments. Nearer ones have fewer wrong candidates.
const SEGMENTS_BEYOND: [f32; 2] = [0.5, 1.0];
/// sd of δ on usually calibrated rigs, rad.
const USUAL_SD_RAD: f64 = 0.06;
/// sd of δ that neither the drift nor Φ of the table can follow, turns (0.0075 rad): Φ of the table is off by up to
/// 0.002 turns, and lenses have more kinds of errors than there are modes.
pub(in crate::correspondence) const MODEL_SD_TURNS: f64 = 0.0012;
/// An estimate is doubted beyond this calibration error, pixels, or below this share of pixels with a true candidate.
const IMPROBABLE_PX: f64 = 4.0;
const IMPROBABLE_SHARE: f64 = 0.5;
/// With an sd about the drift below this, rad, a small share is not doubted: chance never agrees so closely, and a
/// small body before a board that fills the image is a small share.
const NARROW_SD_RAD: f64 = 0.05;
/// sd of a drawn start, relative to that of all candidates near zero.
const START_SD: f64 = 0.3;
/// Distance between followed starts, relative to the same sd.
const START_DISTANCE: f64 = 0.6;
/// Factor on the sd of the best estimate before its last refinement.
const LAST_WIDENING: f64 = 1.5;

/// The field of δ that the calibration error of a rig causes, estimated from one pair of images.
#[derive(Clone, Debug, PartialEq)]
pub struct Drift {
    pub(super) places: DriftCoordinates,
    pub(super) field: Polynomial,
    /// Its coefficients of the modes.
    coefficients: Coefficients,
    /// Mean of the field over the sampled volume, rad.
    pub mean_rad: f64,
    /// sd of δ of true candidates about the field, rad: noise.
    pub residual_sd_rad: f64,
    /// Root mean square of the field about its mean over the sampled volume, rad.
    pub rms_rad: f64,
    /// Calibration error that explains it: root of the sum of squares over the modes, pixels.
    pub error_px: f64,
    /// Share of pixels with a true candidate among theirs.
    pub share: f64,
}

impl Default for Drift {
    /// No drift, and every pixel agrees.
    fn default() -> Self {
        let places = DriftCoordinates::from_numbers([1.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        Self {
            places,
            field: [0.0; TERMS],
            coefficients: Coefficients::default(),
            mean_rad: 0.0,
            residual_sd_rad: 0.0,
            rms_rad: 0.0,
            error_px: 0.0,
            share: 1.0,
        }
    }
}

impl Drift {
    /// A constant mean, rad, with an sd about it.
    pub(in crate::correspondence) fn level(mean_rad: f64, sd_rad: f64) -> Self {
        let mut field = [0.0; TERMS];
        field[0] = mean_rad / TAU;
        let coefficients = std::iter::once(field[0]).collect();
        Self { field, coefficients, mean_rad, residual_sd_rad: sd_rad, ..Self::default() }
    }

    fn new(modes: &DriftModes, guess: &Guess) -> Self {
        let mut field = [0.0; TERMS];
        field[0] = guess.coefficients[0];
        let (mut squares, mut errors) = (0.0, 0.0);
        for ((mode, rms), c) in modes.fields.iter().zip(&modes.rms_turns).zip(&guess.coefficients[1..]) {
            field.iter_mut().zip(mode).for_each(|(f, m)| *f += c * m);
            squares += (c * rms).powi(2);
            errors += c * c;
        }
        Self {
            places: modes.places,
            field,
            coefficients: guess.coefficients.clone(),
            mean_rad: guess.coefficients[0] * TAU,
            residual_sd_rad: guess.sd_turns.hypot(MODEL_SD_TURNS) * TAU,
            rms_rad: squares.sqrt() * TAU,
            error_px: errors.sqrt(),
            share: guess.share,
        }
    }

    /// The field of a mean, turns, and coefficients of the modes, pixels, with an sd of δ about it.
    pub(in crate::correspondence) fn from_coefficients(
        table: &SegmentTable,
        coefficients: &[f64],
        sd_rad: f64,
    ) -> Self {
        match table.drift_modes() {
            Some(modes) => {
                let coefficients = coefficients.iter().copied().collect();
                Self::new(modes, &Guess { coefficients, sd_turns: sd_rad / TAU, share: 1.0 })
            }
            None => Self::level(coefficients[0] * TAU, sd_rad),
        }
    }

    /// Its first `count` coefficients.
    pub(in crate::correspondence) fn coefficients_of(&self, count: usize) -> nalgebra::DVector<f64> {
        nalgebra::DVector::from_fn(count, |i, _| self.coefficients.get(i).copied().unwrap_or(0.0))
    }

    /// The part that is handed on to later windows.
    #[must_use]
    pub fn to_known(&self) -> KnownDrift {
        let mut known = KnownDrift { coefficients: [0.0; _], sd_rad: self.residual_sd_rad as f32 };
        known.coefficients.iter_mut().zip(&*self.coefficients).for_each(|(own, &c)| *own = c as f32);
        known
    }

    /// A drift that an earlier window found. `None` if the rig has no modes.
    pub(in crate::correspondence) fn from_known(known: &KnownDrift, table: &SegmentTable) -> Option<Self> {
        let modes = table.drift_modes()?;
        let mut coefficients: Coefficients = known.coefficients.into_iter().map(f64::from).collect();
        coefficients.resize(1 + modes.fields.len());
        let sd_turns = ((f64::from(known.sd_rad) / TAU).powi(2) - MODEL_SD_TURNS.powi(2)).max(0.0).sqrt();
        Some(Self::new(modes, &Guess { coefficients, sd_turns, share: 1.0 }))
    }

    /// Root mean square of its difference from another drift of the rig, turns.
    pub(in crate::correspondence) fn distance_turns(&self, other: &Self, table: &SegmentTable) -> f64 {
        let rms_turns = std::iter::once(&1.0).chain(table.drift_modes().map_or(&[][..], |modes| &modes.rms_turns));
        let pairs = self.coefficients.iter().zip(&*other.coefficients);
        pairs.zip(rms_turns).map(|((a, b), rms)| ((a - b) * rms).powi(2)).sum::<f64>().sqrt()
    }

    /// Statistics of δ less the drift: no mean, and the sd of noise.
    #[must_use]
    pub fn residual_statistics(&self, delta: &DeltaStatistics) -> DeltaStatistics {
        DeltaStatistics { mean_rad: 0.0, sd_rad: self.residual_sd_rad, ..*delta }
    }

    /// Whether most pixels have a candidate that agrees with the drift. Otherwise it says more about the scene than
    /// about the calibration.
    #[must_use]
    pub fn explains_most_pixels(&self) -> bool {
        self.share >= IMPROBABLE_SHARE
    }

    /// Whether no likely calibration error causes it, or few pixels agree with it closely.
    pub(in crate::correspondence) fn is_improbable(&self) -> bool {
        let is_narrow = self.residual_sd_rad < NARROW_SD_RAD;
        self.error_px > IMPROBABLE_PX || !(self.explains_most_pixels() || is_narrow)
    }

    /// Computes δ of true candidates along the segments of a row of C1, turns.
    pub(in crate::correspondence) fn along_row(&self, v: usize, width: usize, out: &mut DepthRow) {
        self.places.along_segments(&self.field, v, width, out);
    }
}

/// Estimates the drift from the candidates of one pair of images. `delta` is the statistics of δ without drift.
///
/// The estimate starts without drift. If that leads to a field that no likely calibration error causes, or that
/// explains few pixels, it starts again from fields that likely errors cause: a wrong order may look consistent from
/// one start. It also tries candidates beyond the volume: if the scene lies there, wrong orders within may look
/// consistent too.
#[must_use]
pub fn estimate_drift(cam1: &PhaseMap, cam2: &EpipolarImage, table: &SegmentTable, delta: &DeltaStatistics) -> Drift {
    DriftScratch::default().estimates(View { cam1, cam2, table }, delta).0
}

/// Scratch memory for the estimate, kept from window to window.
#[derive(Clone, Debug, Default)]
pub(in crate::correspondence) struct DriftScratch {
    usable: Usable,
    sample: Sample,
    thinned: Sample,
    solver: Solver,
}

impl DriftScratch {
    /// Estimates the drift from decided candidates. They cover `share` of the image, and δ of false ones spreads over
    /// `spread_turns`. The estimate starts from `known`, about which δ scatters by about `sd_rad`. `None` if there are
    /// no decided candidates.
    pub(in crate::correspondence) fn estimate_from_decided(
        &mut self,
        table: &SegmentTable,
        decided: &[DecidedCandidate],
        share: f64,
        spread_turns: f32,
        (known, sd_rad): (&Drift, f64),
    ) -> Option<Drift> {
        let modes = table.drift_modes()?;
        if !self.sample.fill_decided(modes, decided, share, f64::from(spread_turns)) {
            return None;
        }
        self.sample.thin(DECIDED_PIXELS, &mut self.thinned);
        let mut guess = Guess { coefficients: known.coefficients.clone(), sd_turns: sd_rad / TAU, share: 0.0 };
        guess.coefficients.resize(1 + modes.fields.len());
        self.thinned.refine(&mut guess, LAST_STEPS, &mut self.solver);
        Some(Drift::new(modes, &guess))
    }

    /// As [`estimate_drift`]. If candidates beyond the volume were found, also returns the other one of the best drifts
    /// within and beyond the volume.
    pub(in crate::correspondence) fn estimates(
        &mut self,
        view: View<'_>,
        delta: &DeltaStatistics,
    ) -> (Drift, Option<Drift>) {
        let Self { usable, sample, thinned, solver, .. } = self;
        let constant = || (Drift::level(delta.mean_rad, delta.sd_rad), None);
        let Some(modes) = view.table.drift_modes() else { return constant() };
        let length_px = 2.0 * modes.half_segment_px() as f32;
        let mut fill = |sample: &mut Sample, beyond: f32| {
            // Longer segments have more candidates; fewer pixels keep their total number.
            let pixels = (PIXELS as f32 / beyond.max(1.0)) as usize;
            sample.fill(view, modes, (pixels, beyond * length_px), usable)
        };
        if !fill(sample, 0.0) {
            return constant();
        }
        sample.thin(PIXELS_OF_STARTS, thinned);
        let best = best_start(thinned, modes, delta, solver);
        let wider = SEGMENTS_BEYOND.map(|share| {
            let mut wide = Sample::default();
            fill(&mut wide, share).then_some(wide)
        });
        let beyond = best_beyond(wider, modes, delta);
        let mut refined = |sample: &Sample, mut guess: Guess| {
            guess.sd_turns *= LAST_WIDENING;
            sample.refine(&mut guess, LAST_STEPS, solver);
            Drift::new(modes, &guess)
        };
        let within_is_usual = best.is_plausible() && best.share >= MOST_PIXELS;
        match beyond {
            Some((beyond, wide)) => {
                // Candidates beyond the volume win only if those within are doubtful.
                let is_first = !within_is_usual && wide.score(&beyond) > wide.score(&best);
                let (within, beyond) = (refined(sample, best), refined(&wide, beyond));
                if is_first { (beyond, Some(within)) } else { (within, Some(beyond)) }
            }
            None => (refined(sample, best), None),
        }
    }
}

/// The start without drift: the mean of δ alone.
fn start_without_drift(modes: &DriftModes, delta: &DeltaStatistics) -> Guess {
    let mut coefficients = Coefficients::default();
    coefficients.resize(1 + modes.fields.len());
    coefficients[0] = delta.mean_rad / TAU;
    Guess { coefficients, sd_turns: delta.sd_rad / TAU, share: 0.0 }
}

fn best_start(sample: &Sample, modes: &DriftModes, delta: &DeltaStatistics, solver: &mut Solver) -> Guess {
    let without_drift = start_without_drift(modes, delta);
    let mut best = without_drift.clone();
    sample.refine(&mut best, STEPS, solver);
    // Drawn starts are expensive.
    if best.is_plausible() || delta.expected_false_candidates() < FEW_FALSE_CANDIDATES {
        return best;
    }
    let mut followed = followed_starts(sample, modes, &without_drift);
    followed.par_iter_mut().for_each_init(Solver::default, |solver, guess| sample.refine(guess, FIRST_STEPS, solver));
    let mut promising = by_score(sample, followed);
    promising.truncate(BEST_STARTS);
    promising.par_iter_mut().for_each_init(Solver::default, |solver, guess| sample.refine(guess, STEPS, solver));
    promising.push(best);
    by_score(sample, promising).swap_remove(0)
}

/// The best guess from the wider samples, and the widest sample. The measured mean of δ may rest on wrong orders and is
/// not used.
fn best_beyond<const N: usize>(
    wider: [Option<Sample>; N],
    modes: &DriftModes,
    delta: &DeltaStatistics,
) -> Option<(Guess, Sample)> {
    let delta = DeltaStatistics { mean_rad: 0.0, ..*delta };
    let thinned = wider.each_ref().map(|sample| sample.as_ref().map(|s| s.thinned(PIXELS_OF_STARTS)));
    let mut solver = Solver::default();
    // Even the measured sd may rest on wrong orders; usual rigs scatter less.
    let usual = DeltaStatistics { sd_rad: delta.sd_rad.min(USUAL_SD_RAD), ..delta };
    let starts = |sample: &Sample| {
        let mut from_usual = start_without_drift(modes, &usual);
        sample.refine(&mut from_usual, STEPS, &mut solver);
        [best_start(sample, modes, &delta, &mut solver), from_usual]
    };
    let guesses = thinned.iter().flatten().flat_map(starts).collect();
    let widest = thinned.iter().flatten().last()?;
    let best = by_score(widest, guesses).into_iter().next()?;
    wider.into_iter().flatten().last().map(|sample| (best, sample))
}

/// Sorts guesses, the best first.
fn by_score(sample: &Sample, guesses: Vec<Guess>) -> Vec<Guess> {
    let mut scored: Vec<(f64, Guess)> = guesses.into_par_iter().map(|guess| (sample.score(&guess), guess)).collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    scored.into_iter().map(|(_, guess)| guess).collect()
}

/// The best of the drawn starts that differ enough from each other. They spread about `without_drift`.
fn followed_starts(sample: &Sample, modes: &DriftModes, without_drift: &Guess) -> Vec<Guess> {
    let spread_px = modes.rms_turns.first().map_or(0.0, |rms| without_drift.sd_turns / rms);
    let few = sample.thinned(PIXELS_OF_DRAWS);
    let drawn = draws(modes.fields.len().min(LEADING_MODES)).take(DRAWN_STARTS).map(|normal| {
        // The other modes are zero, and left out of the comparison.
        let leading = normal.into_iter().map(|n| n * spread_px);
        let coefficients = without_drift.coefficients[..1].iter().copied().chain(leading).collect();
        Guess { sd_turns: START_SD * without_drift.sd_turns, coefficients, share: 0.0 }
    });
    let drawn = by_score(&few, drawn.collect());
    let distance = |a: &Guess, b: &Guess| {
        let steps = a.coefficients[1..].iter().zip(&b.coefficients[1..]).zip(&modes.rms_turns);
        steps.map(|((a, b), rms)| ((a - b) * rms).powi(2)).sum::<f64>().sqrt()
    };
    let mut followed: Vec<Guess> = Vec::new();
    for mut guess in drawn {
        let differs = |other: &Guess| distance(&guess, other) > START_DISTANCE * without_drift.sd_turns;
        if followed.len() < FOLLOWED_STARTS && followed.iter().all(differs) {
            guess.coefficients.resize(without_drift.coefficients.len());
            followed.push(guess);
        }
    }
    followed
}

/// Points that fill a space evenly (additive recurrence of the generalized golden ratio). Each coordinate has a
/// logistic distribution, nearly a normal one. Every call gives the same points.
fn draws(dimensions: usize) -> impl Iterator<Item = Vec<f64>> {
    /// Scale that gives the logistic distribution a standard deviation of 1.
    const UNIT: f64 = 0.551_328_895;
    let mut ratio = 2.0_f64;
    for _ in 0..60 {
        ratio = (1.0 + ratio).powf(1.0 / (dimensions as f64 + 1.0));
    }
    (1_u32..).map(move |i| {
        let coordinate = |k: usize| {
            let place = (0.5 + f64::from(i) * ratio.powi(-(k as i32 + 1))).fract().clamp(1e-3, 1.0 - 1e-3);
            UNIT * (place / (1.0 - place)).ln()
        };
        (0..dimensions).map(coordinate).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_have_mean_zero_and_unit_spread_and_repeat() {
        let drawn: Vec<Vec<f64>> = draws(3).take(2000).collect();
        for k in 0..3 {
            let mean = drawn.iter().map(|d| d[k]).sum::<f64>() / 2000.0;
            let sd = (drawn.iter().map(|d| d[k] * d[k]).sum::<f64>() / 2000.0).sqrt();
            assert!(mean.abs() < 0.05 && (sd - 1.0).abs() < 0.05, "{k}: {mean} {sd}");
        }
        assert_eq!(drawn[..10], draws(3).take(10).collect::<Vec<_>>());
    }
}
