//! Semi-global resolution: all fringe orders of the image decided together.
//!
//! The paper decides pixel by pixel from decided neighbours, which fails where these are too few. Here whole surfaces
//! give most orders (see [`super::surfaces`]), and one check per pixel confirms them. For every other pixel each
//! possible order gets a matching cost. The orders of the whole image are chosen so that the sum of all costs is small
//! and neighbours agree by Eq. (2): on one surface the absolute phase continues. As in stereo matching, the sum is
//! minimized along straight paths (Hirschmüller 2008, "Stereo Processing by Semiglobal Matching and Mutual
//! Information"). An order continues freely wherever the wrapped phase does, and changes there at a price. Where the
//! wrapped phase jumps, neighbours are independent.
//!
//! 1. *order ranges*: the possible orders of each pixel, on a segment that reaches beyond the volume: otherwise a
//!    surface behind the volume would get a wrong order within;
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
mod cost_table;
mod grounds;
mod kernels;
mod links;
mod matching_cost;
mod order_ranges;
mod paths;
mod search_row;
mod selection;
mod strips;
#[cfg(test)]
pub(super) mod test_scene;
mod unexplained;
mod verification;

use fringeflow_base::outcome::Outcome;

use super::epipolar_image::EpipolarImage;
use super::pool::Pool;
use super::scene::Scene;
use super::segment::SegmentRow;
use super::view::View;
use super::{explanation, surfaces};

pub use confidence::{CONFIDENCE_TERMS, Confidence};
pub use grounds::Grounds;

use matching_cost::MatchingCosts;
use order_ranges::OrderRanges;
use paths::{PathOrders, PathScratch};
use search_row::DeltaScale;
use selection::Selection;
use verification::VerificationScratch;
pub(super) use verification::{Decisions, Limits};

/// Scratch memory, kept from image to image: a hundred megabytes for a megapixel.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    pub(super) surfaces: surfaces::Scratch,
    /// Pixels known to see something outside the volume.
    outside: Vec<bool>,
    /// C2 without the places known to show something outside the volume.
    open: EpipolarImage,
    ranges: OrderRanges,
    matching_costs: MatchingCosts,
    paths: PathScratch,
    path_orders: PathOrders,
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
        let Self {
            surfaces,
            outside,
            open,
            ranges,
            matching_costs,
            paths,
            path_orders,
            selection,
            verification,
            segments,
        } = self;
        let scale = DeltaScale::from_scene(scene);
        let Scene { view, drift } = *scene;
        let near_px = ranges.near_px(view.table);
        let far = surfaces.mark_outside(view, drift, near_px, outside);
        let is_taken = far.is_far && surfaces.mask_taken(view, drift, outside, open);
        let open = Scene { view: View { cam2: if is_taken { open } else { view.cam2 }, ..view }, drift };
        ranges.prepare(scene, far.is_very_far);
        let input = matching_cost::CostInput { scene, open: &open, scale: &scale, surfaces, outside };
        matching_costs.gather(&input, ranges, selection, decisions.passing);
        unexplained::remove_orders(view.cam1.width.max(1), &matching_costs.is_explained, &mut ranges.count);
        paths::least_costs(view.cam1, ranges, matching_costs, paths, path_orders);
        selection.select(&open, ranges, &scale, &path_orders.order);
        let input = verification::VerificationInput { path_orders, surfaces };
        verification::verify(scene, selection, &input, limits, verification, decisions, grounds);
        for (outcome, _) in decisions.outcomes.iter_mut().zip(&*outside).filter(|(_, outside)| **outside) {
            *outcome = Outcome::OutsideVolume;
        }
        explanation::explain_missing(view, decisions.outcomes, segments);
    }
}
