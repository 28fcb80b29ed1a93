//! Semi-global resolution: all fringe orders of the image decided together.
//!
//! The paper decides pixel by pixel from neighbours that are decided already, which fails where too few are. Here whole surfaces
//! tell most orders (see [`super::surfaces`]), and one look at each pixel confirms them. Every other pixel
//! holds evidence for every order that its segment allows, and orders are chosen so that the evidence and Eq. (2),
//! by which neighbours of one surface share the absolute phase, agree best over the whole image: the cost of stereo
//! matching, minimized along straight paths (Hirschmüller 2008, "Stereo Processing by Semiglobal Matching and Mutual
//! Information"). An order is free to continue wherever the wrapped phase runs on, at a price to change there, and where
//! the wrapped phase jumps neighbours say nothing to each other.
//!
//! 1. *ranges*: the orders of each pixel, of a segment that reaches beyond the volume: what lies behind it would else be
//!    explained by a wrong order within;
//! 2. *look*: whether the pixel has a candidate at the order of its surface: then it is decided;
//!    *evidence* of the others: how well the best candidate of each order passes the back-projection test, about the drift, in
//!    places of C2 that are not known to show what lies outside the volume;
//!    where none of a whole neighbourhood does, nothing more is asked (*unexplained*);
//! 3. *paths*: sums of the least costs along eight directions;
//! 4. *selection*: the candidate of the order with the least sum, rims of surfaces included;
//! 5. *verification*: whole regions must have the δ of true candidates, and stand against other orders; δ that runs through
//!    a region tells a wrong order (*strips*); one place of C2 serves one order (*claims*). On the *grounds* of what stands
//!    around it every pixel gets a *confidence*; those below a limit are left out;
//! 6. *explanation*: why the pixels without candidate have none.
//!
//! Shared with the paper's method: *regions*, *places*, *claims*, *explanation*, *bands*.
//!
//! In time and memory each step is the same for every image of a rig: nothing is repeated until it settles.

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
use super::surfaces::{self, View};
use super::{bands, claims, explanation, places, regions};

pub use confidence::{CONFIDENCE_TERMS, Confidence};
pub use grounds::Grounds;

use matching_cost::{DeltaScale, Evidence};
use order_ranges::OrderRanges;
pub(super) use order_ranges::Reach;
use paths::{PathScratch, Verdicts};
use selection::Selection;
use verification::VerificationScratch;

/// Evidence and costs are whole numbers: so many a nat.
const UNITS_PER_NAT: f32 = 20.0;

/// What the resolution reads.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub(super) cam1: &'a PhaseMap,
    pub(super) cam2: &'a EpipolarImage,
    pub(super) table: &'a SegmentTable,
    pub(super) drift: &'a Drift,
}

/// Decisions about all pixels of C1, row by row; vectors are filled anew.
pub(super) struct Decisions<'a> {
    pub(super) outcomes: &'a mut Vec<Outcome>,
    pub(super) chosen: &'a mut ChosenCandidates,
    /// Orders of each pixel that pass the back-projection test about the drift.
    pub(super) passing: &'a mut Vec<u8>,
    /// How likely each point is true.
    pub(super) confidence: &'a mut Vec<Confidence>,
}

/// What a point must have.
pub(super) struct Limits {
    /// Pixels of a region of continuous absolute phase.
    pub(super) min_region_px: u32,
    /// Probability of being true.
    pub(super) min_confidence: f32,
}

/// Scratch for what is known of each pixel, to be used from image to image: a hundred megabytes for a megapixel.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    pub(super) surfaces: surfaces::Scratch,
    /// Whether a pixel is known to see something outside the volume.
    outside: Vec<bool>,
    /// C2 without what it is known to see there.
    open: EpipolarImage,
    ranges: OrderRanges,
    evidence: Evidence,
    paths: PathScratch,
    verdicts: Verdicts,
    selection: Selection,
    verification: VerificationScratch,
    segments: Pool<SegmentRow>,
}

impl Scratch {
    /// Decides every pixel. The grounds of the decisions go where they are asked for.
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
        let is_taken = far.is_far && surfaces.leave_open(view, scene.drift, outside, open);
        let open = Scene { cam2: if is_taken { open } else { scene.cam2 }, ..*scene };
        ranges.ready(scene, far.is_very_far);
        let asked = matching_cost::Asked { scene, open: &open, scale: &scale, surfaces, outside };
        evidence.gather(&asked, ranges, selection, decisions.passing);
        unexplained::close(scene.cam1.width.max(1), &evidence.is_explained, &mut ranges.count);
        paths::least_costs(scene.cam1, ranges, evidence, paths, verdicts);
        selection.select(&open, ranges, &scale, &verdicts.order);
        let decided = verification::Decided { verdicts, surfaces };
        verification::verify(scene, selection, &decided, limits, verification, decisions, grounds);
        for (outcome, _) in decisions.outcomes.iter_mut().zip(&*outside).filter(|(_, outside)| **outside) {
            *outcome = Outcome::OutsideVolume;
        }
        explanation::explain(scene.cam1, scene.cam2, scene.table, decisions.outcomes, segments);
    }
}
