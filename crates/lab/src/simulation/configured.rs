//! Reads the virtual scanner from a configuration.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use fringeflow::calibration::read_calibration;
use fringeflow_base::grey::PixelFormat;
use fringeflow_config::{
    ConfigurationError, ConfigurationProblem, FaultsTable, GivenRigFiles, RigSource, ScannerConfiguration,
    SetupTextError, SweepTable, VirtualScannerConfiguration,
};
use fringeflow_dataset::{Setup, SetupText};
use fringeflow_pixels::{DeviceImages, SourceFormat};

use super::view::MAX_SUPERSAMPLING;
use super::{
    FaultOptions, Faults, GivenRig, Object, RigOptions, SimulationError, SimulationOptions, SweepOptions,
    VirtualScanner, VirtualScannerOptions, check_range,
};

/// The table `[virtual_scanner]` of a configuration, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct ConfiguredScanner {
    /// The scanner and its sweep.
    pub scanner: VirtualScannerOptions,
    /// Faults to inject.
    pub faults: FaultOptions,
    /// File that stores its images between runs.
    pub cache: Option<PathBuf>,
}

impl ConfiguredScanner {
    /// Checks the words and the faults of a configuration. Ranges are checked when the scanner is built.
    ///
    /// # Errors
    /// [`ConfigurationProblem`], which names the key.
    pub fn from_configuration(configuration: &VirtualScannerConfiguration) -> Result<Self, ConfigurationProblem> {
        let table = &configuration.table;
        let object = word("virtual_scanner.object", table.object.as_deref(), Object::Elephant)?;
        let usual = VirtualScannerOptions::usual(object);
        let seed = table.seed.unwrap_or(usual.seed);
        let scanner = VirtualScannerOptions {
            object,
            board: word("virtual_scanner.board", table.board.as_deref(), usual.board)?,
            rig: rig(configuration, &usual.rig, seed)?,
            steps: configuration.steps,
            format: configuration.format,
            noise: word("virtual_scanner.noise", table.noise.as_deref(), usual.noise)?,
            gamma: table.gamma.unwrap_or(usual.gamma),
            exposure: table.exposure.unwrap_or(usual.exposure),
            supersampling: table.supersampling.unwrap_or(usual.supersampling),
            sweep: sweep(&table.sweep, seed),
            seed,
        };
        Ok(Self {
            scanner,
            faults: faults(&table.faults, configuration.rate_hz, seed)?,
            cache: configuration.cache.clone(),
        })
    }

    /// Returns the options of a dataset that the scanner takes while it rests: with the rig, the pattern, and the region,
    /// binning and format of the images that its setup states. `None` without a measurement volume.
    #[must_use]
    pub fn dataset_options(&self, setup: &Setup) -> Option<SimulationOptions> {
        let scanner = &self.scanner;
        let given = GivenRig { rig: setup.rig, volume: setup.volume?, pattern: setup.sequence.pattern };
        let binning = setup.readout.binning();
        Some(SimulationOptions {
            board: scanner.board,
            rig: scanner.rig.with_given(given),
            steps: scanner.steps,
            noise: scanner.noise,
            binning,
            images: DeviceImages::from(SourceFormat::from(setup.pixel_format.unwrap_or(PixelFormat::Grey))),
            gamma: scanner.gamma,
            exposure: scanner.exposure,
            // A sum of pixels has the samples of all of them.
            supersampling: (scanner.supersampling * binning).min(MAX_SUPERSAMPLING),
            seed: scanner.seed,
            ..SimulationOptions::usual(scanner.object)
        })
    }

    /// Returns the virtual scanner of an instance, or `None` if it has real cameras.
    ///
    /// # Errors
    /// As [`Self::from_configuration`].
    pub fn from_scanner_configuration(
        configuration: &ScannerConfiguration,
    ) -> Result<Option<Self>, ConfigurationProblem> {
        match &configuration.rig {
            Some(RigSource::Virtual(virtual_scanner)) => Self::from_configuration(virtual_scanner).map(Some),
            _ => Ok(None),
        }
    }
}

/// Reads the configuration of an instance from a file, and also checks its virtual scanner.
///
/// # Errors
/// [`ConfigurationError`], which names file, key and value.
pub fn read_configuration(file: &Path) -> Result<ScannerConfiguration, ConfigurationError> {
    with_valid_scanner(ScannerConfiguration::read(file)?, file)
}

/// [`read_configuration`], with the virtual scanner in the place of cameras and projector.
///
/// # Errors
/// As [`read_configuration`].
pub fn read_virtual_configuration(file: &Path) -> Result<ScannerConfiguration, ConfigurationError> {
    with_valid_scanner(ScannerConfiguration::read_virtual(file)?, file)
}

fn with_valid_scanner(
    configuration: ScannerConfiguration,
    file: &Path,
) -> Result<ScannerConfiguration, ConfigurationError> {
    match ConfiguredScanner::from_scanner_configuration(&configuration) {
        Ok(_) => Ok(configuration),
        Err(problem) => Err(ConfigurationError { file: file.to_owned(), problem }),
    }
}

/// Returns the texts of the setup of an instance, with real or virtual cameras.
///
/// # Errors
/// As [`ScannerConfiguration::setup_text`], or the virtual scanner cannot be built.
pub fn setup_text(configuration: &ScannerConfiguration) -> Result<SetupText, SetupTextError> {
    let refused = |what: String| SetupTextError::VirtualScanner(what);
    match ConfiguredScanner::from_scanner_configuration(configuration).map_err(|e| refused(e.to_string()))? {
        None => configuration.setup_text(),
        Some(configured) => {
            let scanner = VirtualScanner::new(configured.scanner).map_err(|e| refused(e.to_string()))?;
            configuration.setup_text_of(scanner.description(), &scanner.rig().calibrated, None)
        }
    }
}

/// Returns the options of the built-in rig, or of the rig that the configuration names.
fn rig(
    configuration: &VirtualScannerConfiguration,
    usual: &RigOptions,
    seed: u64,
) -> Result<RigOptions, ConfigurationProblem> {
    let table = &configuration.table;
    let options = RigOptions {
        size_px: table.size_px.unwrap_or(usual.size_px),
        depth_m: table.depth_mm.map_or(usual.depth_m, |mm| mm * 1e-3),
        period_px: configuration.pattern.period_px,
        sd_rad: table.sd_rad.unwrap_or(usual.sd_rad),
        seed,
        ..*usual
    };
    let Some(GivenRigFiles { calibration, unit, volume }) = &configuration.rig else { return Ok(options) };
    let rig = read_calibration(calibration, *unit);
    let rig = rig.map_err(|e| ConfigurationProblem::Named { key: "rig.calibration", problem: e.to_string() })?;
    Ok(options.with_given(GivenRig { rig, volume: *volume, pattern: configuration.pattern }))
}

fn sweep(table: &SweepTable, seed: u64) -> SweepOptions {
    let default = SweepOptions::default();
    SweepOptions {
        poses: table.poses.unwrap_or(default.poses),
        travel_mm: table.travel_mm.unwrap_or(default.travel_mm),
        turn_deg: table.turn_deg.unwrap_or(default.turn_deg),
        tremor_mm: table.tremor_mm.unwrap_or(default.tremor_mm),
        tremor_deg: table.tremor_deg.unwrap_or(default.tremor_deg),
        outside_mm: table.outside_mm.unwrap_or(default.outside_mm),
        seed,
    }
}

/// Longest time until the faults begin or end, seconds.
const MAX_FAULT_TIME_S: f64 = 1e6;

fn faults(table: &FaultsTable, rate_hz: f64, seed: u64) -> Result<FaultOptions, ConfigurationProblem> {
    let named =
        |e: SimulationError| ConfigurationProblem::Named { key: "virtual_scanner.faults", problem: e.to_string() };
    let options = FaultOptions {
        lost: table.lost.unwrap_or(0.0),
        duplicated: table.duplicated.unwrap_or(0.0),
        swapped: table.swapped.unwrap_or(0.0),
        late: table.late.unwrap_or(0.0),
        hidden_lost: table.hidden_lost.unwrap_or(0.0),
        hidden_duplicated: table.hidden_duplicated.unwrap_or(0.0),
        hidden_swapped: table.hidden_swapped.unwrap_or(0.0),
        events_lost: table.events_lost.unwrap_or(0.0),
        exposures: table.between_s.map(|times_s| exposures_between(times_s, rate_hz)).transpose().map_err(named)?,
        seed,
    };
    Faults::new(options).map(|_| options).map_err(named)
}

/// Returns the number of the first exposure in a time of scanning, and of the first one after it.
fn exposures_between([begin_s, end_s]: [f64; 2], rate_hz: f64) -> Result<[u64; 2], SimulationError> {
    check_range("the begin of the faults (between_s)", begin_s, 0.0, MAX_FAULT_TIME_S, "s")?;
    check_range("the end of the faults (between_s)", end_s, begin_s, MAX_FAULT_TIME_S, "s")?;
    Ok([begin_s, end_s].map(|time_s| (time_s * rate_hz).ceil() as u64))
}

/// Parses a word, or returns the default if there is none.
fn word<T: FromStr<Err = SimulationError>>(
    key: &'static str,
    word: Option<&str>,
    default: T,
) -> Result<T, ConfigurationProblem> {
    let Some(word) = word else { return Ok(default) };
    word.parse().map_err(|problem: SimulationError| ConfigurationProblem::Named { key, problem: problem.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEMO: &str = include_str!("../../../../configs/demo.toml");

    fn parse(text: &str) -> ScannerConfiguration {
        ScannerConfiguration::parse(text, Path::new("/configs")).unwrap()
    }

    #[test]
    fn the_demo_has_a_setup() {
        let setup = Setup::parse(setup_text(&parse(DEMO)).unwrap(), None).unwrap();
        assert_eq!((setup.steps, setup.image_size_px), (4, [640, 512]));
    }

    #[test]
    fn an_unknown_word_is_named_with_its_key() {
        let changed = parse(&DEMO.replace("object = \"elephant\"", "object = \"elefant\""));
        let problem = ConfiguredScanner::from_scanner_configuration(&changed).unwrap_err().to_string();
        assert!(problem.contains("virtual_scanner.object") && problem.contains("elefant"), "{problem}");
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("scanner.toml");
        std::fs::write(&file, &changed.text).unwrap();
        let refused = read_configuration(&file).unwrap_err().to_string();
        assert!(refused.contains("scanner.toml") && refused.contains("virtual_scanner.object"), "{refused}");
    }

    #[test]
    fn the_setup_has_the_format_of_the_cameras() {
        let deep = parse(&DEMO.replace("format = \"GREY\"", "format = \"Y12\""));
        let setup = Setup::parse(setup_text(&deep).unwrap(), None).unwrap();
        assert_eq!(setup.pixel_format, Some(PixelFormat::Y12));
    }

    #[test]
    fn the_time_of_the_faults_becomes_exposures() {
        let faults = |between_s: &str| {
            let parsed = parse(&DEMO.replace("between_s = [22.0, 24.0]", between_s));
            ConfiguredScanner::from_scanner_configuration(&parsed)
                .map(|configured| configured.unwrap().faults.exposures)
        };
        assert_eq!(faults("between_s = [22.0, 24.0]").unwrap(), Some([660, 720]));
        assert_eq!(faults("").unwrap(), None);
        for wrong in ["[-1.0, 2.0]", "[3.0, 2.0]", "[0.0, nan]"] {
            let refused = faults(&format!("between_s = {wrong}")).unwrap_err().to_string();
            assert!(refused.contains("virtual_scanner.faults") && refused.contains("between_s"), "{refused}");
        }
    }

    #[test]
    fn a_region_of_the_images_has_its_own_setup() {
        let text =
            |cameras: &str| setup_text(&parse(&DEMO.replace("rate_hz = 30.0", &format!("rate_hz = 30.0\n{cameras}"))));
        let setup = |cameras| Setup::parse(text(cameras).unwrap(), None).unwrap();
        let (whole, part) = (setup(""), setup("region_px = [100, 50, 320, 256]\nbinning = 2"));
        assert_eq!((part.image_size_px, part.pixel_format), ([160, 128], Some(PixelFormat::Y10)));
        assert_eq!((part.readout.sensor_px(), part.readout.region()), ([640, 512], [100, 50, 320, 256]));
        assert_eq!((&part.rig, &part.volume), (&part.readout.rig(&whole.rig), &whole.volume));
        let refused = |cameras| text(cameras).unwrap_err().to_string();
        assert!(refused("region_px = [600, 0, 64, 64]").contains("640 × 512"));
        assert!(refused("region_px = [0, 0, 33, 64]\nbinning = 2").contains("cameras.region_px"));
    }
}
