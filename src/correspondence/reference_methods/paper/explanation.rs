//! The reasons why pixels have no candidate. In: the outcomes so far. Out: the outcomes, with the reason of each pixel
//! without a correspondence. Cost: the search of some columns per such pixel.

use rayon::prelude::*;

use fringeflow_base::outcome::Outcome;

use crate::correspondence::candidates::phase_occurs;
use crate::correspondence::pool::Pool;
use crate::correspondence::row_view::RowView;
use crate::correspondence::segment::SegmentRow;
use crate::correspondence::view::View;

/// Gives every pixel without a correspondence its reason: no phase, no segment, the phase does not occur on the
/// segment, or no candidate passes the test. `scratches` holds rows of segments.
pub(super) fn explain_missing(
    View { cam1, cam2, table, .. }: View<'_>,
    outcomes: &mut [Outcome],
    scratches: &Pool<SegmentRow>,
) {
    let width = cam1.width.max(1);
    outcomes.par_chunks_mut(width).enumerate().for_each_init(
        || scratches.take(),
        |segments, (v, outcomes)| {
            let (mut is_loaded, mut guess_px) = (false, 0.0);
            for (u, outcome) in outcomes.iter_mut().enumerate() {
                let pixel = v * width + u;
                if outcome.is_found() {
                    continue;
                }
                if !cam1.valid[pixel] {
                    *outcome = Outcome::Invalid;
                } else if !table.has_segment(pixel) {
                    *outcome = Outcome::OutsideVolume;
                } else if *outcome == Outcome::NoCandidate {
                    if !is_loaded {
                        table.row(v, segments);
                        is_loaded = true;
                    }
                    let segment = segments.segment(u);
                    if phase_occurs(&RowView::new(cam2, segment.row_px), &segment, cam1.phase[pixel], &mut guess_px) {
                        *outcome = Outcome::RejectedByDelta;
                    }
                }
            }
        },
    );
}
