//! Configuration files: TOML, parsed into types that cannot be invalid.
//!
//! ```text
//! reconstruct.toml ──► Configuration (phase, correspondence, volume, health, tracking)
//! scanner.toml     ──► ScannerConfiguration (these and rig, cameras, projector, recorder, monitor, processors)
//! ```
//!
//! Keys have their unit in their name. Unknown keys are refused. All keys of a [`Configuration`] are optional. The
//! files in `configs/` explain all keys and state the defaults.
//!
//! ```
//! use fringeflow_config::Configuration;
//!
//! let configuration = Configuration::parse("[phase]\nmin_modulation_grey = 4.5\n")?;
//! assert_eq!(configuration.settings.validity.min_modulation_grey, 4.5);
//!
//! let error = Configuration::parse("[correspondence]\nmin_votes = 0\n").unwrap_err();
//! assert_eq!(error.to_string(), "key correspondence.min_votes is 0; it must lie between 1 and 32");
//! # Ok::<(), fringeflow_config::ConfigurationProblem>(())
//! ```

#![forbid(unsafe_code)]

mod cameras;
mod extension_units;
mod health;
mod max_skew;
mod monitor;
mod paths;
mod pattern_file;
mod processors;
mod raw;
mod renamed_keys;
mod scanner;
mod stereo;
mod tracking;
mod virtual_images;
mod virtual_scanner;

use std::path::{Path, PathBuf};

use fringeflow::calibration::Unit;
use fringeflow::correspondence::{MatchSettings, Model, ResolutionMethod, ResolutionSettings};
use fringeflow::geometry::MeasurementVolume;
use fringeflow::phase::Validity;
use fringeflow::reconstruction::Settings;
use fringeflow_base::text_file::{TextError, read_text};
use fringeflow_patterns::{NotACycle, PatternError};
use fringeflow_telemetry::health::HealthLimits;

use raw::{RawConfiguration, RawCorrespondence, RawPhase, RawVolume, checked};

pub use cameras::{
    CameraSource, ControlValue, DeviceName, DeviceNameError, StampMoment, Trigger, V4l2Camera, VideoTimings,
};
pub use extension_units::ExtensionUnitSetting;
pub use max_skew::recorded_max_skew_ns;
pub use monitor::{Listen, MonitorConfiguration};
pub use pattern_file::PatternFile;
pub use processors::{MemoryLock, ProcessorsConfiguration, SERVICES, ServiceProcessors};
pub use renamed_keys::rename_former_keys;
pub use scanner::{
    ProjectorDriver, ReadoutConfiguration, RecorderConfiguration, RigSource, ScannerConfiguration, SetupTextError,
};
pub use tracking::{PriorSource, TrackingConfiguration};
pub use virtual_scanner::{FaultsTable, GivenRigFiles, SweepTable, VirtualScannerConfiguration, VirtualScannerTable};

/// Maximum number of images of a window beyond a cycle. The longest window has 16 phase steps and these images.
const MAX_EXTRA_IMAGES: usize = 8;

/// Contents of a configuration file, with defaults for absent keys.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Configuration {
    /// Settings of the reconstruction.
    pub settings: Settings,
    /// Measurement volume; replaces that of the dataset or the recording.
    pub volume: Option<MeasurementVolume>,
    /// Limits of the health quantities.
    pub health: HealthLimits,
    /// Tracking of the scanner during a scan.
    pub tracking: TrackingConfiguration,
}

/// Why a configuration file was refused.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", file.display())]
pub struct ConfigurationError {
    /// The file.
    pub file: PathBuf,
    /// What is wrong with it.
    #[source]
    pub problem: ConfigurationProblem,
}

/// What is wrong with a configuration file.
#[derive(Debug, thiserror::Error)]
pub enum ConfigurationProblem {
    /// The file cannot be read, or is not text.
    #[error(transparent)]
    Text(#[from] TextError),
    /// The text is not TOML, or has an unknown key or a wrong type.
    #[error("is not a valid configuration: {0}")]
    Toml(String),
    /// An invalid value.
    #[error("key {key} is {value}; {expected}")]
    Value {
        /// Name of the key.
        key: &'static str,
        /// The value.
        value: String,
        /// The valid values.
        expected: &'static str,
    },
    /// The file of the patterns cannot be read.
    #[error("key pattern.file: {0}")]
    Patterns(#[from] PatternError),
    /// The file of the patterns has no cycle for scanning.
    #[error("key pattern.file: {}: {problem}; write one with `fringeflow patterns`", file.display())]
    NoCycle {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        #[source]
        problem: NotACycle,
    },
    /// An unknown word.
    #[error("key {key} is {value:?}; it must be one of {known:?}")]
    Word {
        /// Name of the key.
        key: &'static str,
        /// The word.
        value: String,
        /// The known words.
        known: Vec<&'static str>,
    },
    /// A problem that a text describes.
    #[error("key {key}: {problem}")]
    Named {
        /// Name of the key.
        key: &'static str,
        /// The problem.
        problem: String,
    },
    /// A required key is absent.
    #[error("key {key} is missing; {expected}")]
    Missing {
        /// Name of the key.
        key: &'static str,
        /// What the key must hold.
        expected: &'static str,
    },
    /// A problem in the table of one camera.
    #[error("in [cameras.{camera}]: {problem}")]
    Camera {
        /// `cam1`, `cam2` or `both`.
        camera: &'static str,
        /// The problem.
        #[source]
        problem: Box<Self>,
    },
    /// A problem in the table of one service.
    #[error("in [processors.{service}]: {problem}")]
    Service {
        /// Its name.
        service: &'static str,
        /// The problem.
        #[source]
        problem: Box<Self>,
    },
    /// The measurement volume is invalid.
    #[error("key measurement_volume: {0}")]
    Volume(#[source] fringeflow_dataset::Problem),
}

impl From<toml::de::Error> for ConfigurationProblem {
    fn from(error: toml::de::Error) -> Self {
        Self::Toml(error.to_string().trim_end().to_owned())
    }
}

impl Configuration {
    /// Reads and checks a configuration file.
    ///
    /// # Errors
    /// [`ConfigurationError`], which names file, key and value.
    pub fn read(path: &Path) -> Result<Self, ConfigurationError> {
        let text = read_text(path).map_err(ConfigurationProblem::from);
        text.and_then(|text| Self::parse(&text))
            .map_err(|problem| ConfigurationError { file: path.to_owned(), problem })
    }

    /// [`Self::read`] for a text in memory.
    ///
    /// # Errors
    /// [`ConfigurationProblem`], which names key and value.
    pub fn parse(text: &str) -> Result<Self, ConfigurationProblem> {
        Self::from_raw(&RawConfiguration::parse(text)?)
    }

    /// [`Self::parse`] for the text in a recording, which may be older than this version.
    ///
    /// # Errors
    /// [`ConfigurationProblem`], which names key and value.
    pub fn parse_recorded(text: &str) -> Result<Self, ConfigurationProblem> {
        Self::parse(&renamed_keys::with_current_names(text)?)
    }

    fn from_raw(raw: &RawConfiguration) -> Result<Self, ConfigurationProblem> {
        let settings = Settings {
            validity: validity(&raw.phase)?,
            extra_images: extra_images(&raw.phase)?,
            matching: matching(&raw.correspondence)?,
        };
        Ok(Self {
            settings,
            volume: raw.measurement_volume.as_ref().map(volume).transpose()?,
            health: health::health_limits(&raw.health)?,
            tracking: tracking::configuration(&raw.tracking)?,
        })
    }
}

fn validity(raw: &RawPhase) -> Result<Validity, ConfigurationProblem> {
    let default = Validity::default();
    let positive = "it must be a finite number above 0";
    Ok(Validity {
        min_modulation_grey: checked(
            "phase.min_modulation_grey",
            raw.min_modulation_grey.unwrap_or(default.min_modulation_grey),
            |v| v.is_finite() && *v > 0.0,
            positive,
        )?,
        saturation_grey: checked(
            "phase.saturation_grey",
            raw.saturation_grey.unwrap_or(default.saturation_grey),
            |v| *v > 0,
            "it must lie between 1 and 255",
        )?,
        max_residual_share: checked(
            "phase.max_residual_share",
            raw.max_residual_share.unwrap_or(default.max_residual_share),
            |v| v.is_finite() && *v > 0.0,
            positive,
        )?,
    })
}

fn extra_images(raw: &RawPhase) -> Result<Option<usize>, ConfigurationProblem> {
    let expected = "it must lie between 0 and 8";
    raw.extra_images.map(|extra| checked("phase.extra_images", extra, |v| *v <= MAX_EXTRA_IMAGES, expected)).transpose()
}

fn matching(raw: &RawCorrespondence) -> Result<MatchSettings, ConfigurationProblem> {
    let default = ResolutionSettings::default();
    let count = |key, value: usize| checked(key, value, |v| (1..=100).contains(v), "it must lie between 1 and 100");
    let sd = raw.delta_sd_rad.map(|sd| {
        checked("correspondence.delta_sd_rad", sd, |v| *v > 0.0 && *v < 1.0, "it must lie between 0 and 1 rad")
    });
    Ok(MatchSettings {
        delta_sd_rad: sd.transpose()?,
        cycle_steps: None,
        method: method(raw.resolution.as_deref())?,
        resolution: ResolutionSettings {
            max_rounds: count("correspondence.max_rounds", raw.max_rounds.unwrap_or(default.max_rounds))?,
            max_sweeps: count("correspondence.max_sweeps", raw.max_sweeps.unwrap_or(default.max_sweeps))?,
            min_votes: checked(
                "correspondence.min_votes",
                raw.min_votes.unwrap_or(default.min_votes),
                |v| (1..=32).contains(v),
                "it must lie between 1 and 32",
            )?,
            min_region_px: raw.min_region_px.unwrap_or(default.min_region_px),
        },
        model: Model::USUAL,
        min_confidence: checked(
            "correspondence.min_confidence",
            raw.min_confidence.unwrap_or(MatchSettings::default().min_confidence),
            |v| (0.0..=1.0).contains(v),
            "it must be a probability, between 0 and 1",
        )?,
    })
}

fn method(name: Option<&str>) -> Result<ResolutionMethod, ConfigurationProblem> {
    let Some(name) = name else { return Ok(ResolutionMethod::default()) };
    ResolutionMethod::ALL.into_iter().find(|method| method.name() == name).ok_or_else(|| ConfigurationProblem::Value {
        key: "correspondence.resolution",
        value: format!("{name:?}"),
        expected: "it must be \"moments\" or \"paper\"",
    })
}

fn volume(raw: &RawVolume) -> Result<MeasurementVolume, ConfigurationProblem> {
    let unit: Unit = raw.unit.parse().map_err(|_| ConfigurationProblem::Value {
        key: "measurement_volume.unit",
        value: format!("{:?}", raw.unit),
        expected: "it must be \"mm\" or \"m\"",
    })?;
    raw.r#box.to_volume(unit).map_err(ConfigurationProblem::Volume)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_states_the_defaults() {
        let text = include_str!("../../../configs/reconstruct.toml");
        assert_eq!(Configuration::parse(text).unwrap(), Configuration::default());
    }

    #[test]
    fn a_volume_is_converted_to_metres() {
        let text = "[measurement_volume]\nunit = \"mm\"\n[measurement_volume.box]\nR_v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n\
                    T_v = [0, 0, 300]\nmin = [-50, -40, -12.5]\nmax = [50, 40, 12.5]\n";
        let volume = Configuration::parse(text).unwrap().volume.unwrap();
        assert!((volume.cam1_from_volume().translation.z - 0.3).abs() < 1e-12);
        assert!((volume.max().x - 0.05).abs() < 1e-12);
    }

    #[test]
    fn a_former_key_is_refused_with_a_hint_and_read_from_recordings() {
        let text = "[correspondence]\ndrift_alarm_rad = 0.05";
        let message = Configuration::parse(text).unwrap_err().to_string();
        assert!(
            message.contains("correspondence.drift_alarm_rad is 0.05") && message.contains("[health]"),
            "{message}"
        );
        let health = Configuration::parse_recorded(text).unwrap().health;
        let limits = health.limits_of(fringeflow_telemetry::health::Quantity::Drift);
        assert_eq!((limits.warn, limits.bad), (0.05, 0.2));
        assert!(Configuration::parse_recorded("[correspondence]\ndrift_alarm = 0.05").is_err());
    }

    #[test]
    fn unknown_keys_and_impossible_values_are_named() {
        let message = |text: &str| Configuration::parse(text).unwrap_err().to_string();
        assert!(message("[phase]\nmin_modulation = 3.0").contains("min_modulation"));
        assert!(message("[phase]\nmin_modulation_grey = -1.0").contains("phase.min_modulation_grey is -1"));
        assert!(message("[correspondence]\ndelta_sd_rad = nan").contains("correspondence.delta_sd_rad is NaN"));
        assert!(message("[correspondence]\nmin_confidence = 90").contains("correspondence.min_confidence is 90"));
        assert!(message("[health]\ndrift_rad = { warn = 0 }").contains("health.drift_rad: warn is 0"));
        assert!(message("[health]\nmotion_rad = { bad = 0.1 }").contains("warn above 0 and below bad"));
        assert!(message("[health]\nskew_ms = { warning = 1 }").contains("warning"));
        assert!(message("[health]\ndrift_mm = { warn = 1 }").contains("drift_mm"));
        assert!(message("[health]\nwindows = 3\nfewest_windows = 4").contains("health.fewest_windows is 4"));
        assert!(message("[health]\nrelease_share = 1.2").contains("health.release_share is 1.2"));
    }
}
