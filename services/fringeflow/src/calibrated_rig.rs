//! A calibrated rig from a file, with the volume and the pattern that are stated with it.
//!
//! In: a calibration file (OpenCV YAML), the configuration of a scanner (.toml), a dataset folder or a recording
//! (.mcap), and perhaps a volume. Out: the rig, and what the file states beside it.

use std::path::Path;

use fringeflow::calibration::{Unit, read_calibration};
use fringeflow::geometry::{FringePattern, MeasurementVolume, Point3, Pose, Rig};
use fringeflow_dataset::{Setup, read_volume};
use fringeflow_lab::simulation::{read_configuration, setup_text};

use crate::failure::Failure;
use crate::input::Input;

/// A calibrated rig.
pub(crate) struct CalibratedRig {
    pub(crate) rig: Rig,
    pub(crate) volume: Option<MeasurementVolume>,
    /// Pattern and steps of a configuration, a dataset or a recording.
    pub(crate) measurement: Option<(FringePattern, usize)>,
}

impl CalibratedRig {
    /// Reads the rig. `volume` replaces the volume of the file: six numbers, or a file. `units` is its unit and that of
    /// a calibration file.
    pub(crate) fn read(file: &Path, units: Option<Unit>, volume: Option<&str>) -> Result<Self, Failure> {
        let is_of_kind = |kind: &str| file.extension().is_some_and(|extension| extension == kind);
        let setup = if is_of_kind("toml") {
            Some(configured_setup(file)?)
        } else if is_of_kind("mcap") || file.is_dir() {
            let input = Input::open(file, units)?;
            if volume.is_none() {
                input.check_unit(units)?;
            }
            Some(input.setup().clone())
        } else {
            None
        };
        let (rig, unit, stated, measurement) = match setup {
            Some(set) => (set.rig, set.unit, set.volume, Some((set.sequence.pattern, set.steps))),
            None => {
                let unit = units.unwrap_or(Unit::Millimetre);
                (read_calibration(file, unit)?, unit, None, None)
            }
        };
        let given = volume.map(|given| parse_volume(given, units.unwrap_or(unit))).transpose()?;
        Ok(Self { rig, volume: given.or(stated), measurement })
    }

    /// The volume, which is missing in `file` if neither it nor `--volume` states one.
    pub(crate) fn required_volume(&self, file: &Path) -> Result<MeasurementVolume, Failure> {
        let missing = || {
            let calibration = file.display();
            Failure::Usage(format!("{calibration} states no measurement volume; give --volume BOX or --volume FILE"))
        };
        self.volume.ok_or_else(missing)
    }
}

/// Returns the setup of the scanner of a configuration.
pub(crate) fn configured_setup(file: &Path) -> Result<Setup, Failure> {
    let unusable = |what: String| Failure::Usage(format!("{}: {what}", file.display()));
    let text = setup_text(&read_configuration(file)?).map_err(|e| unusable(e.to_string()))?;
    Setup::parse(text, None).map_err(|e| unusable(e.to_string()))
}

/// Parses a volume of six numbers, or reads it from a file.
fn parse_volume(given: &str, unit: Unit) -> Result<MeasurementVolume, Failure> {
    let numbers: Result<Vec<f64>, _> = given.split(',').map(|number| number.trim().parse::<f64>()).collect();
    let Ok(numbers) = numbers else {
        return Ok(read_volume(Path::new(given), unit)?);
    };
    let &[x0, y0, z0, x1, y1, z1] = &numbers[..] else {
        let count = numbers.len();
        let what = format!("--volume {given}: {count} numbers were given; expected xmin,ymin,zmin,xmax,ymax,zmax");
        return Err(Failure::Usage(what));
    };
    let corner = |corner: [f64; 3]| Point3::from(corner.map(|c| c * unit.in_metres()));
    let volume = MeasurementVolume::new(Pose::identity(), corner([x0, y0, z0]), corner([x1, y1, z1]));
    volume.map_err(|error| Failure::Usage(format!("--volume {given}: {error}")))
}
