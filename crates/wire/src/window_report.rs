//! The report on the quality of a window.

use std::f64::consts::TAU;

use fringeflow::correspondence::{Drift, Matches, OutcomeCounts};
use fringeflow::worker::Correspondences;
use fringeflow_message::{DriftReport, MapsHeader, OUTCOMES, WindowReport};
use fringeflow_telemetry::health::Health;

use super::correspondences::delta_counts;
use super::health::health_report;

/// Creates the report on a window, from the header of its phase maps and its correspondences. The correspondences have
/// the number `published` in their channel, and `health` already includes them.
#[must_use]
pub fn window_report(maps: &MapsHeader, found: &Correspondences, published: u64, health: &Health) -> WindowReport {
    let (matches, delta) = (&found.matches, &found.matches.delta);
    let mut outcomes = [0; OUTCOMES];
    for (outcome, count) in OutcomeCounts::from_outcomes(&matches.outcomes).iter() {
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
        drift: matches.drift.as_ref().map(drift_report).unwrap_or_default(),
        skew_ns: maps.skew_ns,
        health: health_report(health),
        slip_steps: found.matches.slip_steps.map(|steps| steps as i32),
        outcomes,
        delta_counts: delta_counts(matches),
    }
}

fn drift_report(drift: &Drift) -> DriftReport {
    DriftReport {
        rms_rad: drift.rms_rad,
        error_px: drift.error_px,
        share: drift.share,
        residual_sd_rad: drift.residual_sd_rad,
        is_measured: 1,
    }
}

/// Median of δ over the chosen candidates, rad; 0 if there are none.
fn median_rad(matches: &Matches) -> f64 {
    // Counting a million values is faster than sorting them.
    let mut counts = vec![0_u32; 1 << u16::BITS];
    let mut found = 0;
    for (outcome, &delta) in matches.outcomes.iter().zip(&matches.chosen.delta) {
        let is_found = u32::from(outcome.is_found());
        counts[usize::from(delta.wrapping_sub(i16::MIN) as u16)] += is_found;
        found += is_found;
    }
    if found == 0 {
        return 0.0;
    }
    let mut below = 0;
    let reaches_middle = |count: &u32| {
        below += count;
        below > found / 2
    };
    let index = counts.iter().position(reaches_middle).unwrap_or(0);
    (index as f64 + f64::from(i16::MIN)) / 65536.0 * TAU
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::health::health_measures;
    use fringeflow::correspondence::{ChosenCandidates, Outcome};
    use fringeflow_telemetry::health::{HealthLimits, Quantity};

    #[test]
    fn pixels_are_counted_by_outcome_and_the_median_is_of_the_chosen() {
        let matches = Matches {
            outcomes: vec![Outcome::Unique, Outcome::Unique, Outcome::Invalid, Outcome::Unique],
            chosen: ChosenCandidates { delta: vec![-300, 8192, 0, 30000], ..ChosenCandidates::default() },
            delta_counts: vec![7],
            ..Matches::default()
        };
        let found = Correspondences { matches, ..Correspondences::default() };
        let health = Health::new(&HealthLimits::default());
        let report = window_report(&MapsHeader::default(), &found, 5, &health);
        assert_eq!((report.outcomes[Outcome::Unique as usize], report.outcomes[Outcome::Invalid as usize]), (3, 1));
        assert_eq!((report.outcomes.iter().sum::<u64>(), report.delta_counts[0], report.published), (4, 7, 5));
        assert!((report.delta_median_rad - TAU / 8.0).abs() < 1e-12);
        let nothing = window_report(&MapsHeader::default(), &Correspondences::default(), 0, &health);
        assert_eq!((nothing.delta_median_rad, nothing.drift.measured()), (0.0, None));
    }

    #[test]
    fn a_report_contains_the_drift_and_the_health() {
        let mut found = Correspondences::default();
        let drift = found.matches.drift.insert(Drift::default());
        (drift.rms_rad, drift.error_px, drift.share, drift.residual_sd_rad) = (0.2, 0.5, 0.9, 0.01);
        let (maps, mut health) =
            (MapsHeader { skew_ns: 7, ..MapsHeader::default() }, Health::new(&HealthLimits::default()));
        (0..5).for_each(|time_ns| {
            health.add(time_ns, &health_measures([&maps.cam1, &maps.cam2], maps.skew_ns, &found.matches, true));
        });
        let report = window_report(&maps, &found, 0, &health);
        let drift = report.drift.measured().unwrap();
        assert_eq!([drift.rms_rad, drift.error_px, drift.share, drift.residual_sd_rad], [0.2, 0.5, 0.9, 0.01]);
        assert_eq!((report.skew_ns, report.health.gauges[Quantity::Drift as usize].known()), (7, Some(0.2)));
    }
}
