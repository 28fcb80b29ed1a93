//! `[virtual_scanner]`: simulated cameras and projector.
//!
//! The table is stored as written. The simulation, which depends on this crate, checks its values and builds the
//! scanner.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use fringeflow::calibration::Unit;
use fringeflow::geometry::{FringePattern, MeasurementVolume};
use fringeflow_base::grey::PixelFormat;
use fringeflow_dataset::FringeSequence;

use super::ConfigurationProblem;
use super::paths::in_folder;

/// The table `[virtual_scanner]`. The simulation has the defaults of absent keys.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VirtualScannerTable {
    /// Name of the scanned object.
    pub object: Option<String>,
    /// Name of the board behind the object.
    pub board: Option<String>,
    /// Width and height of the images, pixels.
    pub size_px: Option<[usize; 2]>,
    /// Depth of the measurement volume, millimetres.
    pub depth_mm: Option<f64>,
    /// Standard deviation of δ caused by the calibration error, rad.
    pub sd_rad: Option<f64>,
    /// Noise level.
    pub noise: Option<String>,
    /// Exponent of the response of the projector.
    pub gamma: Option<f64>,
    /// Exposure, relative to the default.
    pub exposure: Option<f64>,
    /// Number of rays along each side of a pixel.
    pub supersampling: Option<usize>,
    /// Seed of noise, tremor and faults.
    pub seed: Option<u64>,
    /// File that stores the images between runs.
    pub cache: Option<PathBuf>,
    /// Motion of the scanner.
    pub sweep: SweepTable,
    /// Faults to inject.
    pub faults: FaultsTable,
}

/// The table `[virtual_scanner.sweep]`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SweepTable {
    /// Number of poses in one cycle of the motion.
    pub poses: Option<usize>,
    /// Travel along x, y and z, millimetres.
    pub travel_mm: Option<[f64; 3]>,
    /// Rotation about x, y and z, degrees.
    pub turn_deg: Option<[f64; 3]>,
    /// Tremor of the hand, millimetres.
    pub tremor_mm: Option<f64>,
    /// Tremor of the hand, degrees.
    pub tremor_deg: Option<f64>,
    /// Distance by which the object may leave the measurement volume, millimetres.
    pub outside_mm: Option<f64>,
}

/// The table `[virtual_scanner.faults]`: shares of images or events, and when they apply.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FaultsTable {
    /// Begin and end of the faults, seconds of scanning.
    pub between_s: Option<[f64; 2]>,
    /// Images lost, with a gap in the sequence numbers.
    pub lost: Option<f64>,
    /// Images delivered twice.
    pub duplicated: Option<f64>,
    /// Images that swap places.
    pub swapped: Option<f64>,
    /// Images delivered late.
    pub late: Option<f64>,
    /// Images lost without a gap in the sequence numbers.
    pub hidden_lost: Option<f64>,
    /// Images that repeat the previous image under a number of their own.
    pub hidden_duplicated: Option<f64>,
    /// Images that swap places with correct sequence numbers.
    pub hidden_swapped: Option<f64>,
    /// Pattern events lost.
    pub events_lost: Option<f64>,
}

/// Configuration of the virtual scanner.
#[derive(Clone, Debug, PartialEq)]
pub struct VirtualScannerConfiguration {
    /// The table as written.
    pub table: VirtualScannerTable,
    /// Number of phase shifts in a cycle.
    pub steps: usize,
    /// The fringes. The built-in rig takes only their period.
    pub pattern: FringePattern,
    /// Images per second of each camera.
    pub rate_hz: f64,
    /// Format of the images.
    pub format: PixelFormat,
    /// File that stores the images between runs.
    pub cache: Option<PathBuf>,
    /// The rig to simulate; `None` for the built-in one.
    pub rig: Option<GivenRigFiles>,
}

/// A rig of the user that the virtual scanner simulates.
#[derive(Clone, Debug, PartialEq)]
pub struct GivenRigFiles {
    /// OpenCV FileStorage YAML.
    pub calibration: PathBuf,
    /// Unit of lengths in the file.
    pub unit: Unit,
    /// Measurement volume.
    pub volume: MeasurementVolume,
}

impl VirtualScannerConfiguration {
    /// Creates the configuration from the table. Paths are relative to the folder of the configuration.
    ///
    /// # Errors
    /// The table states what the rig to simulate states too, or the phase shifts are not evenly spaced.
    pub(crate) fn new(
        table: &VirtualScannerTable,
        sequence: &FringeSequence,
        rate_hz: f64,
        format: PixelFormat,
        rig: Option<GivenRigFiles>,
        folder: &Path,
    ) -> Result<Self, ConfigurationProblem> {
        if rig.is_some() {
            let refused = |key, value: String| {
                let expected = "the rig in [rig] and [measurement_volume] state it already; remove the key";
                Err(ConfigurationProblem::Value { key, value, expected })
            };
            if let Some(size_px) = table.size_px {
                return refused("virtual_scanner.size_px", format!("{size_px:?}"));
            }
            if let Some(depth_mm) = table.depth_mm {
                return refused("virtual_scanner.depth_mm", depth_mm.to_string());
            }
        }
        let steps = sequence.shifts_rad.len();
        let is_even = |(step, shift_rad): (usize, &f64)| (shift_rad - TAU * step as f64 / steps as f64).abs() < 1e-6;
        if !sequence.shifts_rad.iter().enumerate().all(is_even) {
            return Err(ConfigurationProblem::Value {
                key: "pattern.phase_shift_rad",
                value: format!("{:?}", sequence.shifts_rad),
                expected: "the virtual projector shows evenly spaced phase shifts only; remove the key",
            });
        }
        Ok(Self {
            steps,
            pattern: sequence.pattern,
            rate_hz,
            format,
            cache: table.cache.as_ref().map(|path| in_folder(folder, path)),
            table: table.clone(),
            rig,
        })
    }
}
