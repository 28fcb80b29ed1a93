//! Health of the scanner: the measured quantities of a window, and the health as a report.

use fringeflow::correspondence::{Drift, Matches};
use fringeflow_message::{Fit, GAUGES, HealthReport};
use fringeflow_telemetry::health::{Health, Measures, Quantity};

// A report has an entry for each quantity.
const _: () = assert!(Quantity::ALL.len() <= GAUGES);

/// If the phase moves faster than this, rad per image, the motion dominates δ and hides the calibration.
const MAX_STEADY_RAD: f64 = 0.4;

/// Returns the quantities of a window that its images alone show. `skew_ns` is the delay of camera 2 after camera 1.
#[must_use]
pub fn image_measures(cameras: [&Fit; 2], skew_ns: i64) -> Measures {
    let fit = |camera: usize, value: fn(&Fit) -> Option<f64>| value(cameras[camera]);
    let greater = |value: fn(&Fit) -> Option<f64>| Some(value(cameras[0])?.max(value(cameras[1])?));
    Quantity::ALL.map(|quantity| match quantity {
        Quantity::ResidualCam1 => fit(0, residual),
        Quantity::ResidualCam2 => fit(1, residual),
        Quantity::HarmonicsCam1 => fit(0, harmonics),
        Quantity::HarmonicsCam2 => fit(1, harmonics),
        Quantity::SaturatedCam1 => fit(0, |fit| share(fit.saturated_pixels, fit.lit_pixels)),
        Quantity::SaturatedCam2 => fit(1, |fit| share(fit.saturated_pixels, fit.lit_pixels)),
        Quantity::DimCam1 => fit(0, |fit| share(fit.dim_pixels, fit.lit_pixels)),
        Quantity::DimCam2 => fit(1, |fit| share(fit.dim_pixels, fit.lit_pixels)),
        Quantity::UnlitCam1 => fit(0, |fit| Some(fit.unlit_share.into())),
        Quantity::UnlitCam2 => fit(1, |fit| Some(fit.unlit_share.into())),
        Quantity::UnusedRangeCam1 => fit(0, |fit| Some(fit.unused_range_share.into())),
        Quantity::UnusedRangeCam2 => fit(1, |fit| Some(fit.unused_range_share.into())),
        Quantity::Skew => Some(skew_ns.unsigned_abs() as f64 * 1e-6),
        Quantity::Motion => greater(|fit| with_motion(fit).map(|fit| fit.fast_motion_rad.into())),
        Quantity::Brightness => greater(|fit| with_motion(fit).map(|fit| fit.brightness_share.into())),
        Quantity::OneSurface => greater(|fit| share(with_motion(fit)?.one_surface_pixels, fit.valid_pixels)),
        Quantity::Lost => greater(|fit| share(with_motion(fit)?.lost_pixels, fit.lit_pixels)),
        Quantity::Drift
        | Quantity::DeltaSd
        | Quantity::DeltaNoise
        | Quantity::DeltaMean
        | Quantity::Slipped
        | Quantity::Unexplained
        | Quantity::FalseCandidates => None,
    })
}

/// Returns the measured quantities of a window, from the header of its phase maps and its matches. `is_in_step` states
/// whether the images are known to show the declared phase shifts, see [`crate::in_step`].
#[must_use]
pub fn health_measures(cameras: [&Fit; 2], skew_ns: i64, matches: &Matches, is_in_step: bool) -> Measures {
    // A drift describes the scene, not the calibration, if few pixels agree with it.
    let drift = matches.drift.as_ref().filter(|drift| drift.explains_most_pixels());
    // After a slip, the images of a pair show different moments. During fast motion, the motion differs between the
    // cameras. Neither is an error of the calibration.
    let motion = cameras.iter().filter_map(|fit| with_motion(fit)).map(|fit| f64::from(fit.fast_motion_rad));
    let is_steady = is_in_step && matches.slip_steps == [0; 2] && motion.fold(0.0, f64::max) <= MAX_STEADY_RAD;
    let drift = drift.filter(|_| is_steady);
    let mut measures = image_measures(cameras, skew_ns);
    let mut set = |quantity: Quantity, value: Option<f64>| measures[quantity as usize] = value;
    set(Quantity::Drift, drift.map(|drift| drift.rms_rad));
    set(Quantity::DeltaSd, is_steady.then_some(matches.delta.sd_rad));
    set(Quantity::DeltaNoise, drift.map(|drift| drift.residual_sd_rad));
    set(Quantity::DeltaMean, is_steady.then_some(matches.delta.mean_rad.abs()));
    set(Quantity::Slipped, Some(f64::from(u8::from(matches.slip_steps != [0; 2]))));
    let in_step = matches.drift.as_ref().filter(|_| is_in_step);
    set(Quantity::Unexplained, in_step.map(|drift| 1.0 - drift.share));
    let steady = matches.drift.as_ref().filter(|_| is_steady);
    let efc = |drift: &Drift| drift.residual_statistics(&matches.delta).expected_false_candidates();
    set(Quantity::FalseCandidates, steady.map(efc));
    measures
}

/// Converts the health to a report.
#[must_use]
pub fn health_report(health: &Health) -> HealthReport {
    let mut report = HealthReport::default();
    report.gauges.iter_mut().zip(health.gauges()).for_each(|(entry, gauge)| *entry = gauge.report());
    report
}

fn residual(fit: &Fit) -> Option<f64> {
    (fit.residual_share >= 0.0).then_some(fit.residual_share.into())
}

/// Amplitude of all harmonics that the phase shifts can show.
fn harmonics(fit: &Fit) -> Option<f64> {
    let measured = [fit.second_harmonic_share, fit.third_harmonic_share].into_iter().filter(|share| *share >= 0.0);
    measured.map(f64::from).reduce(f64::hypot)
}

/// Returns the fit if motion was measured.
fn with_motion(fit: &Fit) -> Option<&Fit> {
    (fit.fast_motion_rad >= 0.0).then_some(fit)
}

fn share(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow::worker::Correspondences;
    use fringeflow_message::MapsHeader;
    use fringeflow_telemetry::health::{HealthLimits, HealthState};

    fn drift(rms_rad: f64, residual_sd_rad: f64, share: f64) -> Drift {
        let mut drift = Drift::default();
        (drift.rms_rad, drift.residual_sd_rad, drift.share) = (rms_rad, residual_sd_rad, share);
        drift
    }

    fn fit() -> Fit {
        Fit {
            valid_pixels: 80,
            lit_pixels: 100,
            saturated_pixels: 5,
            dim_pixels: 40,
            residual_share: 0.02,
            second_harmonic_share: 0.03,
            third_harmonic_share: -1.0,
            fast_motion_rad: 0.25,
            one_surface_pixels: 4,
            lost_pixels: 1,
            ..Fit::default()
        }
    }

    #[test]
    fn each_quantity_is_that_of_its_camera_or_the_maximum_of_both() {
        let cam2 = Fit { third_harmonic_share: 0.04, saturated_pixels: 0, fast_motion_rad: 0.375, ..fit() };
        let maps = MapsHeader { cam1: fit(), cam2, skew_ns: -2_500_000, ..MapsHeader::default() };
        let mut found = Correspondences::default();
        found.matches.drift = Some(drift(0.2, 0.01, 0.9));
        (found.matches.delta.sd_rad, found.matches.delta.mean_rad) = (0.21, -0.3);
        found.matches.delta.mean_periods = 6.0;
        let measures = health_measures([&maps.cam1, &maps.cam2], maps.skew_ns, &found.matches, true);
        let value = |quantity: Quantity| (measures[quantity as usize].unwrap() * 1e6).round() * 1e-6;
        for (quantity, expected) in [
            (Quantity::Drift, 0.2),
            (Quantity::DeltaSd, 0.21),
            (Quantity::DeltaNoise, 0.01),
            (Quantity::DeltaMean, 0.3),
            (Quantity::ResidualCam2, 0.02),
            (Quantity::HarmonicsCam1, 0.03),
            (Quantity::HarmonicsCam2, 0.05),
            (Quantity::SaturatedCam1, 0.05),
            (Quantity::SaturatedCam2, 0.0),
            (Quantity::DimCam1, 0.4),
            (Quantity::Skew, 2.5),
            (Quantity::Motion, 0.375),
            (Quantity::OneSurface, 0.05),
            (Quantity::Lost, 0.01),
            (Quantity::Slipped, 0.0),
            (Quantity::Unexplained, 0.1),
            (Quantity::FalseCandidates, 0.047_746),
        ] {
            assert!(
                (value(quantity) - expected).abs() < 1e-6,
                "{quantity:?}: {} instead of {expected}",
                value(quantity)
            );
        }
    }

    #[test]
    fn slips_and_fast_motion_are_not_reported_as_a_drift_of_the_calibration() {
        let of_calibration =
            [Quantity::Drift, Quantity::DeltaSd, Quantity::DeltaNoise, Quantity::DeltaMean, Quantity::FalseCandidates];
        let measures = |fast_motion_rad: f32, slip_steps: [usize; 2]| {
            let maps = MapsHeader { cam1: fit(), cam2: Fit { fast_motion_rad, ..fit() }, ..MapsHeader::default() };
            let mut found = Correspondences::default();
            found.matches.drift = Some(drift(0.5, 0.01, 0.9));
            found.matches.slip_steps = slip_steps;
            let measures = health_measures([&maps.cam1, &maps.cam2], maps.skew_ns, &found.matches, true);
            assert_eq!(measures[Quantity::Slipped as usize], Some(f64::from(u8::from(slip_steps != [0; 2]))));
            of_calibration.map(|quantity| measures[quantity as usize].is_some())
        };
        assert_eq!(measures(0.3, [0, 0]), [true; 5]);
        assert_eq!(measures(0.5, [0, 0]), [false; 5]);
        assert_eq!(measures(0.3, [0, 1]), [false; 5]);
        assert_eq!(measures(0.3, [2, 2]), [false; 5]);
        let found = Correspondences {
            matches: Matches { drift: Some(drift(0.5, 0.01, 0.9)), ..Matches::default() },
            ..Correspondences::default()
        };
        let out_of_step = health_measures([&Fit::default(); 2], 0, &found.matches, false);
        assert!(of_calibration.iter().all(|&quantity| out_of_step[quantity as usize].is_none()));
        // If motion is not measured, the scene counts as steady.
        assert_eq!(measures(-1.0, [0, 0]), [true; 5]);
    }

    #[test]
    fn unmeasured_quantities_are_absent() {
        let silent = Fit {
            residual_share: -1.0,
            second_harmonic_share: -1.0,
            third_harmonic_share: -1.0,
            fast_motion_rad: -1.0,
            ..Fit::default()
        };
        let maps = MapsHeader { cam1: fit(), cam2: silent, ..MapsHeader::default() };
        let mut found = Correspondences::default();
        found.matches.drift = Some(drift(0.9, 0.01, 0.3));
        let measures = health_measures([&maps.cam1, &maps.cam2], maps.skew_ns, &found.matches, true);
        let absent = Quantity::ALL.into_iter().filter(|&quantity| measures[quantity as usize].is_none());
        let expected = [
            Quantity::SaturatedCam2,
            Quantity::DimCam2,
            Quantity::ResidualCam2,
            Quantity::HarmonicsCam2,
            Quantity::Drift,
            Quantity::DeltaNoise,
            Quantity::Motion,
            Quantity::Brightness,
            Quantity::OneSurface,
            Quantity::Lost,
        ];
        assert_eq!(absent.collect::<Vec<_>>(), expected);
    }

    #[test]
    fn a_report_has_levels_limits_and_states() {
        let mut health = Health::new(&HealthLimits::default());
        let mut found = Correspondences::default();
        found.matches.drift = Some(drift(0.15, 0.01, 0.9));
        for window in 0..5 {
            let report = health_report(&health);
            assert_eq!(report.gauges[Quantity::Drift as usize].known(), None, "{window}");
            health.add(100 + window, &health_measures([&Fit::default(); 2], 0, &found.matches, true));
        }
        let gauge = health_report(&health).gauges[Quantity::Drift as usize];
        let limits = HealthLimits::default().limits_of(Quantity::Drift);
        assert_eq!((gauge.known(), gauge.warn, gauge.bad), (Some(0.15), limits.warn, limits.bad));
        assert_eq!((HealthState::from_code(gauge.state), gauge.since_ns), (HealthState::Warn, 104));
    }
}
