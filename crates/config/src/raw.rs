//! The file as serde reads it. Keys with a default are optional; unknown keys are refused.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Deserialize;

use fringeflow_dataset::VolumeDescription;

use super::virtual_scanner::VirtualScannerTable;
use super::{ConfigurationProblem, renamed_keys};

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawConfiguration {
    pub(super) phase: RawPhase,
    pub(super) correspondence: RawCorrespondence,
    pub(super) health: RawHealth,
    pub(super) measurement_volume: Option<RawVolume>,
    pub(super) instance: RawInstance,
    pub(super) rig: Option<RawRig>,
    pub(super) pattern: Option<RawPattern>,
    pub(super) cameras: Option<RawCameras>,
    pub(super) projector: RawProjector,
    pub(super) virtual_scanner: VirtualScannerTable,
    pub(super) window: RawWindow,
    pub(super) recorder: RawRecorder,
    pub(super) monitor: RawMonitor,
    pub(super) tracking: RawTracking,
    pub(super) processors: BTreeMap<String, RawProcessors>,
}

impl RawConfiguration {
    pub(super) fn parse(text: &str) -> Result<Self, ConfigurationProblem> {
        renamed_keys::refuse_former_keys(text)?;
        Ok(toml::from_str(text)?)
    }
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawPhase {
    pub(super) min_modulation_grey: Option<f32>,
    pub(super) saturation_grey: Option<u8>,
    pub(super) max_residual_share: Option<f32>,
    pub(super) extra_images: Option<usize>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawCorrespondence {
    pub(super) resolution: Option<String>,
    pub(super) min_confidence: Option<f32>,
    pub(super) delta_sd_rad: Option<f64>,
    pub(super) max_rounds: Option<usize>,
    pub(super) max_sweeps: Option<usize>,
    pub(super) min_votes: Option<u16>,
    pub(super) min_region_px: Option<u32>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawHealth {
    pub(super) windows: Option<usize>,
    pub(super) fewest_windows: Option<usize>,
    pub(super) release_share: Option<f64>,
    pub(super) drift_rad: Option<RawLimits>,
    pub(super) delta_sd_rad: Option<RawLimits>,
    pub(super) delta_noise_rad: Option<RawLimits>,
    pub(super) delta_mean_rad: Option<RawLimits>,
    pub(super) residual_share: Option<RawLimits>,
    pub(super) harmonics_share: Option<RawLimits>,
    pub(super) saturated_share: Option<RawLimits>,
    pub(super) dim_share: Option<RawLimits>,
    pub(super) skew_ms: Option<RawLimits>,
    pub(super) motion_rad: Option<RawLimits>,
    pub(super) brightness_share: Option<RawLimits>,
    pub(super) one_surface_share: Option<RawLimits>,
    pub(super) lost_share: Option<RawLimits>,
    pub(super) slipped_share: Option<RawLimits>,
    pub(super) unexplained_share: Option<RawLimits>,
    pub(super) false_candidates: Option<RawLimits>,
    pub(super) unlit_share: Option<RawLimits>,
    pub(super) unused_range_share: Option<RawLimits>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLimits {
    pub(super) warn: Option<f64>,
    pub(super) bad: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawVolume {
    pub(super) unit: String,
    pub(super) r#box: VolumeDescription,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawInstance {
    pub(super) name: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRig {
    pub(super) calibration: PathBuf,
    pub(super) unit: String,
    pub(super) segment_table: Option<PathBuf>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPattern {
    pub(super) file: Option<PathBuf>,
    pub(super) steps: Option<usize>,
    pub(super) period_px: Option<f64>,
    pub(super) phase_sign: Option<f64>,
    pub(super) phase_offset_rad: Option<f64>,
    pub(super) phase_shift_rad: Option<Vec<f64>>,
}

impl RawPattern {
    /// Refuses values beside a file that states them.
    pub(super) fn refuse_values(&self) -> Result<(), ConfigurationProblem> {
        let number = |value: Option<f64>| value.map(|value| value.to_string());
        let stated = [
            ("pattern.steps", self.steps.map(|steps| steps.to_string())),
            ("pattern.period_px", number(self.period_px)),
            ("pattern.phase_sign", number(self.phase_sign)),
            ("pattern.phase_offset_rad", number(self.phase_offset_rad)),
            ("pattern.phase_shift_rad", self.phase_shift_rad.as_ref().map(|shifts| format!("{shifts:?}"))),
        ];
        let expected = "the file in pattern.file states it already; remove the key";
        let first = stated.into_iter().find_map(|(key, value)| Some((key, value?)));
        first.map_or(Ok(()), |(key, value)| Err(ConfigurationProblem::Value { key, value, expected }))
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawCameras {
    pub(super) source: String,
    pub(super) rate_hz: f64,
    pub(super) max_skew_us: Option<f64>,
    pub(super) format: Option<String>,
    pub(super) bayer: Option<String>,
    pub(super) region_px: Option<[usize; 4]>,
    pub(super) binning: Option<usize>,
    pub(super) cam1: Option<RawV4l2Camera>,
    pub(super) cam2: Option<RawV4l2Camera>,
    pub(super) both: Option<RawV4l2Camera>,
    pub(super) stereo_layout: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawV4l2Camera {
    pub(super) device: String,
    pub(super) buffers: Option<u32>,
    pub(super) timeout_ms: Option<u64>,
    pub(super) trigger: Option<String>,
    pub(super) stamp: Option<String>,
    pub(super) exposure_us: Option<f64>,
    pub(super) readout_us: Option<f64>,
    pub(super) set_rate: Option<bool>,
    pub(super) video_timings: Option<String>,
    #[serde(default)]
    pub(super) controls: toml::Table,
    #[serde(default)]
    pub(super) extension_units: Vec<RawExtensionUnit>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawExtensionUnit {
    pub(super) unit: u8,
    pub(super) selector: u8,
    pub(super) bytes: String,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawProjector {
    pub(super) driver: Option<String>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawWindow {
    pub(super) every: Option<usize>,
    pub(super) when_busy: Option<String>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawRecorder {
    pub(super) folder: Option<PathBuf>,
    pub(super) from_start: Option<bool>,
    pub(super) queue_mb: Option<u64>,
    pub(super) min_free_mb: Option<u64>,
    pub(super) phase_maps: Option<bool>,
    pub(super) correspondences: Option<bool>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawMonitor {
    pub(super) enabled: Option<bool>,
    pub(super) address: Option<String>,
    pub(super) foxglove: Option<String>,
    pub(super) token_file: Option<PathBuf>,
    pub(super) host_names: Option<Vec<String>>,
    pub(super) foxglove_origins: Option<Vec<String>>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawTracking {
    pub(super) enabled: Option<bool>,
    pub(super) prior: Option<String>,
    pub(super) merge_every: Option<u32>,
    pub(super) shown_points: Option<usize>,
    pub(super) shown_every_s: Option<f64>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawProcessors {
    pub(super) cpus: Option<Vec<usize>>,
    pub(super) threads: Option<usize>,
    pub(super) realtime_priority: Option<u8>,
    pub(super) lock_memory: Option<String>,
}

/// Returns the value for a word. The error lists the known words.
pub(super) fn one_of<T: Copy>(
    key: &'static str,
    word: &str,
    values: &[(&'static str, T)],
) -> Result<T, ConfigurationProblem> {
    let found = values.iter().find(|(name, _)| *name == word).map(|&(_, value)| value);
    found.ok_or_else(|| ConfigurationProblem::Word {
        key,
        value: word.to_owned(),
        known: values.iter().map(|(name, _)| *name).collect(),
    })
}

/// Returns the value if it is valid, else an error that names its key.
pub(super) fn checked<T: std::fmt::Display>(
    key: &'static str,
    value: T,
    is_valid: impl FnOnce(&T) -> bool,
    expected: &'static str,
) -> Result<T, ConfigurationProblem> {
    if is_valid(&value) {
        Ok(value)
    } else {
        Err(ConfigurationProblem::Value { key, value: value.to_string(), expected })
    }
}
