//! Semi-global resolution: all fringe orders of the image decided together.
//!
//! The paper decides pixel by pixel from decided neighbours, which fails where these are too few. Here whole surfaces
//! give most orders (see [`super::surfaces`]), and one check per pixel confirms them. For every other pixel each
//! possible order gets a matching cost. The orders of the whole image are chosen so that costs and Eq. (2) agree best,
//! Eq. (2) saying that neighbours on one surface share the absolute phase. This is the cost of stereo matching,
//! minimized along straight paths (Hirschmüller 2008, "Stereo Processing by Semiglobal Matching and Mutual
//! Information"). An order continues freely wherever the wrapped phase does, and changes there at a price. Where the
//! wrapped phase jumps, neighbours are independent.
//!
//! 1. *order ranges*: the possible orders of each pixel, on a segment that reaches beyond the volume: otherwise a wrong
//!    order within would explain what lies behind it;
//! 2. *confirm*: a pixel with a candidate at the order of its surface is decided; *matching cost* of the others: how
//!    well the best candidate of each order passes the back-projection test about the drift, in places of C2 that are
//!    not known to show something outside the volume; *unexplained*: where no order fits in a whole neighbourhood, the
//!    search ends;
//! 3. *paths*: sums of the least costs along eight directions;
//! 4. *selection*: the candidate of the order with the least sum, including rims of surfaces;
//! 5. *verification*: whole regions must have the δ of true candidates and stand out against other orders; δ that runs
//!    through a region shows a wrong order (*strips*); one place of C2 serves one order (*claims*). The *grounds*
//!    around each pixel give its *confidence*; pixels below a limit are rejected;
//! 6. *explanation*: why the other pixels have no candidate.
//!
//! Shared with the paper's method: *regions*, *places*, *claims*, *explanation*, *bands*.
//!
//! Time and memory are the same for every image of a rig: no step is iterated until it converges.

mod confidence;
mod grounds;
mod kernels;
mod links;
mod matching_cost;
mod order_ranges;
mod paths;
mod selection;
mod strips;
#[cfg(test)]
pub(super) mod test_scene;
mod unexplained;
mod verification;

use fringeflow_base::outcome::Outcome;

use crate::phase::PhaseMap;

use super::chosen::ChosenCandidates;
use super::drift::Drift;
use super::epipolar_image::EpipolarImage;
use super::pool::Pool;
use super::segment::SegmentRow;
use super::segment_table::SegmentTable;
use super::surfaces;
use super::view::View;
use super::{bands, claims, explanation, places, regions};

pub use confidence::{CONFIDENCE_TERMS, Confidence};
pub use grounds::Grounds;

use matching_cost::{DeltaScale, MatchingCosts};
use order_ranges::OrderRanges;
pub(super) use order_ranges::Reach;
use paths::{PathScratch, Verdicts};
use selection::Selection;
use verification::VerificationScratch;

/// Costs are whole numbers in steps of 1/20 nat.
const UNITS_PER_NAT: f32 = 20.0;

/// What the resolution reads.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub(super) cam1: &'a PhaseMap,
    pub(super) cam2: &'a EpipolarImage,
    pub(super) table: &'a SegmentTable,
    pub(super) drift: &'a Drift,
}

/// Decisions about all pixels of C1, row by row. The vectors are filled anew.
pub(super) struct Decisions<'a> {
    pub(super) outcomes: &'a mut Vec<Outcome>,
    pub(super) chosen: &'a mut ChosenCandidates,
    /// Orders of each pixel that pass the back-projection test about the drift.
    pub(super) passing: &'a mut Vec<u8>,
    /// Probability that each point is true.
    pub(super) confidence: &'a mut Vec<Confidence>,
}

/// Limits that a point must reach.
pub(super) struct Limits {
    /// Pixels of a region of continuous absolute phase.
    pub(super) min_region_px: u32,
    /// Probability of being true.
    pub(super) min_confidence: f32,
}

/// Scratch memory, kept from image to image: a hundred megabytes for a megapixel.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    pub(super) surfaces: surfaces::Scratch,
    /// Pixels known to see something outside the volume.
    outside: Vec<bool>,
    /// C2 without the places known to show something outside the volume.
    open: EpipolarImage,
    ranges: OrderRanges,
    evidence: MatchingCosts,
    paths: PathScratch,
    verdicts: Verdicts,
    selection: Selection,
    verification: VerificationScratch,
    segments: Pool<SegmentRow>,
}

impl Scratch {
    /// Decides every pixel. Writes the grounds of the decisions if asked for.
    pub(super) fn resolve(
        &mut self,
        scene: &Scene<'_>,
        limits: &Limits,
        decisions: &mut Decisions<'_>,
        grounds: Option<&mut Vec<Grounds>>,
    ) {
        let Self { surfaces, outside, open, ranges, evidence, paths, verdicts, selection, verification, segments } =
            self;
        let scale = DeltaScale::from_scene(scene);
        let view = View { cam1: scene.cam1, cam2: scene.cam2, table: scene.table };
        let near_px = ranges.near_px(scene.table);
        let far = surfaces.mark_outside(view, scene.drift, near_px, outside);
        let is_taken = far.is_far && surfaces.mask_taken(view, scene.drift, outside, open);
        let open = Scene { cam2: if is_taken { open } else { scene.cam2 }, ..*scene };
        ranges.prepare(scene, far.is_very_far);
        let input = matching_cost::CostInput { scene, open: &open, scale: &scale, surfaces, outside };
        evidence.gather(&input, ranges, selection, decisions.passing);
        unexplained::close(scene.cam1.width.max(1), &evidence.is_explained, &mut ranges.count);
        paths::least_costs(scene.cam1, ranges, evidence, paths, verdicts);
        selection.select(&open, ranges, &scale, &verdicts.order);
        let decided = verification::PathDecisions { verdicts, surfaces };
        verification::verify(scene, selection, &decided, limits, verification, decisions, grounds);
        for (outcome, _) in decisions.outcomes.iter_mut().zip(&*outside).filter(|(_, outside)| **outside) {
            *outcome = Outcome::OutsideVolume;
        }
        explanation::explain_missing(view, decisions.outcomes, segments);
    }
}
