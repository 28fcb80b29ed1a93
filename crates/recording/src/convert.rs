//! Between the structs of the channels and the messages of the schema.
//!
//! What comes from a file may say anything: a message that no channel could have carried is `None`.

use fringeflow::correspondence::Outcome;
use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_message::{Counts, DELTA_PARTS, DropReason, GaugeReport, HealthReport, Incident, OUTCOMES, Skew, Stage};
use fringeflow_telemetry::health::{HealthState, Quantity};

use super::schema::{
    CloudHeader, CorrespondenceHeader, Drift, Fit, FrameHeader, Gauge, MapsHeader, PatternEvent, StageReport, Window,
    WindowReport,
};

impl FrameHeader {
    pub(super) fn from_header(header: &fringeflow_message::FrameHeader) -> Self {
        let fringeflow_message::FrameHeader {
            session,
            sequence,
            published,
            exposure_start_ns,
            received_ns,
            exposure_ns,
            width_px,
            height_px,
            stride_bytes,
            pixel_format,
            flags,
            camera,
        } = *header;
        Self {
            session,
            sequence,
            published,
            exposure_start_ns,
            received_ns,
            exposure_ns,
            width_px,
            height_px,
            stride_bytes,
            pixel_format,
            flags,
            camera,
        }
    }

    pub(super) fn to_message(self) -> fringeflow_message::FrameHeader {
        let Self {
            session,
            sequence,
            published,
            exposure_start_ns,
            received_ns,
            exposure_ns,
            width_px,
            height_px,
            stride_bytes,
            pixel_format,
            flags,
            camera,
        } = self;
        fringeflow_message::FrameHeader {
            session,
            sequence,
            published,
            exposure_start_ns,
            received_ns,
            exposure_ns,
            width_px,
            height_px,
            stride_bytes,
            pixel_format,
            flags,
            camera,
        }
    }
}

impl PatternEvent {
    pub(super) fn from_event(event: &fringeflow_message::PatternEvent) -> Self {
        let fringeflow_message::PatternEvent {
            session,
            sequence,
            exposure_start_ns,
            duration_ns,
            period_px,
            step,
            steps,
            kind,
            reserved: _,
        } = *event;
        Self { session, sequence, exposure_start_ns, duration_ns, period_px, step, steps, kind }
    }

    pub(super) fn to_message(self) -> fringeflow_message::PatternEvent {
        let Self { session, sequence, exposure_start_ns, duration_ns, period_px, step, steps, kind } = self;
        fringeflow_message::PatternEvent {
            session,
            sequence,
            exposure_start_ns,
            duration_ns,
            period_px,
            step,
            steps,
            kind,
            reserved: 0,
        }
    }
}

impl Window {
    /// `None` for more images than a window has.
    pub(super) fn from_window(window: &fringeflow_message::Window) -> Option<Self> {
        let images = window.images as usize;
        Some(Self {
            cam1_session: window.cam1_session,
            cam2_session: window.cam2_session,
            cam1_sequence: window.cam1_sequence.get(..images)?.to_vec(),
            cam2_sequence: window.cam2_sequence.get(..images)?.to_vec(),
            first_exposure_ns: window.first_exposure_ns,
            last_exposure_ns: window.last_exposure_ns,
            centre_ns: window.centre_ns,
            received_ns: window.received_ns,
            first_step: window.first_step,
            prior: window.prior,
        })
    }

    /// `None` for more images than a window has, or unequal numbers of them.
    pub(super) fn to_message(&self) -> Option<fringeflow_message::Window> {
        let images = self.cam1_sequence.len();
        if images != self.cam2_sequence.len() || images > MAX_IMAGES {
            return None;
        }
        let padded = |numbers: &[u64]| std::array::from_fn(|i| numbers.get(i).copied().unwrap_or_default());
        Some(fringeflow_message::Window {
            cam1_session: self.cam1_session,
            cam2_session: self.cam2_session,
            cam1_sequence: padded(&self.cam1_sequence),
            cam2_sequence: padded(&self.cam2_sequence),
            first_exposure_ns: self.first_exposure_ns,
            last_exposure_ns: self.last_exposure_ns,
            centre_ns: self.centre_ns,
            received_ns: self.received_ns,
            prior: self.prior,
            images: images as u32,
            first_step: self.first_step,
        })
    }
}

impl CloudHeader {
    pub(super) fn from_header(header: &fringeflow_message::CloudHeader) -> Self {
        Self {
            published: header.published,
            window: Window::from_window(&header.window),
            points: header.points,
            delta_mean_rad: header.delta_mean_rad,
            delta_sd_rad: header.delta_sd_rad,
            published_ns: header.published_ns,
        }
    }

    pub(super) fn to_message(&self) -> Option<fringeflow_message::CloudHeader> {
        Some(fringeflow_message::CloudHeader {
            published: self.published,
            window: self.window.as_ref()?.to_message()?,
            points: self.points,
            delta_mean_rad: self.delta_mean_rad,
            delta_sd_rad: self.delta_sd_rad,
            published_ns: self.published_ns,
            // Priors tell it.
            drift: [0.0; _],
        })
    }
}

impl Fit {
    fn from_fit(fit: &fringeflow_message::Fit) -> Self {
        Self {
            valid_pixels: fit.valid_pixels,
            residual_share: fit.residual_share,
            noise_grey: fit.noise_grey,
            noise_gain: fit.noise_gain,
            motion_rad: fit.motion_rad,
            fast_motion_rad: fit.fast_motion_rad,
            brightness_share: fit.brightness_share,
            one_surface_pixels: fit.one_surface_pixels,
            lost_pixels: fit.lost_pixels,
            lit_pixels: fit.lit_pixels,
            saturated_pixels: fit.saturated_pixels,
            dim_pixels: fit.dim_pixels,
            second_harmonic_share: Some(fit.second_harmonic_share).filter(|share| *share >= 0.0),
            third_harmonic_share: Some(fit.third_harmonic_share).filter(|share| *share >= 0.0),
        }
    }

    fn to_message(self) -> fringeflow_message::Fit {
        fringeflow_message::Fit {
            valid_pixels: self.valid_pixels,
            residual_share: self.residual_share,
            noise_grey: self.noise_grey,
            noise_gain: self.noise_gain,
            motion_rad: self.motion_rad,
            fast_motion_rad: self.fast_motion_rad,
            brightness_share: self.brightness_share,
            one_surface_pixels: self.one_surface_pixels,
            lost_pixels: self.lost_pixels,
            lit_pixels: self.lit_pixels,
            saturated_pixels: self.saturated_pixels,
            dim_pixels: self.dim_pixels,
            second_harmonic_share: self.second_harmonic_share.unwrap_or(-1.0),
            third_harmonic_share: self.third_harmonic_share.unwrap_or(-1.0),
        }
    }
}

impl MapsHeader {
    pub(super) fn from_header(header: &fringeflow_message::MapsHeader) -> Self {
        Self {
            published: header.published,
            window: Window::from_window(&header.window),
            cam1: Some(Fit::from_fit(&header.cam1)),
            cam2: Some(Fit::from_fit(&header.cam2)),
            width_px: header.width_px,
            height_px: header.height_px,
            skew_ns: header.skew_ns,
        }
    }

    pub(super) fn to_message(&self) -> Option<fringeflow_message::MapsHeader> {
        Some(fringeflow_message::MapsHeader {
            published: self.published,
            window: self.window.as_ref()?.to_message()?,
            cam1: self.cam1.as_ref()?.to_message(),
            cam2: self.cam2.as_ref()?.to_message(),
            skew_ns: self.skew_ns,
            // The prior tells the one, the accounts the other.
            known_drift: [0.0; _],
            refused_windows: 0,
            width_px: self.width_px,
            height_px: self.height_px,
        })
    }
}

impl CorrespondenceHeader {
    pub(super) fn from_header(header: &fringeflow_message::CorrespondenceHeader) -> Self {
        Self {
            published: header.published,
            window: Window::from_window(&header.window),
            delta_mean_rad: header.delta_mean_rad,
            delta_sd_rad: header.delta_sd_rad,
            delta_noise_sd_rad: header.delta_noise_sd_rad,
            mean_periods: header.mean_periods,
            references: header.references,
            chosen_delta_mean_rad: header.chosen_delta_mean_rad,
            chosen_delta_sd_rad: header.chosen_delta_sd_rad,
            phase_noise_grey: header.phase_noise_grey.to_vec(),
            delta_counts: header.delta_counts.to_vec(),
            width_px: header.width_px,
            height_px: header.height_px,
        }
    }

    pub(super) fn to_message(&self) -> Option<fringeflow_message::CorrespondenceHeader> {
        Some(fringeflow_message::CorrespondenceHeader {
            published: self.published,
            window: self.window.as_ref()?.to_message()?,
            delta_mean_rad: self.delta_mean_rad,
            delta_sd_rad: self.delta_sd_rad,
            delta_noise_sd_rad: self.delta_noise_sd_rad,
            mean_periods: self.mean_periods,
            references: self.references,
            chosen_delta_mean_rad: self.chosen_delta_mean_rad,
            chosen_delta_sd_rad: self.chosen_delta_sd_rad,
            phase_noise_grey: <[f32; 2]>::try_from(self.phase_noise_grey.as_slice()).ok()?,
            delta_counts: delta_counts(&self.delta_counts)?,
            drift: [0.0; _],
            width_px: self.width_px,
            height_px: self.height_px,
        })
    }
}

impl StageReport {
    /// `None` for a stage that is none.
    pub(super) fn from_report(report: &fringeflow_message::StageReport) -> Option<Self> {
        let counts = &report.counts;
        Some(Self {
            stage: Stage::from_code(report.stage)?.name().to_owned(),
            pid: report.pid,
            restarts: report.restarts,
            of_item: report.of_item,
            time_ns: report.time_ns,
            exposure_start_ns: report.exposure_start_ns,
            received_ns: report.received_ns,
            taken_ns: report.taken_ns,
            passed_ns: report.passed_ns,
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
        })
    }

    /// `None` for an unknown stage, reason or incident.
    pub(super) fn to_message(&self) -> Option<fringeflow_message::StageReport> {
        let stage = Stage::ALL.into_iter().find(|stage| stage.name() == self.stage)?;
        let mut counts = Counts { taken: self.taken, passed: self.passed, ..Counts::default() };
        for (name, &count) in &self.dropped {
            let reason = DropReason::ALL.into_iter().find(|reason| reason.name() == name)?;
            counts.drop_many(reason, count);
        }
        for (name, &count) in &self.incidents {
            counts.note(Incident::ALL.into_iter().find(|incident| incident.name() == name)?, count);
        }
        Some(fringeflow_message::StageReport {
            stage: stage as u32,
            pid: self.pid,
            restarts: self.restarts,
            of_item: self.of_item,
            time_ns: self.time_ns,
            exposure_start_ns: self.exposure_start_ns,
            received_ns: self.received_ns,
            taken_ns: self.taken_ns,
            passed_ns: self.passed_ns,
            counts,
            skew: Skew {
                pairs: self.skew_pairs,
                sum_ns: self.skew_sum_ns,
                least_ns: self.skew_least_ns,
                greatest_ns: self.skew_greatest_ns,
            },
        })
    }
}

impl Drift {
    fn from_report(report: &fringeflow_message::DriftReport) -> Self {
        Self {
            rms_rad: report.rms_rad,
            error_px: report.error_px,
            share: report.share,
            residual_sd_rad: report.residual_sd_rad,
        }
    }

    fn to_message(self) -> fringeflow_message::DriftReport {
        fringeflow_message::DriftReport {
            rms_rad: self.rms_rad,
            error_px: self.error_px,
            share: self.share,
            residual_sd_rad: self.residual_sd_rad,
            is_measured: 1,
        }
    }
}

impl Gauge {
    /// All quantities; none of a report without any limits, as windows of older recordings have it.
    fn all_of(report: &HealthReport) -> Vec<Self> {
        let told = Quantity::ALL.into_iter().zip(&report.gauges).filter(|(_, gauge)| gauge.bad > 0.0);
        let gauge = |(quantity, gauge): (Quantity, &GaugeReport)| Self {
            quantity: quantity.name().to_owned(),
            state: HealthState::from_code(gauge.state).name().to_owned(),
            level: gauge.known(),
            warn: gauge.warn,
            bad: gauge.bad,
            since_ns: gauge.since_ns,
        };
        told.map(gauge).collect()
    }

    /// `None` for an unknown quantity or state.
    fn to_message(&self) -> Option<(Quantity, GaugeReport)> {
        let gauge = GaugeReport {
            level: self.level.unwrap_or(0.0),
            warn: self.warn,
            bad: self.bad,
            since_ns: self.since_ns,
            state: HealthState::named(&self.state)? as u32,
            is_known: u32::from(self.level.is_some()),
        };
        Some((Quantity::named(&self.quantity)?, gauge))
    }
}

impl WindowReport {
    pub(super) fn from_report(report: &fringeflow_message::WindowReport) -> Self {
        let count = |outcome: Outcome| report.outcomes[outcome as usize];
        let outcomes = Outcome::ALL.into_iter().filter(|&outcome| count(outcome) > 0);
        Self {
            published: report.published,
            window: Window::from_window(&report.window),
            cam1: Some(Fit::from_fit(&report.cam1)),
            cam2: Some(Fit::from_fit(&report.cam2)),
            delta_mean_rad: report.delta_mean_rad,
            delta_sd_rad: report.delta_sd_rad,
            delta_noise_sd_rad: report.delta_noise_sd_rad,
            delta_threshold_rad: report.delta_threshold_rad,
            delta_median_rad: report.delta_median_rad,
            mean_periods: report.mean_periods,
            expected_false_candidates: report.expected_false_candidates,
            outcomes: outcomes.map(|outcome| (outcome.name().to_owned(), count(outcome))).collect(),
            delta_counts: report.delta_counts.to_vec(),
            drift: report.drift.measured().map(Drift::from_report),
            slip_steps: if report.slip_steps == [0; 2] { Vec::new() } else { report.slip_steps.to_vec() },
            health: Gauge::all_of(&report.health),
            skew_ns: report.skew_ns,
        }
    }

    /// `None` without a window, or with an unknown outcome, quantity or state.
    pub(super) fn to_message(&self) -> Option<fringeflow_message::WindowReport> {
        let mut outcomes = [0; OUTCOMES];
        for (name, &count) in &self.outcomes {
            outcomes[Outcome::ALL.into_iter().find(|outcome| outcome.name() == name)? as usize] = count;
        }
        let mut health = HealthReport::default();
        for gauge in &self.health {
            let (quantity, gauge) = gauge.to_message()?;
            health.gauges[quantity as usize] = gauge;
        }
        Some(fringeflow_message::WindowReport {
            published: self.published,
            window: self.window.as_ref()?.to_message()?,
            cam1: self.cam1.as_ref()?.to_message(),
            cam2: self.cam2.as_ref()?.to_message(),
            delta_mean_rad: self.delta_mean_rad,
            delta_sd_rad: self.delta_sd_rad,
            delta_noise_sd_rad: self.delta_noise_sd_rad,
            delta_threshold_rad: self.delta_threshold_rad,
            delta_median_rad: self.delta_median_rad,
            mean_periods: self.mean_periods,
            expected_false_candidates: self.expected_false_candidates,
            drift: self.drift.map(Drift::to_message).unwrap_or_default(),
            slip_steps: slip_steps(&self.slip_steps)?,
            skew_ns: self.skew_ns,
            health,
            outcomes,
            delta_counts: delta_counts(&self.delta_counts)?,
        })
    }
}

/// From one time to another, milliseconds.
fn milliseconds(from_ns: u64, to_ns: u64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-6
}

/// Slips of both cameras; none where none is told.
fn slip_steps(steps: &[i32]) -> Option<[i32; 2]> {
    if steps.is_empty() { Some([0; 2]) } else { steps.try_into().ok() }
}

/// Counts of δ; all zero where an older recording has none.
fn delta_counts(counts: &[u32]) -> Option<[u32; DELTA_PARTS]> {
    if counts.is_empty() { Some([0; DELTA_PARTS]) } else { counts.try_into().ok() }
}
