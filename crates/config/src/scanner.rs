//! Configuration of a running instance: its name, rig, cameras, projector, windows and recorder.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use fringeflow::calibration::{CalibrationError, Unit, calibration_text, parse_calibration, read_calibration_text};
use fringeflow::geometry::{BINNINGS, FringePattern, MeasurementVolume, Readout, ReadoutError, Rig};
use fringeflow::phase::MistakenUnit;
use fringeflow_base::grey::PixelFormat;
use fringeflow_base::limits::{MAX_STEPS, MIN_STEPS};
use fringeflow_base::text_file::read_text;
use fringeflow_dataset::{DatasetDescription, FringeSequence, SetupText};
use fringeflow_pixels::DeviceImages;

use super::cameras::{self, CameraSource};
use super::max_skew::{self, with_max_skew};
use super::monitor::{self, MonitorConfiguration};
use super::paths::in_folder;
use super::pattern_file::{self, PatternFile};
use super::processors::{self, ProcessorsConfiguration};
use super::raw::{RawCameras, RawConfiguration, RawPattern, RawRecorder, checked, one_of};
use super::virtual_images::virtual_text;
use super::virtual_scanner::{GivenRigFiles, VirtualScannerConfiguration};
use super::{Configuration, ConfigurationError, ConfigurationProblem};

/// Configuration of an instance.
#[derive(Clone, Debug, PartialEq)]
pub struct ScannerConfiguration {
    /// Name of the instance.
    pub name: String,
    /// Settings of the reconstruction, of the health limits and of the tracking.
    pub measurement: Configuration,
    /// Source of rig, pattern and volume; `None` if the caller has them, as in a replay.
    pub rig: Option<RigSource>,
    /// File that states the fringes, if the configuration names one. The text has its values instead.
    pub pattern_file: Option<PatternFile>,
    /// File that stores the segment table, if any.
    pub segment_table: Option<PathBuf>,
    /// Source of the images.
    pub cameras: CameraSource,
    /// Format and arrangement of the images that the cameras send.
    pub device_images: DeviceImages,
    /// The part of the images that is used.
    pub readout: ReadoutConfiguration,
    /// Images per second of each camera.
    pub rate_hz: f64,
    /// Longest time between the starts of both exposures of an image pair, nanoseconds.
    pub max_skew_ns: u64,
    /// Source of the pattern events.
    pub projector: ProjectorDriver,
    /// Window stride, image pairs.
    pub window_every: usize,
    /// Whether a stage waits until the next stage is free. Otherwise it continues with newer windows, and counts those
    /// that it skips.
    pub wait_when_busy: bool,
    /// The recorder.
    pub recorder: RecorderConfiguration,
    /// Metrics, dashboard and live view.
    pub monitor: MonitorConfiguration,
    /// CPUs and memory per service.
    pub processors: ProcessorsConfiguration,
    /// The text of the configuration file, with the fringes of a file that it names.
    pub text: String,
}

/// The part of the images that is used. Their full size is in the calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadoutConfiguration {
    /// Region (x, y, width, height), pixels; `None` for the whole image.
    pub region_px: Option<[usize; 4]>,
    /// Side of the pixel squares that are averaged to one pixel.
    pub binning: usize,
}

/// Source of rig, pattern and measurement volume.
#[derive(Clone, Debug, PartialEq)]
pub enum RigSource {
    /// A calibration file and this configuration.
    Files {
        /// OpenCV FileStorage YAML.
        calibration: PathBuf,
        /// Unit of lengths in the file.
        unit: Unit,
        /// The fringes.
        sequence: FringeSequence,
    },
    /// The virtual scanner.
    Virtual(Box<VirtualScannerConfiguration>),
}

/// Source of the pattern events: which phase shift an image shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProjectorDriver {
    /// The virtual projector publishes pattern events.
    Virtual,
    /// Another program publishes them, see `docs/projector-driver.md`.
    External,
    /// No events: the cycle starts with each session of the cameras and advances image by image.
    Cycle,
}

/// Configuration of the recorder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecorderConfiguration {
    /// Folder of recordings whose name has no path.
    pub folder: PathBuf,
    /// Whether a recording starts with the instance.
    pub from_start: bool,
    /// Maximum number of bytes that wait for the disk.
    pub queue_bytes: u64,
    /// Free space to keep on the disk, bytes.
    pub min_free_bytes: u64,
    /// Whether phase maps are recorded. They can be computed again from the images.
    pub phase_maps: bool,
    /// Whether correspondences are recorded. They can be computed again from the images.
    pub correspondences: bool,
}

impl ScannerConfiguration {
    /// Reads and checks a configuration file. Paths in it are relative to its folder.
    ///
    /// # Errors
    /// [`ConfigurationError`], which names file, key and value.
    pub fn read(path: &Path) -> Result<Self, ConfigurationError> {
        read_with(path, Self::parse)
    }

    /// [`Self::read`], with the virtual scanner in the place of cameras and projector. Rig, pattern, volume, rate, and
    /// size, region, binning and depth of the images stay.
    ///
    /// # Errors
    /// As [`Self::read`]. The file must be valid as it is.
    pub fn read_virtual(path: &Path) -> Result<Self, ConfigurationError> {
        read_with(path, Self::parse_virtual)
    }

    /// [`Self::read`] for a text in memory.
    ///
    /// # Errors
    /// [`ConfigurationProblem`], which names key and value.
    pub fn parse(text: &str, folder: &Path) -> Result<Self, ConfigurationProblem> {
        let raw = RawConfiguration::parse(text)?;
        if let Some((pattern, file)) = raw.pattern.as_ref().and_then(|raw| Some((raw, raw.file.as_ref()?))) {
            let (stated, pattern_file) = pattern_file::with_its_cycle(text, pattern, file, folder)?;
            return Ok(Self { pattern_file: Some(pattern_file), ..Self::parse(&stated, folder)? });
        }
        let cameras = raw.cameras.as_ref().ok_or(ConfigurationProblem::Missing {
            key: "cameras",
            expected: "it must be a table with source and rate_hz of the images",
        })?;
        let rate_hz = checked(
            "cameras.rate_hz",
            cameras.rate_hz,
            |v| (0.1..=1000.0).contains(v),
            "it must lie between 0.1 and 1000 images per second",
        )?;
        let source = cameras::camera_source(cameras, rate_hz)?;
        let device_images = cameras::device_images(&source, cameras)?;
        let driver = raw.projector.driver.as_deref().unwrap_or("cycle");
        let projector = one_of(
            "projector.driver",
            driver,
            &[
                ("virtual", ProjectorDriver::Virtual),
                ("external", ProjectorDriver::External),
                ("cycle", ProjectorDriver::Cycle),
            ],
        )?;
        let measurement = Configuration::from_raw(&raw)?;
        let format = device_images.format().pixel_format();
        let rig = rig_source(&raw, (&source, rate_hz), format, measurement.volume.as_ref(), folder)?;
        Ok(Self {
            name: raw.instance.name.clone().unwrap_or_else(|| "fringeflow".to_owned()),
            measurement,
            segment_table: segment_table(&raw, folder),
            rig,
            pattern_file: None,
            readout: readout(cameras, &source)?,
            max_skew_ns: max_skew::max_skew_ns(cameras.max_skew_us, rate_hz)?,
            cameras: source,
            device_images,
            rate_hz,
            projector,
            window_every: checked(
                "window.every",
                raw.window.every.unwrap_or(1),
                |v| (1..=1000).contains(v),
                "it must lie between 1 and 1000 image pairs",
            )?,
            wait_when_busy: one_of(
                "window.when_busy",
                raw.window.when_busy.as_deref().unwrap_or("skip"),
                &[("skip", false), ("wait", true)],
            )?,
            recorder: recorder(&raw.recorder, folder)?,
            monitor: monitor::configuration(&raw.monitor, folder)?,
            processors: processors::configuration(&raw.processors)?,
            text: text.to_owned(),
        })
    }

    /// [`Self::read_virtual`] for a text in memory.
    ///
    /// # Errors
    /// As [`Self::parse`].
    pub fn parse_virtual(text: &str, folder: &Path) -> Result<Self, ConfigurationProblem> {
        Self::parse(&virtual_text(&Self::parse(text, folder)?)?, folder)
    }

    /// [`Self::parse`] for the text in a recording, which may be older than this version.
    ///
    /// # Errors
    /// [`ConfigurationProblem`], which names key and value.
    pub fn parse_recorded(text: &str, folder: &Path) -> Result<Self, ConfigurationProblem> {
        Self::parse(&super::renamed_keys::with_current_names(text)?, folder)
    }

    /// Time from one image to the next, nanoseconds.
    #[must_use]
    pub fn frame_period_ns(&self) -> u64 {
        (1e9 / self.rate_hz) as u64
    }

    /// Returns the text for a recording: the file, with the limit of the skew stated even if it is the default. A
    /// replay must make the same pairs, whatever the default is then.
    #[must_use]
    pub fn recorded_text(&self) -> String {
        with_max_skew(&self.text, self.max_skew_ns)
    }

    /// Format of the images in the channels.
    #[must_use]
    pub fn pixel_format(&self) -> PixelFormat {
        self.device_images.pixel_format(self.readout.binning)
    }

    /// Returns the texts of the setup that [`Self::rig`] describes. For a virtual scanner, the simulation creates them
    /// with [`Self::setup_text_of`].
    ///
    /// # Errors
    /// The calibration cannot be read, a key is missing, or the rig is virtual.
    pub fn setup_text(&self) -> Result<SetupText, SetupTextError> {
        match &self.rig {
            None | Some(RigSource::Virtual(_)) => Err(SetupTextError::NoRig),
            Some(RigSource::Files { calibration, unit, sequence }) => {
                let volume = self.measurement.volume.as_ref().ok_or(SetupTextError::NoVolume)?;
                self.text_of_files(calibration, *unit, sequence, volume)
            }
        }
    }

    fn text_of_files(
        &self,
        file: &Path,
        unit: Unit,
        sequence: &FringeSequence,
        volume: &MeasurementVolume,
    ) -> Result<SetupText, SetupTextError> {
        let calibration = read_calibration_text(file)?;
        let rig = parse_calibration(&calibration, unit);
        let rig = rig.map_err(|problem| CalibrationError { file: file.to_owned(), problem })?;
        self.check_projector(&rig)?;
        let description = DatasetDescription {
            name: self.name.clone(),
            unit,
            readout: Readout::whole([rig.cam1.width_px(), rig.cam1.height_px()]),
            pixel_format: self.device_images.pixel_format(1),
            source: None,
            steps: sequence.shifts_rad.len(),
            sequence: sequence.clone(),
            second_direction: None,
            volume: *volume,
            exact_cam1_from_volume: None,
            motion: None,
            remarks: serde_json::Map::new(),
        };
        self.setup_text_of(description, &rig, Some(calibration))
    }

    /// Checks that the calibration is for a projector with the size of the patterns.
    fn check_projector(&self, rig: &Rig) -> Result<(), SetupTextError> {
        let calibrated_px = [rig.projector.width_px(), rig.projector.height_px()];
        match &self.pattern_file {
            Some(PatternFile { file, projector_px }) if *projector_px != calibrated_px => {
                Err(SetupTextError::Projector { file: file.clone(), projector_px: *projector_px, calibrated_px })
            }
            _ => Ok(()),
        }
    }

    /// Returns the setup texts for the used part of the images, from the description and the rig of whole images. If
    /// whole images are used, the text of the calibration stays as it was read.
    ///
    /// # Errors
    /// The region exceeds the images.
    pub fn setup_text_of(
        &self,
        whole: DatasetDescription,
        rig: &Rig,
        as_read: Option<String>,
    ) -> Result<SetupText, SetupTextError> {
        let ReadoutConfiguration { region_px, binning } = self.readout;
        let readout = Readout::new(whole.readout.sensor_px(), region_px, binning)?;
        let as_read = as_read.filter(|_| readout.is_whole());
        let calibration = as_read.unwrap_or_else(|| calibration_text(&readout.rig(rig), whole.unit));
        let description = DatasetDescription { readout, pixel_format: self.pixel_format(), ..whole };
        Ok(SetupText { description: description.text()?, calibration })
    }
}

/// Why a configuration yields no setup.
#[derive(Debug, thiserror::Error)]
pub enum SetupTextError {
    /// The configuration has no rig.
    #[error("the configuration has no rig; name a calibration file in [rig], or set cameras.source = \"virtual\"")]
    NoRig,
    /// The configuration has no measurement volume.
    #[error("the configuration has no [measurement_volume]; add a box that contains the object")]
    NoVolume,
    /// The calibration file cannot be read.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The patterns are for another projector.
    #[error(
        "key pattern.file: {} is for a projector of {} × {} pixels, the calibration for one of {} × {}; name the patterns \
         of this projector",
        file.display(), projector_px[0], projector_px[1], calibrated_px[0], calibrated_px[1]
    )]
    Projector {
        /// The patterns.
        file: PathBuf,
        /// Their size, pixels.
        projector_px: [usize; 2],
        /// Size in the calibration, pixels.
        calibrated_px: [usize; 2],
    },
    /// The region or the binning does not fit the images.
    #[error("keys cameras.region_px and cameras.binning: {0}")]
    Readout(#[from] ReadoutError),
    /// The table of the virtual scanner is invalid.
    #[error("virtual scanner: {0}")]
    VirtualScanner(String),
    /// The description cannot be written as JSON.
    #[error("cannot write the description of the setup: {0}")]
    Description(#[from] serde_json::Error),
}

/// Reads a file, and parses its text with its folder.
fn read_with(
    path: &Path,
    parse: fn(&str, &Path) -> Result<ScannerConfiguration, ConfigurationProblem>,
) -> Result<ScannerConfiguration, ConfigurationError> {
    let text = read_text(path).map_err(ConfigurationProblem::from);
    let folder = path.parent().unwrap_or(Path::new("."));
    text.and_then(|text| parse(&text, folder)).map_err(|problem| ConfigurationError { file: path.to_owned(), problem })
}

fn segment_table(raw: &RawConfiguration, folder: &Path) -> Option<PathBuf> {
    raw.rig.as_ref()?.segment_table.as_ref().map(|path| in_folder(folder, path))
}

fn rig_source(
    raw: &RawConfiguration,
    (cameras, rate_hz): (&CameraSource, f64),
    format: PixelFormat,
    volume: Option<&MeasurementVolume>,
    folder: &Path,
) -> Result<Option<RigSource>, ConfigurationProblem> {
    let files = match &raw.rig {
        Some(rig) => {
            let unit = one_of("rig.unit", &rig.unit, &[("mm", Unit::Millimetre), ("m", Unit::Metre)])?;
            Some((in_folder(folder, &rig.calibration), unit))
        }
        None => None,
    };
    if *cameras == CameraSource::Virtual {
        let pattern = pattern(raw.pattern.as_ref())?;
        let given = match (files, volume) {
            (Some((calibration, unit)), Some(volume)) => Some(GivenRigFiles { calibration, unit, volume: *volume }),
            (None, None) => None,
            (Some(_), None) => {
                let expected = "it must be a table with the box of the rig in [rig], which is simulated";
                return Err(ConfigurationProblem::Missing { key: "measurement_volume", expected });
            }
            (None, Some(_)) => {
                let expected = "it must be a table with the calibration of the rig to simulate; without \
                                [measurement_volume] the built-in rig is simulated";
                return Err(ConfigurationProblem::Missing { key: "rig", expected });
            }
        };
        let configuration =
            VirtualScannerConfiguration::new(&raw.virtual_scanner, &pattern, rate_hz, format, given, folder)?;
        return Ok(Some(RigSource::Virtual(Box::new(configuration))));
    }
    let Some((calibration, unit)) = files else { return Ok(None) };
    let sequence = pattern(raw.pattern.as_ref())?;
    Ok(Some(RigSource::Files { calibration, unit, sequence }))
}

/// Reads which part of the images is used. The calibration shows later whether it fits the images.
fn readout(raw: &RawCameras, source: &CameraSource) -> Result<ReadoutConfiguration, ConfigurationProblem> {
    let binning = raw.binning.unwrap_or(1);
    let binning = checked(
        "cameras.binning",
        binning,
        |v| BINNINGS.contains(v),
        "it must be 1 for all pixels, or 2 to average squares of 2 x 2 pixels",
    )?;
    let refused = |key, value| {
        let expected =
            "it does not apply to images from other programs; remove it, and calibrate for the images that they send";
        Err(ConfigurationProblem::Value { key, value, expected })
    };
    match (source, raw.region_px) {
        (CameraSource::External, Some(region)) => refused("cameras.region_px", format!("{region:?}")),
        (CameraSource::External, None) if binning > 1 => refused("cameras.binning", binning.to_string()),
        (_, region_px) => Ok(ReadoutConfiguration { region_px, binning }),
    }
}

/// Reads the fringes of `[pattern]`.
fn pattern(raw: Option<&RawPattern>) -> Result<FringeSequence, ConfigurationProblem> {
    let raw = raw.ok_or(ConfigurationProblem::Missing {
        key: "pattern",
        expected: "it must be a table with steps and period_px of the projected fringes",
    })?;
    let missing =
        |key| ConfigurationProblem::Missing { key, expected: "give it, or the patterns.toml with it in file" };
    let steps = raw.steps.ok_or_else(|| missing("pattern.steps"))?;
    let steps =
        checked("pattern.steps", steps, |v| (MIN_STEPS..=MAX_STEPS).contains(v), "it must lie between 3 and 16")?;
    let pattern = FringePattern {
        period_px: checked(
            "pattern.period_px",
            raw.period_px.ok_or_else(|| missing("pattern.period_px"))?,
            |v| v.is_finite() && *v >= 2.0,
            "it must be at least 2 projector pixels",
        )?,
        sign: checked("pattern.phase_sign", raw.phase_sign.unwrap_or(1.0), |v| v.abs() == 1.0, "it must be 1 or -1")?,
        offset_rad: checked(
            "pattern.phase_offset_rad",
            raw.phase_offset_rad.unwrap_or(0.0),
            |v| v.is_finite(),
            "it must be a finite number",
        )?,
    };
    let equal = || (0..steps).map(|k| TAU * k as f64 / steps as f64).collect();
    let shifts_rad: Vec<f64> = raw.phase_shift_rad.clone().unwrap_or_else(equal);
    if shifts_rad.len() != steps || shifts_rad.iter().any(|s| !s.is_finite()) {
        return Err(ConfigurationProblem::Value {
            key: "pattern.phase_shift_rad",
            value: format!("{shifts_rad:?}"),
            expected: "it must contain one finite number per step",
        });
    }
    if let Some(unit) = MistakenUnit::of_shifts(&shifts_rad) {
        return Err(ConfigurationProblem::Value {
            key: "pattern.phase_shift_rad",
            value: format!("{shifts_rad:?}"),
            expected: unit.remedy(),
        });
    }
    Ok(FringeSequence { pattern, shifts_rad, gray: None })
}

fn recorder(raw: &RawRecorder, folder: &Path) -> Result<RecorderConfiguration, ConfigurationProblem> {
    let megabytes = |key, value: u64, least: u64| {
        let value = checked(key, value, |v| (least..=1 << 24).contains(v), "it is too small or too large");
        value.map(|v| v << 20)
    };
    Ok(RecorderConfiguration {
        folder: in_folder(folder, raw.folder.as_deref().unwrap_or(Path::new("."))),
        from_start: raw.from_start.unwrap_or(false),
        queue_bytes: megabytes("recorder.queue_mb", raw.queue_mb.unwrap_or(256), 1)?,
        min_free_bytes: megabytes("recorder.min_free_mb", raw.min_free_mb.unwrap_or(1024), 0)?,
        phase_maps: raw.phase_maps.unwrap_or(false),
        correspondences: raw.correspondences.unwrap_or(false),
    })
}

#[cfg(test)]
mod tests {
    use fringeflow_pixels::SourceFormat;

    use super::*;

    const DEMO: &str = include_str!("../../../configs/demo.toml");

    fn parse(text: &str) -> Result<ScannerConfiguration, ConfigurationProblem> {
        ScannerConfiguration::parse(text, Path::new("/configs"))
    }

    #[test]
    fn the_demo_is_a_scanner_with_a_setup() {
        let demo = parse(DEMO).unwrap();
        assert_eq!((&demo.cameras, demo.projector), (&CameraSource::Virtual, ProjectorDriver::Virtual));
        assert_eq!(demo.frame_period_ns(), 33_333_333);
        assert_eq!(demo.recorder.folder, Path::new("/demo-output"));
        // The measurement tables are also a valid configuration on their own.
        assert_eq!(Configuration::parse(DEMO).unwrap(), demo.measurement);
    }

    #[test]
    fn invalid_values_are_named() {
        let changed = |from: &str, to: &str| {
            assert!(DEMO.contains(from), "{from}");
            parse(&DEMO.replace(from, to)).unwrap_err().to_string()
        };
        assert!(changed("rate_hz = 30.0", "rate_hz = 0.0").contains("cameras.rate_hz is 0"));
        assert!(changed("driver = \"virtual\"", "driver = \"vritual\"").contains("it must be one of"));
        assert!(changed("steps = 4", "steps = 2").contains("pattern.steps is 2"));
        assert!(changed("every = 3", "evry = 3").contains("evry"));
        assert!(changed("[cameras]", "[camera]").contains("camera"));
        assert!(parse("").unwrap_err().to_string().contains("key cameras is missing"));
    }

    #[test]
    fn the_setup_has_the_format_of_the_cameras() {
        assert_eq!(parse(DEMO).unwrap().pixel_format(), PixelFormat::Grey);
        let deep = parse(&DEMO.replace("format = \"GREY\"", "format = \"Y12\"")).unwrap();
        assert_eq!((deep.device_images.format(), deep.pixel_format()), (SourceFormat::Y12, PixelFormat::Y12));
        // External programs can write only the formats of the channels.
        let refused = parse(&DEMO.replace("format = \"GREY\"", "format = \"YUYV\"")).unwrap_err();
        assert!(
            refused.to_string().contains("key cameras.format is \"YUYV\"; it must be one of [\"GREY\", \"Y10\""),
            "{refused}"
        );
    }

    #[test]
    fn binned_images_have_a_deeper_format() {
        let with = |cameras: &str| parse(&DEMO.replace("rate_hz = 30.0", &format!("rate_hz = 30.0\n{cameras}")));
        assert_eq!(with("binning = 2").unwrap().pixel_format(), PixelFormat::Y10);
        assert!(with("binning = 3").unwrap_err().to_string().contains("cameras.binning is 3"));
        let external = "[cameras]\nsource = \"external\"\nrate_hz = 30.0\nbinning = 2\n";
        assert!(parse(external).unwrap_err().to_string().contains("cameras.binning is 2"));
    }

    #[test]
    fn a_real_rig_needs_calibration_and_volume() {
        let cameras = "[cameras]\nsource = \"external\"\nrate_hz = 30.0\n";
        let none = parse(cameras).unwrap();
        assert!(matches!(none.setup_text(), Err(SetupTextError::NoRig)));
        let rig = "[rig]\ncalibration = \"c.yml\"\nunit = \"mm\"\n[pattern]\nsteps = 4\nperiod_px = 16.0\n";
        let no_volume = parse(&format!("{cameras}{rig}")).unwrap();
        assert!(matches!(no_volume.setup_text(), Err(SetupTextError::NoVolume)));
    }
}
