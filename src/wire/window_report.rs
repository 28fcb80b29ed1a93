//! Figures of a window, from what was found in it.

use std::f64::consts::TAU;

use crate::correspondence::{Candidate, Matches, OutcomeCounts};
use crate::message::{MapsHeader, OUTCOMES, WindowReport};
use crate::worker::Correspondences;

use super::correspondences::delta_counts;

/// The report on correspondences found in phase maps with this header, number `published` of their channel.
#[must_use]
pub fn window_report(maps: &MapsHeader, found: &Correspondences, published: u64) -> WindowReport {
    let (matches, delta) = (&found.matches, &found.matches.delta);
    let mut outcomes = [0; OUTCOMES];
    for (outcome, count) in OutcomeCounts::of(&matches.outcomes).iter() {
        outcomes[outcome as usize] = count;
    }
    WindowReport {
        published,
        window: maps.window,
        cam1: maps.cam1,
        cam2: maps.cam2,
        delta_mean_rad: delta.mean_rad,
        delta_sd_rad: delta.sd_rad,
        delta_noise_sd_rad: delta.noise_sd_rad,
        delta_threshold_rad: delta.threshold_rad(),
        delta_median_rad: median_rad(matches),
        mean_periods: delta.mean_periods,
        expected_false_candidates: delta.expected_false_candidates(),
        outcomes,
        delta_counts: delta_counts(matches),
    }
}

/// Median of δ over the chosen candidates, rad; 0 without any.
fn median_rad(matches: &Matches) -> f64 {
    let mut deltas: Vec<i16> = matches.chosen.iter().flatten().map(|candidate: &Candidate| candidate.delta).collect();
    if deltas.is_empty() {
        return 0.0;
    }
    let middle = deltas.len() / 2;
    let (_, median, _) = deltas.select_nth_unstable(middle);
    f64::from(*median) / 65536.0 * TAU
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::Outcome;

    #[test]
    fn pixels_are_counted_by_outcome_and_the_median_is_of_the_chosen() {
        let chosen = |delta| Some(Candidate { column_px: 0.0, order: 0, delta, slope: 0 });
        let matches = Matches {
            outcomes: vec![Outcome::Unique, Outcome::Unique, Outcome::Invalid, Outcome::Unique],
            chosen: vec![chosen(-300), chosen(8192), None, chosen(30000)],
            delta_counts: vec![7],
            ..Matches::default()
        };
        let found = Correspondences { matches, ..Correspondences::default() };
        let report = window_report(&MapsHeader::default(), &found, 5);
        assert_eq!((report.outcomes[Outcome::Unique as usize], report.outcomes[Outcome::Invalid as usize]), (3, 1));
        assert_eq!((report.outcomes.iter().sum::<u64>(), report.delta_counts[0], report.published), (4, 7, 5));
        assert!((report.delta_median_rad - TAU / 8.0).abs() < 1e-12);
        let nothing = window_report(&MapsHeader::default(), &Correspondences::default(), 0);
        assert_eq!(nothing.delta_median_rad, 0.0);
    }
}
