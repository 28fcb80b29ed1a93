//! Figures of the tracking, from the last pose reports.

use std::fmt;

use serde::Serialize;

use fringeflow_message::{Counts, LostReason, PoseReport};

/// Time without a report after which the state is `no_cloud`, nanoseconds.
const SILENT_NS: u64 = 2_000_000_000;

/// The last pose reports of a scanner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackingWatch {
    last: Option<PoseReport>,
    /// The last report that has a pose.
    with_pose: Option<PoseReport>,
}

/// State of the tracking. Lengths are in millimetres, angles in degrees, shares in percent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrackingFigures {
    /// `tracked`, `lost`, or `no_cloud` if no cloud has arrived for two seconds.
    pub state: &'static str,
    /// Why the last cloud has no pose.
    pub reason: Option<&'static str>,
    /// Root mean square distance of the last cloud with a pose to the model.
    pub rms_mm: f64,
    /// Share of the points of that cloud with a partner in the model.
    pub inliers: f64,
    /// Standard deviation of the position of that cloud at the centre of the model.
    pub sd_mm: f64,
    /// Standard deviation of the rotation of that cloud.
    pub sd_deg: f64,
    /// Points of the model.
    pub model_points: u64,
    /// Clouds fused into the model.
    pub model_clouds: u64,
    /// Share of all clouds that have a pose.
    pub clouds_tracked: f64,
}

impl TrackingWatch {
    /// Adds the next report.
    pub fn add(&mut self, report: &PoseReport) {
        self.last = Some(*report);
        if report.has_pose() {
            self.with_pose = Some(*report);
        }
    }

    /// Returns the figures at `now_ns`, with the counts of the stage, or `None` before the first report.
    #[must_use]
    pub fn figures(&self, counts: &Counts, now_ns: u64) -> Option<TrackingFigures> {
        let last = self.last?;
        let with_pose = self.with_pose.unwrap_or_default();
        let state = match last.has_pose() {
            _ if now_ns.saturating_sub(last.published_ns) > SILENT_NS => "no_cloud",
            true => "tracked",
            false => "lost",
        };
        Some(TrackingFigures {
            state,
            reason: last.reason().map(LostReason::name),
            rms_mm: with_pose.rms_m * 1e3,
            inliers: with_pose.share * 100.0,
            sd_mm: with_pose.sd_m * 1e3,
            sd_deg: with_pose.sd_rad.to_degrees(),
            model_points: last.model_points,
            model_clouds: last.model_clouds,
            clouds_tracked: 100.0 * counts.passed as f64 / counts.taken.max(1) as f64,
        })
    }
}

impl fmt::Display for TrackingFigures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { state, rms_mm, sd_mm, sd_deg, model_points, model_clouds, clouds_tracked, .. } = self;
        write!(f, "tracking: {}", state.replace('_', " "))?;
        if let Some(reason) = self.reason {
            write!(f, " ({})", reason.replace('_', " "))?;
        }
        write!(
            f,
            "; {clouds_tracked:.0} % of the clouds have a pose; last pose: sd {sd_mm:.4} mm and {sd_deg:.4}°, \
             {rms_mm:.4} mm rms from the model ({model_points} points of {model_clouds} clouds)"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::TrackingState;

    #[test]
    fn figures_of_the_last_pose_stay_while_the_scanner_is_lost() {
        let mut watch = TrackingWatch::default();
        let counts = Counts { taken: 8, passed: 6, ..Counts::default() };
        assert_eq!(watch.figures(&counts, 0), None);
        let tracked = PoseReport { state: TrackingState::Tracked as u32, rms_m: 2e-6, ..PoseReport::default() };
        watch.add(&tracked);
        assert_eq!(watch.figures(&counts, 10).unwrap().state, "tracked");
        let (state, reason) = (TrackingState::Lost as u32, LostReason::Degenerate as u32);
        watch.add(&PoseReport { state, reason, ..PoseReport::default() });
        let lost = watch.figures(&counts, 10).unwrap();
        assert_eq!((lost.state, lost.reason, lost.clouds_tracked), ("lost", Some("degenerate"), 75.0));
        assert!((lost.rms_mm - 2e-3).abs() < 1e-12 && lost.to_string().contains("lost (degenerate)"), "{lost}");
        assert_eq!(watch.figures(&counts, SILENT_NS + 1).unwrap().state, "no_cloud");
    }
}
