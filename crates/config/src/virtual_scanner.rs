//! `[virtual_scanner]`: what stands in for cameras and projector.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::dataset::FringeSequence;
use crate::grey::PixelFormat;
use crate::simulation::{
    FaultOptions, Faults, Object, RigOptions, SimulationError, SweepOptions, VirtualScannerOptions,
};

use super::ConfigurationProblem;
use super::raw::{RawFaults, RawSweep, RawVirtualScanner};

/// Configuration of the virtual scanner.
#[derive(Clone, Debug, PartialEq)]
pub struct VirtualScannerConfiguration {
    /// The scanner and its sweep.
    pub scanner: VirtualScannerOptions,
    /// What goes wrong on purpose.
    pub faults: FaultOptions,
    /// File that keeps its images from one start to the next.
    pub cache: Option<PathBuf>,
}

/// Reads `[virtual_scanner]`; ranges are checked where the scanner is built, those of the faults here.
pub(super) fn configuration(
    raw: &RawVirtualScanner,
    sequence: &FringeSequence,
    format: PixelFormat,
    folder: &Path,
) -> Result<VirtualScannerConfiguration, ConfigurationProblem> {
    let object = word("virtual_scanner.object", raw.object.as_deref(), Object::Elephant)?;
    let usual = VirtualScannerOptions::usual(object);
    let seed = raw.seed.unwrap_or(usual.seed);
    let scanner = VirtualScannerOptions {
        object,
        board: word("virtual_scanner.board", raw.board.as_deref(), usual.board)?,
        rig: RigOptions {
            arrangement: usual.rig.arrangement,
            size_px: raw.size_px.unwrap_or(usual.rig.size_px),
            depth_m: raw.depth_mm.map_or(usual.rig.depth_m, |mm| mm * 1e-3),
            period_px: sequence.pattern.period_px,
            sd_rad: raw.sd_rad.unwrap_or(usual.rig.sd_rad),
            lens_error: usual.rig.lens_error,
            seed,
        },
        steps: sequence.shifts_rad.len(),
        format,
        noise: word("virtual_scanner.noise", raw.noise.as_deref(), usual.noise)?,
        gamma: raw.gamma.unwrap_or(usual.gamma),
        exposure: raw.exposure.unwrap_or(usual.exposure),
        supersampling: raw.supersampling.unwrap_or(usual.supersampling),
        sweep: sweep(&raw.sweep, seed),
        seed,
    };
    let cache = raw.cache.as_ref().map(|path| folder.join(path));
    Ok(VirtualScannerConfiguration { scanner, faults: faults(&raw.faults, seed)?, cache })
}

fn sweep(raw: &RawSweep, seed: u64) -> SweepOptions {
    let default = SweepOptions::default();
    SweepOptions {
        poses: raw.poses.unwrap_or(default.poses),
        travel_mm: raw.travel_mm.unwrap_or(default.travel_mm),
        turn_deg: raw.turn_deg.unwrap_or(default.turn_deg),
        tremor_mm: raw.tremor_mm.unwrap_or(default.tremor_mm),
        tremor_deg: raw.tremor_deg.unwrap_or(default.tremor_deg),
        outside_mm: raw.outside_mm.unwrap_or(default.outside_mm),
        seed,
    }
}

fn faults(raw: &RawFaults, seed: u64) -> Result<FaultOptions, ConfigurationProblem> {
    let options = FaultOptions {
        lost: raw.lost.unwrap_or(0.0),
        duplicated: raw.duplicated.unwrap_or(0.0),
        swapped: raw.swapped.unwrap_or(0.0),
        late: raw.late.unwrap_or(0.0),
        hidden_lost: raw.hidden_lost.unwrap_or(0.0),
        hidden_duplicated: raw.hidden_duplicated.unwrap_or(0.0),
        hidden_swapped: raw.hidden_swapped.unwrap_or(0.0),
        events_lost: raw.events_lost.unwrap_or(0.0),
        seed,
    };
    let named =
        |e: SimulationError| ConfigurationProblem::Named { key: "virtual_scanner.faults", problem: e.to_string() };
    Faults::new(options).map(|_| options).map_err(named)
}

/// The value that a word names.
fn word<T: FromStr<Err = SimulationError>>(
    key: &'static str,
    word: Option<&str>,
    default: T,
) -> Result<T, ConfigurationProblem> {
    let Some(word) = word else { return Ok(default) };
    word.parse().map_err(|problem: SimulationError| ConfigurationProblem::Named { key, problem: problem.to_string() })
}
