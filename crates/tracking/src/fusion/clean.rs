//! Finds two kinds of wrong surfels: those behind which clouds measured a surface, and those that clouds could have
//! measured but did not.

use crate::registration::OrganizedSurface;

use super::depth_map::{DepthMap, Projection};
use super::surfel::Surfel;

/// A surface this far behind a surfel contradicts it: a share of the depth, 1 mm at 0.3 m. This is well above noise, so
/// only false points and removed objects are affected.
const BEHIND_SHARE: f32 = 0.0033;
/// Minimum number of measured pixels around a surfel for a contradiction. All of them must lie behind it, because at
/// edges some always do.
const MIN_BEHIND: usize = 5;
/// Minimum number of contradictions that removes a surfel. They must also exceed a third of its support.
const MIN_CONTRADICTIONS: u32 = 3;
/// A surfel is unconfirmed if this multiple of the wanted number of clouds could have measured it.
const OPPORTUNITIES: u32 = 4;

/// What a cloud shows about a surfel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// The cloud measured the surfel.
    Measured,
    /// Nothing: the surfel is hidden, or at an edge.
    NotVisible,
    /// The cloud could have measured the surfel, but did not.
    Visible,
    /// The cloud measured a surface behind the surfel.
    Contradicted,
}

/// Whether the model is better without a surfel.
pub(super) fn is_wrong(surfel: &Surfel, min_support: u32) -> bool {
    is_contradicted(surfel) || is_unconfirmed(surfel, min_support)
}

/// Returns what a cloud shows about a projected surfel that it did not measure. `map` shows the surfels before the
/// merge.
pub(super) fn verdict(map: &DepthMap, surface: &OrganizedSurface, seen: &Projection) -> Verdict {
    if map.is_hidden(seen) { Verdict::NotVisible } else { verdict_from_pixels(surface, seen) }
}

/// Returns the verdict of the 3 × 3 pixels around a surfel.
fn verdict_from_pixels(surface: &OrganizedSurface, seen: &Projection) -> Verdict {
    let [u, v] = seen.nearest_px();
    let around = (v - 1..=v + 1).flat_map(|row| (u - 1..=u + 1).map(move |column| (column, row)));
    let margin_m = BEHIND_SHARE * seen.depth_m;
    let (mut behind, mut in_front, mut at_surfel) = (0, 0, 0);
    for depth_m in around.filter_map(|(column, row)| surface.depth_at(column, row)) {
        let off_m = depth_m - seen.depth_m;
        if off_m > margin_m {
            behind += 1;
        } else if off_m < -margin_m {
            in_front += 1;
        } else {
            at_surfel += 1;
        }
    }
    // Points behind are a contradiction only if there are none in front of the surfel or at it. Mixed depths are an
    // edge.
    match (behind, in_front, at_surfel) {
        (0, 0, _) => Verdict::Visible,
        (_, 0, 0) if behind >= MIN_BEHIND => Verdict::Contradicted,
        (0, _, at_surfel) if at_surfel > 0 => Verdict::Visible,
        _ => Verdict::NotVisible,
    }
}

fn is_contradicted(surfel: &Surfel) -> bool {
    surfel.contradictions >= MIN_CONTRADICTIONS && 3 * surfel.contradictions > surfel.support
}

fn is_unconfirmed(surfel: &Surfel, min_support: u32) -> bool {
    surfel.support < min_support && surfel.seen >= OPPORTUNITIES.saturating_mul(min_support)
}
