//! Which surfels a cloud speaks against: those it sees through, and those it could have seen and never did.

use rayon::prelude::*;

use crate::registration::OrganizedSurface;

use super::index_map::{IndexMap, Seen};
use super::merge::Placement;
use super::surfel::Surfel;

/// Measured this much behind a surfel, it is not there: share of the depth, 1 mm at 0.3 m; well above any noise, so that a
/// surfel falls for a false point or a thing that was taken away.
const BEHIND_SHARE: f64 = 0.0033;
/// Pixels around a surfel of which so many must be measured, and all behind, to speak against it: at edges of bodies some
/// always are.
const MIN_BEHIND: usize = 5;
/// Contradictions that a surfel never survives, if they are more than a third of its support.
const MAX_CONTRADICTIONS: u32 = 3;
/// A surfel that so many times the wanted number of clouds could have seen has had its chance.
const CHANCES: u32 = 4;

/// What a cloud says about a surfel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Word {
    /// Nothing: it is beyond the image, turned away, hidden, or at an edge.
    Nothing,
    /// It could have been measured, whether it was or not.
    Seen,
    /// What lies behind it was measured.
    Contradicted,
}

/// Counts what a cloud says about each surfel, and removes those that too much speaks against; returns how many.
///
/// The map is of the surfels before the merge; those made since are seen by the cloud that made them.
pub(super) fn clean(
    surfels: &mut Vec<Surfel>,
    map: &IndexMap,
    surface: &OrganizedSurface,
    placement: &Placement,
    min_support: u32,
) -> usize {
    let words: Vec<Word> = (0..surfels.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|place| if surfels[place].last == placement.cloud { Word::Seen } else { word(map, surface, place) })
        .collect();
    let before = surfels.len();
    for (surfel, word) in surfels.iter_mut().zip(words) {
        surfel.seen += u32::from(word != Word::Nothing);
        surfel.contradictions += u32::from(word == Word::Contradicted);
    }
    surfels.retain(|surfel| !is_contradicted(surfel) && !is_unconfirmed(surfel, min_support));
    before - surfels.len()
}

fn word(map: &IndexMap, surface: &OrganizedSurface, place: usize) -> Word {
    match map.seen(place) {
        Some(seen) if !map.hides(seen) => beside(surface, seen),
        _ => Word::Nothing,
    }
}

/// What the pixels around a surfel say.
fn beside(surface: &OrganizedSurface, seen: &Seen) -> Word {
    let [u, v] = [seen.pixel.x.round() as isize, seen.pixel.y.round() as isize];
    let around = (v - 1..=v + 1).flat_map(|row| (u - 1..=u + 1).map(move |column| (column, row)));
    let margin_m = BEHIND_SHARE * seen.depth_m;
    let (mut behind, mut before, mut there) = (0, 0, 0);
    for point in around.filter_map(|(column, row)| surface.at(column, row)) {
        let off_m = f64::from(point.position_m[2]) - seen.depth_m;
        if off_m > margin_m {
            behind += 1;
        } else if off_m < -margin_m {
            before += 1;
        } else {
            there += 1;
        }
    }
    match (behind, before, there) {
        (0, 0, _) => Word::Seen,
        (_, 0, 0) if behind >= MIN_BEHIND => Word::Contradicted,
        (0, _, there) if there > 0 => Word::Seen,
        _ => Word::Nothing,
    }
}

fn is_contradicted(surfel: &Surfel) -> bool {
    surfel.contradictions >= MAX_CONTRADICTIONS && 3 * surfel.contradictions > surfel.support
}

fn is_unconfirmed(surfel: &Surfel, min_support: u32) -> bool {
    surfel.support < min_support && surfel.seen >= CHANCES.saturating_mul(min_support)
}
