//! `[tracking]`: tracking of the scanner, and fusion of the model.

use fringeflow_tracking::fusion::FusionSettings;

use super::ConfigurationProblem;
use super::raw::{RawTracking, checked, one_of};

/// Configuration of the tracking.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackingConfiguration {
    /// Whether clouds are tracked during the scan.
    pub is_enabled: bool,
    /// Source of the depth prior of a window.
    pub prior: PriorSource,
    /// Stride of the tracked clouds that are merged into the model.
    pub merge_every: u32,
    /// Maximum number of points of the model in the live view.
    pub shown_points: usize,
    /// Time between two updates of the model in the live view, nanoseconds.
    pub shown_every_ns: u64,
}

/// Source of the depth prior, which predicts a window from earlier ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PriorSource {
    /// The tracking, if it is enabled.
    Tracking,
    /// Another program, on the channel `tracking/prior`.
    External,
    /// No prior: each window is decoded on its own.
    Off,
}

impl PriorSource {
    const ALL: [Self; 3] = [Self::Tracking, Self::External, Self::Off];

    /// Name in configurations.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Tracking => "tracking",
            Self::External => "external",
            Self::Off => "off",
        }
    }
}

impl Default for TrackingConfiguration {
    fn default() -> Self {
        Self {
            is_enabled: false,
            prior: PriorSource::Tracking,
            merge_every: 4,
            shown_points: 50_000,
            shown_every_ns: 1_000_000_000,
        }
    }
}

impl TrackingConfiguration {
    /// Settings for tracking and merging clouds.
    #[must_use]
    pub fn fusion(&self) -> FusionSettings {
        FusionSettings { merge_every: self.merge_every, ..FusionSettings::default() }
    }

    /// Whether the tracking sends priors to the correspondence stage.
    #[must_use]
    pub fn makes_priors(&self) -> bool {
        self.is_enabled && self.prior == PriorSource::Tracking
    }

    /// Whether the correspondence stage receives priors.
    #[must_use]
    pub fn takes_priors(&self) -> bool {
        self.makes_priors() || self.prior == PriorSource::External
    }

    /// Maximum number of points in the channel of the model; 0 without tracking.
    #[must_use]
    pub fn channel_points(&self) -> usize {
        if self.is_enabled { self.shown_points } else { 0 }
    }
}

pub(super) fn configuration(raw: &RawTracking) -> Result<TrackingConfiguration, ConfigurationProblem> {
    let default = TrackingConfiguration::default();
    let every_s = raw.shown_every_s.unwrap_or(default.shown_every_ns as f64 * 1e-9);
    let every_s =
        checked("tracking.shown_every_s", every_s, |v| (0.1..=60.0).contains(v), "it must lie between 0.1 and 60 s")?;
    Ok(TrackingConfiguration {
        is_enabled: raw.enabled.unwrap_or(default.is_enabled),
        prior: one_of(
            "tracking.prior",
            raw.prior.as_deref().unwrap_or(default.prior.name()),
            &PriorSource::ALL.map(|source| (source.name(), source)),
        )?,
        merge_every: checked(
            "tracking.merge_every",
            raw.merge_every.unwrap_or(default.merge_every),
            |v| (1..=1000).contains(v),
            "it must lie between 1 (all clouds) and 1000",
        )?,
        shown_points: checked(
            "tracking.shown_points",
            raw.shown_points.unwrap_or(default.shown_points),
            |v| (1_000..=1_000_000).contains(v),
            "it must lie between 1000 and 1000000",
        )?,
        shown_every_ns: (every_s * 1e9) as u64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<TrackingConfiguration, String> {
        let raw: RawTracking = toml::from_str(text).map_err(|e| e.to_string())?;
        configuration(&raw).map_err(|e| e.to_string())
    }

    #[test]
    fn tracking_is_off_by_default() {
        assert_eq!(parse("").unwrap(), TrackingConfiguration::default());
        assert_eq!(parse("").unwrap().channel_points(), 0);
        let on = parse("enabled = true\nmerge_every = 1\nshown_every_s = 0.5").unwrap();
        assert_eq!((on.fusion(), on.shown_every_ns), (FusionSettings::default(), 500_000_000));
        assert_eq!(on.channel_points(), on.shown_points);
    }

    #[test]
    fn invalid_values_are_named() {
        assert!(parse("merge_every = 0").unwrap_err().contains("tracking.merge_every is 0"));
        assert!(parse("shown_points = 10").unwrap_err().contains("tracking.shown_points is 10"));
        assert!(parse("shown_every_s = nan").unwrap_err().contains("tracking.shown_every_s is NaN"));
        assert!(parse("enable = true").unwrap_err().contains("enable"));
    }
}
