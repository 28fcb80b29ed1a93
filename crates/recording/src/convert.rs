//! Conversion between the structs of the channels and the messages of the schema.
//!
//! A file may contain anything. A message that no channel could have carried is converted to `None`.

use fringeflow::correspondence::Outcome;
use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_message::{
    self as structs, Counts, DELTA_PARTS, DropReason, GaugeReport, HealthReport, Incident, LostReason, OUTCOMES, Skew,
    Stage, TrackingState,
};
use fringeflow_telemetry::health::{HealthState, Quantity};
use fringeflow_wire::drift;
use prost::bytes::Bytes;

use crate::schema::{
    CloudHeader, CorrespondenceHeader, Drift, Fit, FrameHeader, Gauge, MapsHeader, PatternEvent, PoseReport, Prior,
    StageReport, TrackedPose, Window, WindowReport,
};

/// A message of the schema that corresponds to a struct of the channels.
pub(super) trait Convert: Sized {
    type Struct;

    /// Converts a struct to a message; `None` if the struct contradicts itself.
    fn from_struct(source: &Self::Struct) -> Option<Self>;

    /// Converts a message to a struct; `None` if no channel could have carried the message.
    fn to_struct(&self) -> Option<Self::Struct>;
}

/// Implements [`Convert`]. The fields in brackets are copied in both directions; the other fields have one expression
/// for each direction.
macro_rules! convert {
    (
        $Message:ident = $Struct:ident, copies [$($same:ident),*],
        from $source:ident $(let $source_name:pat = $source_value:expr;)* { $($field:ident: $from:expr,)* }
        to $message:ident $(let $message_name:pat = $message_value:expr;)* { $($struct_field:ident: $to:expr,)* }
    ) => {
        impl Convert for $Message {
            type Struct = structs::$Struct;

            fn from_struct($source: &structs::$Struct) -> Option<Self> {
                $(let $source_name = $source_value;)*
                Some(Self { $($same: $source.$same,)* $($field: $from,)* })
            }

            fn to_struct(&self) -> Option<structs::$Struct> {
                let $message = self;
                $(let $message_name = $message_value;)*
                Some(structs::$Struct { $($same: $message.$same,)* $($struct_field: $to,)* })
            }
        }
    };
}

convert! {
    FrameHeader = FrameHeader, copies [
        session, sequence, published, exposure_start_ns, received_ns, exposure_ns, width_px, height_px, stride_bytes,
        pixel_format, flags, camera
    ],
    from header {}
    to header {}
}

convert! {
    PatternEvent = PatternEvent,
    copies [session, sequence, exposure_start_ns, duration_ns, period_px, step, steps, kind],
    from event {}
    to event { reserved: 0, }
}

convert! {
    Window = Window, copies [
        cam1_session, cam2_session, first_exposure_ns, last_exposure_ns, centre_ns, received_ns, first_step, prior
    ],
    from window
        let images = window.images as usize;
    {
        cam1_sequence: window.cam1_sequence.get(..images)?.to_vec(),
        cam2_sequence: window.cam2_sequence.get(..images)?.to_vec(),
    }
    to window
        let images = window.cam1_sequence.len();
        let is_possible = images == window.cam2_sequence.len() && images <= MAX_IMAGES;
        let padded = |numbers: &[u64]| std::array::from_fn(|i| numbers.get(i).copied().unwrap_or_default());
    {
        cam1_sequence: padded(&window.cam1_sequence),
        cam2_sequence: padded(&window.cam2_sequence),
        images: is_possible.then_some(images as u32)?,
    }
}

convert! {
    CloudHeader = CloudHeader, copies [published, points, delta_mean_rad, delta_sd_rad, published_ns],
    from header { window: Window::from_struct(&header.window), }
    to header {
        window: header.window.as_ref()?.to_struct()?,
        // The drift is recorded with the prior after the cloud.
        drift: [0.0; _],
    }
}

convert! {
    Fit = Fit, copies [
        valid_pixels, residual_share, noise_grey, noise_gain, motion_rad, fast_motion_rad, brightness_share,
        one_surface_pixels, lost_pixels, lit_pixels, saturated_pixels, dim_pixels, unlit_share, unused_range_share
    ],
    from fit {
        second_harmonic_share: Some(fit.second_harmonic_share).filter(|share| *share >= 0.0),
        third_harmonic_share: Some(fit.third_harmonic_share).filter(|share| *share >= 0.0),
    }
    to fit {
        second_harmonic_share: fit.second_harmonic_share.unwrap_or(-1.0),
        third_harmonic_share: fit.third_harmonic_share.unwrap_or(-1.0),
    }
}

convert! {
    MapsHeader = MapsHeader, copies [published, width_px, height_px, skew_ns],
    from header {
        window: Window::from_struct(&header.window),
        cam1: Fit::from_struct(&header.cam1),
        cam2: Fit::from_struct(&header.cam2),
    }
    to header {
        window: header.window.as_ref()?.to_struct()?,
        cam1: header.cam1.as_ref()?.to_struct()?,
        cam2: header.cam2.as_ref()?.to_struct()?,
        // The drift is recorded with the prior, and the refused windows with the stage reports.
        known_drift: [0.0; _],
        refused_windows: 0,
    }
}

convert! {
    CorrespondenceHeader = CorrespondenceHeader, copies [
        published, delta_mean_rad, delta_sd_rad, delta_noise_sd_rad, mean_periods, references, chosen_delta_mean_rad,
        chosen_delta_sd_rad, width_px, height_px
    ],
    from header {
        window: Window::from_struct(&header.window),
        phase_noise_grey: header.phase_noise_grey.to_vec(),
        delta_counts: header.delta_counts.to_vec(),
    }
    to header {
        window: header.window.as_ref()?.to_struct()?,
        phase_noise_grey: array(&header.phase_noise_grey)?,
        delta_counts: delta_counts(&header.delta_counts)?,
        drift: [0.0; _],
    }
}

convert! {
    StageReport = StageReport, copies [
        pid, restarts, of_item, time_ns, exposure_start_ns, received_ns, taken_ns, passed_ns
    ],
    from report
        let counts = &report.counts;
    {
        stage: Stage::from_code(report.stage)?.name().to_owned(),
        taken: counts.taken,
        passed: counts.passed,
        dropped: counts.reasons().map(|(reason, count)| (reason.name().to_owned(), count)).collect(),
        incidents: counts.incidents().map(|(incident, count)| (incident.name().to_owned(), count)).collect(),
        skew_pairs: report.skew.pairs,
        skew_sum_ns: report.skew.sum_ns,
        skew_least_ns: report.skew.least_ns,
        skew_greatest_ns: report.skew.greatest_ns,
        latency_ms: milliseconds(report.taken_ns, report.passed_ns),
        since_exposure_ms: milliseconds(report.exposure_start_ns, report.passed_ns),
    }
    to report {
        stage: Stage::from_name(&report.stage)? as u32,
        work_ns: 0,
        cpu_ns: 0,
        processors: 0,
        at_once: 0,
        counts: counts(report)?,
        skew: Skew {
            pairs: report.skew_pairs,
            sum_ns: report.skew_sum_ns,
            least_ns: report.skew_least_ns,
            greatest_ns: report.skew_greatest_ns,
        },
    }
}

convert! {
    Drift = DriftReport, copies [rms_rad, error_px, share, residual_sd_rad],
    from drift {}
    to drift { is_measured: 1, }
}

convert! {
    WindowReport = WindowReport, copies [
        published, delta_mean_rad, delta_sd_rad, delta_noise_sd_rad, delta_threshold_rad, delta_median_rad,
        mean_periods, expected_false_candidates, skew_ns
    ],
    from report
        let count = |outcome: Outcome| report.outcomes[outcome as usize];
        let outcomes = Outcome::ALL.into_iter().filter(|&outcome| count(outcome) > 0);
    {
        window: Window::from_struct(&report.window),
        cam1: Fit::from_struct(&report.cam1),
        cam2: Fit::from_struct(&report.cam2),
        outcomes: outcomes.map(|outcome| (outcome.name().to_owned(), count(outcome))).collect(),
        delta_counts: report.delta_counts.to_vec(),
        drift: report.drift.measured().and_then(Drift::from_struct),
        slip_steps: if report.slip_steps == [0; 2] { Vec::new() } else { report.slip_steps.to_vec() },
        health: gauges(&report.health),
    }
    to report {
        window: report.window.as_ref()?.to_struct()?,
        cam1: report.cam1.as_ref()?.to_struct()?,
        cam2: report.cam2.as_ref()?.to_struct()?,
        drift: report.drift.as_ref().and_then(Drift::to_struct).unwrap_or_default(),
        // If the field is absent, there was no slip.
        slip_steps: if report.slip_steps.is_empty() { [0; 2] } else { array(&report.slip_steps)? },
        health: health(&report.health)?,
        outcomes: outcomes(report)?,
        delta_counts: delta_counts(&report.delta_counts)?,
    }
}

convert! {
    PoseReport = PoseReport, copies [
        published, cloud, first_cloud, published_ns, sd_m, sd_rad, rms_m, excess, share, inliers, model_points,
        model_clouds
    ],
    from report {
        window: Window::from_struct(&report.window),
        state: report.state()?.name().to_owned(),
        reason: report.reason().map_or("", LostReason::name).to_owned(),
        pose: report.has_pose().then(|| TrackedPose {
            position_m: report.position_m.to_vec(),
            rotation: report.rotation.to_vec(),
            covariance: report.covariance.concat(),
        }),
    }
    to report
        let state = TrackingState::from_name(&report.state)?;
        let reason = LostReason::from_name(&report.reason);
        // A lost cloud has a reason and no pose; every other cloud has a pose and no reason.
        let is_lost = state == TrackingState::Lost;
        let is_possible = is_lost == reason.is_some() && is_lost == report.pose.is_none();
        let (position_m, rotation, covariance) = match &report.pose {
            Some(pose) => pose_numbers(pose)?,
            None => ([0.0; 3], [0.0; 4], [[0.0; 6]; 6]),
        };
    {
        window: report.window.as_ref()?.to_struct()?,
        position_m: position_m,
        rotation: rotation,
        covariance: covariance,
        state: is_possible.then_some(state as u32)?,
        reason: reason.map_or(0, |reason| reason as u32),
    }
}

convert! {
    Prior = PriorHeader, copies [published, cloud, centre_ns, published_ns, width_px, height_px],
    from header {
        velocity_m_s: header.velocity_m_s.to_vec(),
        rate_rad_s: header.rate_rad_s.to_vec(),
        // The caller adds the payload.
        relief: Bytes::new(),
        drift: drift::read(&header.drift).map_or(Vec::new(), |drift| drift.to_numbers().to_vec()),
    }
    to prior {
        velocity_m_s: array(&prior.velocity_m_s)?,
        rate_rad_s: array(&prior.rate_rad_s)?,
        // Recordings of earlier versions contain no drift.
        drift: array(&prior.drift).unwrap_or_default(),
    }
}

/// Position, rotation and covariance.
type PoseNumbers = ([f64; 3], [f64; 4], [[f64; 6]; 6]);

/// Returns the numbers of a pose; `None` if they are not a valid pose.
fn pose_numbers(pose: &TrackedPose) -> Option<PoseNumbers> {
    let (position_m, rotation): ([f64; 3], [f64; 4]) = (array(&pose.position_m)?, array(&pose.rotation)?);
    let (rows, rest) = pose.covariance.as_chunks::<6>();
    let covariance: [[f64; 6]; 6] = rows.try_into().ok().filter(|_| rest.is_empty())?;
    let length = rotation.iter().map(|x| x * x).sum::<f64>().sqrt();
    let is_finite = position_m.iter().chain(&pose.covariance).all(|x| x.is_finite());
    (is_finite && (length - 1.0).abs() <= 1e-6).then_some((position_m, rotation, covariance))
}

fn array<T: Copy, const N: usize>(numbers: &[T]) -> Option<[T; N]> {
    numbers.try_into().ok()
}

/// Returns the difference of two times, milliseconds.
fn milliseconds(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-6
}

/// Returns the counts of a stage; `None` for an unknown reason or incident, and for counts that no run reaches, whose
/// sums would overflow.
fn counts(report: &StageReport) -> Option<Counts> {
    let possible = |count: u64| (count < 1 << 48).then_some(count);
    let (taken, passed) = (possible(report.taken)?, possible(report.passed)?);
    let mut counts = Counts { taken, passed, ..Counts::default() };
    for (name, &count) in &report.dropped {
        counts.drop_many(DropReason::from_name(name)?, possible(count)?);
    }
    for (name, &count) in &report.incidents {
        counts.note(Incident::from_name(name)?, possible(count)?);
    }
    Some(counts)
}

/// Returns the numbers of pixels by outcome; `None` for an unknown outcome.
fn outcomes(report: &WindowReport) -> Option<[u64; OUTCOMES]> {
    let mut outcomes = [0; OUTCOMES];
    for (name, &count) in &report.outcomes {
        outcomes[Outcome::ALL.into_iter().find(|outcome| outcome.name() == name)? as usize] = count;
    }
    Some(outcomes)
}

/// Returns the histogram of δ; all zero if an older recording has none.
fn delta_counts(counts: &[u32]) -> Option<[u32; DELTA_PARTS]> {
    if counts.is_empty() { Some([0; DELTA_PARTS]) } else { array(counts) }
}

/// Returns all quantities; none for a report without limits, as in windows of older recordings.
fn gauges(report: &HealthReport) -> Vec<Gauge> {
    let known = Quantity::ALL.into_iter().zip(&report.gauges).filter(|(_, gauge)| gauge.bad > 0.0);
    let gauge = |(quantity, gauge): (Quantity, &GaugeReport)| Gauge {
        quantity: quantity.name().to_owned(),
        state: HealthState::from_code(gauge.state).name().to_owned(),
        level: gauge.known(),
        warn: gauge.warn,
        bad: gauge.bad,
        since_ns: gauge.since_ns,
    };
    known.map(gauge).collect()
}

/// Returns the health with these quantities; `None` for an unknown quantity or state.
fn health(gauges: &[Gauge]) -> Option<HealthReport> {
    let mut health = HealthReport::default();
    for gauge in gauges {
        health.gauges[Quantity::from_name(&gauge.quantity)? as usize] = GaugeReport {
            level: gauge.level.unwrap_or(0.0),
            warn: gauge.warn,
            bad: gauge.bad,
            since_ns: gauge.since_ns,
            state: HealthState::from_name(&gauge.state)? as u32,
            is_known: u32::from(gauge.level.is_some()),
        };
    }
    Some(health)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::pose_report;

    #[test]
    fn an_impossible_pose_is_refused() {
        let whole = PoseReport::from_struct(&pose_report()).unwrap();
        assert_eq!(whole.to_struct().unwrap(), pose_report());
        let changed = |change: fn(&mut PoseReport)| {
            let mut report = whole.clone();
            change(&mut report);
            report.to_struct()
        };
        assert_eq!(changed(|r| r.state = "found".to_owned()), None);
        assert_eq!(changed(|r| r.state = "lost".to_owned()), None);
        assert_eq!(changed(|r| r.reason = "degenerate".to_owned()), None);
        assert_eq!(changed(|r| r.pose = None), None);
        assert_eq!(changed(|r| r.window = None), None);
        assert_eq!(changed(|r| r.pose.as_mut().unwrap().rotation[3] = 3.0), None);
        assert_eq!(changed(|r| r.pose.as_mut().unwrap().position_m[0] = f64::NAN), None);
        assert_eq!(changed(|r| r.pose.as_mut().unwrap().covariance.truncate(35)), None);
        let lost = structs::PoseReport {
            state: TrackingState::Lost as u32,
            reason: LostReason::Degenerate as u32,
            position_m: [0.0; 3],
            rotation: [0.0; 4],
            covariance: [[0.0; 6]; 6],
            ..pose_report()
        };
        assert_eq!(PoseReport::from_struct(&lost).unwrap().to_struct(), Some(lost));
    }
}
