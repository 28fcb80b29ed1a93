//! Evaluates the effects of changes of a rig, each with the changed rig.

use serde::Serialize;

use super::evaluate::{Figures, evaluate};
use super::{Assumptions, RigReportError, RigSetup};

/// Number of grid steps along the larger side of the image of C1. A comparison needs no fine grid.
const GRID_STEPS: usize = 20;
/// Places of the projector on the base to try: first, last and step, in hundredths.
const PLACES: (i32, i32, usize) = (20, 80, 2);
/// A move of the projector is advised if at most this share of the false candidates remains.
const MAX_REMAINING_SHARE: f64 = 0.95;
/// Factors of the period to try.
const PERIOD_FACTORS: [f64; 4] = [0.75, 1.25, 1.5, 2.0];
/// Factors of the depth of the volume to try.
const DEPTH_FACTORS: [f64; 2] = [0.75, 0.5];

/// A change of the rig.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Change {
    /// The projector moves along the base and stays aimed at the volume. Places r are from 0 (C1) to 1 (C2).
    ProjectorPlace {
        /// Place now.
        from: f64,
        /// Place with the smallest sum of efc and survivors on flat surfaces.
        to: f64,
    },
    /// Another fringe period, projector pixels.
    Period {
        /// Period now.
        from_px: f64,
        /// Period tried.
        to_px: f64,
    },
    /// Another depth of the volume about the same centre, metres.
    Depth {
        /// Depth now.
        from_m: f64,
        /// Depth tried.
        to_m: f64,
    },
}

/// A change and the figures of the changed rig.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Advice {
    /// The change.
    pub change: Change,
    /// Figures of the changed rig, on the grid of the advice.
    pub figures: Figures,
}

/// Returns the figures of the unchanged rig on the grid of the advice, and the changes tried.
pub(super) fn advise(setup: &RigSetup, assumptions: &Assumptions) -> Result<(Figures, Vec<Advice>), RigReportError> {
    let cam1 = &setup.rig.cam1;
    let step_px = (cam1.width_px().max(cam1.height_px()) / GRID_STEPS).max(1);
    let figures = |setup: &RigSetup, assumptions: &Assumptions| {
        evaluate(setup, assumptions, step_px).map(|evaluation| evaluation.figures())
    };
    let base = figures(setup, assumptions)?;
    let mut advice = Vec::new();
    // Skip a changed rig that cannot measure.
    let mut add = |change: Change, tried: Result<Figures, RigReportError>| {
        advice.extend(tried.ok().map(|figures| Advice { change, figures }));
    };
    let best = best_place(setup, |moved| figures(moved, assumptions).ok());
    if let Some((to, best)) =
        best.filter(|(_, best)| false_candidates(best) < MAX_REMAINING_SHARE * false_candidates(&base))
    {
        add(Change::ProjectorPlace { from: setup.rig.projector_place_on_base(), to }, Ok(best));
    }
    let from_px = setup.pattern.period_px;
    for factor in PERIOD_FACTORS.into_iter().filter(|factor| factor * from_px >= 2.0) {
        let changed = figures(&setup.with_period_scaled(factor), &assumptions.with_period_scaled(factor));
        add(Change::Period { from_px, to_px: factor * from_px }, changed);
    }
    let from_m = setup.depth_m();
    for factor in DEPTH_FACTORS {
        if let Ok(changed) = setup.with_depth_scaled(factor) {
            add(Change::Depth { from_m, to_m: factor * from_m }, figures(&changed, assumptions));
        }
    }
    Ok((base, advice))
}

/// Finds the place of the projector with the fewest false candidates. Flat and irregular surfaces count equally.
fn best_place(setup: &RigSetup, figures: impl Fn(&RigSetup) -> Option<Figures>) -> Option<(f64, Figures)> {
    let places = (PLACES.0..=PLACES.1).step_by(PLACES.2).map(|hundredths| f64::from(hundredths) / 100.0);
    let tried = places.filter_map(|place| Some((place, figures(&setup.with_projector_place(place))?)));
    tried.min_by(|(_, a), (_, b)| false_candidates(a).total_cmp(&false_candidates(b)))
}

fn false_candidates(figures: &Figures) -> f64 {
    figures.efc + figures.survivors
}
