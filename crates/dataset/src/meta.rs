//! `meta.json`: raw serde structs, and their conversion to checked types.

use std::f64::consts::TAU;
use std::path::Path;

use serde::{Deserialize, Serialize};

use fringeflow::calibration::Unit;
use fringeflow::geometry::{FringePattern, MeasurementVolume, Point3, Pose, Readout};
use fringeflow::phase::{GrayCode, MistakenUnit};
use fringeflow_base::grey::PixelFormat;
use fringeflow_base::limits::MIN_STEPS;
use fringeflow_base::text_file::read_text;
use fringeflow_pixels::DeviceImages;

use super::error::{DatasetError, Problem};
use super::fields::{field_problem, raw_pose, rigid_pose};
use super::misspelt;
use super::motion::{Motion, RawMotion};
use super::sequence::FringeSequence;
use super::source::RawSource;

#[derive(Deserialize)]
struct RawMeta {
    name: Option<String>,
    unit: Option<String>,
    image_size: [usize; 2],
    readout: Option<RawReadout>,
    bits: Option<u8>,
    source: Option<RawSource>,
    steps: usize,
    #[serde(flatten)]
    sequence: RawSequence,
    second_direction: Option<RawSequence>,
    volume: Option<VolumeDescription>,
    motion: Option<RawMotion>,
}

/// Region and binning of the sensor; `None` if the whole image of the sensor is used.
#[derive(Deserialize, Serialize)]
pub(super) struct RawReadout {
    sensor_size: [usize; 2],
    region: [usize; 4],
    binning: usize,
}

#[derive(Deserialize, Serialize)]
pub(super) struct RawSequence {
    phase_shift_rad: Vec<f64>,
    period_px: f64,
    phase_sign: f64,
    phase_offset_rad: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    gray: Option<RawGray>,
}

#[derive(Deserialize, Serialize)]
struct RawGray {
    images: usize,
    cell_periods: f64,
}

/// A measurement volume in a file: `x_c1 = R_v·x_v + T_v`, box `min..max`, lengths in the file's unit.
#[derive(Deserialize, Serialize)]
pub struct VolumeDescription {
    #[serde(rename = "R_v")]
    r_v: [[f64; 3]; 3],
    #[serde(rename = "T_v")]
    t_v: [f64; 3],
    #[serde(rename = "R_v_exact")]
    r_v_exact: Option<[[f64; 3]; 3]>,
    #[serde(rename = "T_v_exact")]
    t_v_exact: Option<[f64; 3]>,
    min: [f64; 3],
    max: [f64; 3],
}

impl RawReadout {
    /// Returns the raw form, or `None` if the whole sensor is used.
    pub(super) fn from_readout(readout: &Readout) -> Option<Self> {
        let (sensor_size, region, binning) = (readout.sensor_px(), readout.region(), readout.binning());
        (!readout.is_whole()).then_some(Self { sensor_size, region, binning })
    }

    fn checked(&self, image_size_px: [usize; 2]) -> Result<Readout, Problem> {
        let readout = Readout::new(self.sensor_size, Some(self.region), self.binning);
        let readout = readout.map_err(|problem| field_problem("readout", problem.to_string()))?;
        let [width, height] = readout.image_size_px();
        if [width, height] != image_size_px {
            return Err(field_problem(
                "readout",
                format!("results in images of {width} × {height} pixels, but image_size is different"),
            ));
        }
        Ok(readout)
    }
}

impl From<&FringeSequence> for RawSequence {
    fn from(sequence: &FringeSequence) -> Self {
        Self {
            phase_shift_rad: sequence.shifts_rad.clone(),
            period_px: sequence.pattern.period_px,
            phase_sign: sequence.pattern.sign,
            phase_offset_rad: sequence.pattern.offset_rad,
            gray: sequence.gray.map(|g| RawGray { images: g.images, cell_periods: g.cell_periods }),
        }
    }
}

impl VolumeDescription {
    /// Converts a volume, and its pose in the frame of the ground truth if that differs, to the raw form in `unit`.
    pub(super) fn new(volume: &MeasurementVolume, exact: Option<&Pose>, unit: Unit) -> Self {
        let scale = unit.in_metres();
        let (r_v, t_v) = raw_pose(volume.cam1_from_volume(), scale);
        let exact = exact.map(|pose| raw_pose(pose, scale));
        Self {
            r_v,
            t_v,
            r_v_exact: exact.map(|(r, _)| r),
            t_v_exact: exact.map(|(_, t)| t),
            min: (volume.min().coords / scale).into(),
            max: (volume.max().coords / scale).into(),
        }
    }
}

/// Content of `meta.json`, checked.
pub(super) struct Meta {
    pub(super) name: Option<String>,
    pub(super) unit: Option<Unit>,
    pub(super) readout: Readout,
    pub(super) pixel_format: Option<PixelFormat>,
    pub(super) source: Option<DeviceImages>,
    pub(super) steps: usize,
    pub(super) sequence: FringeSequence,
    pub(super) second_direction: Option<FringeSequence>,
    volume: Option<VolumeDescription>,
    motion: Option<RawMotion>,
}

/// Reads and checks the text of `meta.json`.
pub(super) fn parse(text: &str) -> Result<Meta, Problem> {
    misspelt::check(text)?;
    let raw: RawMeta = serde_json::from_str(text).map_err(|e| Problem::Json(e.to_string()))?;
    let [width, height] = raw.image_size;
    if !(2..=65535).contains(&width) || !(2..=65535).contains(&height) {
        return Err(field_problem("image_size", format!("is {width} × {height}; both must lie between 2 and 65535")));
    }
    let sequence = checked_sequence(raw.sequence)?;
    let count = sequence.shifts_rad.len();
    if raw.steps < MIN_STEPS || raw.steps > count {
        let what =
            format!("is {}; it must lie between {MIN_STEPS} and the number of phase_shift_rad, {count}", raw.steps);
        return Err(field_problem("steps", what));
    }
    let readout = match &raw.readout {
        Some(readout) => readout.checked(raw.image_size)?,
        None => Readout::whole(raw.image_size),
    };
    let source = raw.source.map(|source| source.checked(&readout)).transpose()?;
    let pixel_format = match (raw.bits, source) {
        (Some(bits), Some(images)) => {
            let what = format!("is {bits}, but the depth follows from source.format, {}; remove bits", images.format());
            return Err(field_problem("bits", what));
        }
        (bits, None) => bits.map(pixel_format).transpose()?,
        (None, Some(images)) => Some(images.pixel_format(readout.binning())),
    };
    let unit = raw.unit.map(|u| u.parse::<Unit>().map_err(|e| field_problem("unit", e.to_string()))).transpose()?;
    Ok(Meta {
        name: raw.name,
        unit,
        readout,
        pixel_format,
        source,
        steps: raw.steps,
        sequence,
        second_direction: raw.second_direction.map(checked_sequence).transpose()?,
        volume: raw.volume,
        motion: raw.motion,
    })
}

impl Meta {
    /// The measurement volume in metres, and its pose in the frame of the ground truth if that differs.
    pub(super) fn volume(&self, unit: Unit) -> Result<Option<(MeasurementVolume, Option<Pose>)>, Problem> {
        let Some(raw) = &self.volume else { return Ok(None) };
        let scale = unit.in_metres();
        let exact = match (&raw.r_v_exact, &raw.t_v_exact) {
            (Some(r), Some(t)) => Some(pose("volume.R_v_exact", r, t, scale)?),
            _ => None,
        };
        Ok(Some((raw.to_volume(unit)?, exact)))
    }

    /// Motion of the object, if it moves.
    pub(super) fn motion(&self, unit: Unit) -> Result<Option<Motion>, Problem> {
        let parse = |raw: &RawMotion| raw.parse(self.sequence.shifts_rad.len(), self.volume.is_some(), unit);
        self.motion.as_ref().map(parse).transpose()
    }
}

impl VolumeDescription {
    /// The measurement volume, from lengths in `unit`.
    ///
    /// # Errors
    /// The matrix is not a rotation, or the box is empty.
    pub fn to_volume(&self, unit: Unit) -> Result<MeasurementVolume, Problem> {
        let scale = unit.in_metres();
        let cam1_from_volume = pose("volume.R_v", &self.r_v, &self.t_v, scale)?;
        let [min, max] = [self.min, self.max].map(|corner| Point3::from(corner.map(|c| c * scale)));
        Ok(MeasurementVolume::new(cam1_from_volume, min, max)?)
    }
}

/// Reads a measurement volume from a separate JSON file: `R_v`, `T_v`, `min`, `max` in `unit`, as in `meta.json`.
///
/// # Errors
/// The file is unreadable, a field is missing, the matrix is not a rotation, or the box is empty.
pub fn read_volume(path: &Path, unit: Unit) -> Result<MeasurementVolume, DatasetError> {
    let text = read_text(path).map_err(Problem::from);
    let raw = text
        .and_then(|text| serde_json::from_str::<VolumeDescription>(&text).map_err(|e| Problem::Json(e.to_string())));
    raw.and_then(|raw| raw.to_volume(unit)).map_err(|problem| DatasetError::new(path, problem))
}

fn checked_sequence(raw: RawSequence) -> Result<FringeSequence, Problem> {
    if let Some((i, shift)) = raw.phase_shift_rad.iter().enumerate().find(|(_, s)| !s.is_finite()) {
        return Err(field_problem(
            "phase_shift_rad",
            format!("value {i} is {shift}; every shift must be a finite number"),
        ));
    }
    if let Some(unit) = MistakenUnit::of_shifts(&raw.phase_shift_rad) {
        return Err(field_problem("phase_shift_rad", format!("{:?}: {}", raw.phase_shift_rad, unit.remedy())));
    }
    if !(raw.period_px.is_finite() && raw.period_px >= 2.0) {
        return Err(field_problem(
            "period_px",
            format!("is {}; a fringe has at least 2 projector pixels", raw.period_px),
        ));
    }
    if raw.phase_sign.abs() != 1.0 {
        return Err(field_problem("phase_sign", format!("is {}; it must be 1 or -1", raw.phase_sign)));
    }
    if !raw.phase_offset_rad.is_finite() {
        return Err(field_problem(
            "phase_offset_rad",
            format!("is {}; it must be a finite number", raw.phase_offset_rad),
        ));
    }
    let pattern = FringePattern {
        period_px: raw.period_px,
        sign: raw.phase_sign,
        offset_rad: raw.phase_offset_rad.rem_euclid(TAU),
    };
    Ok(FringeSequence {
        pattern,
        shifts_rad: raw.phase_shift_rad,
        gray: raw.gray.as_ref().map(checked_gray).transpose()?,
    })
}

/// The format of images with this number of bits.
fn pixel_format(bits: u8) -> Result<PixelFormat, Problem> {
    let known = || PixelFormat::ALL.map(PixelFormat::bits);
    PixelFormat::from_bits(bits)
        .ok_or_else(|| field_problem("bits", format!("is {bits}; images have one of {:?} bits", known())))
}

fn checked_gray(raw: &RawGray) -> Result<GrayCode, Problem> {
    if !(1..=16).contains(&raw.images) {
        return Err(field_problem("gray.images", format!("is {}; a Gray code has 1 to 16 images", raw.images)));
    }
    if raw.cell_periods != 0.5 && raw.cell_periods != 1.0 {
        return Err(field_problem("gray.cell_periods", format!("is {}; it must be 0.5 or 1", raw.cell_periods)));
    }
    Ok(GrayCode { images: raw.images, cell_periods: raw.cell_periods })
}

fn pose(name: &'static str, r: &[[f64; 3]; 3], t: &[f64; 3], scale: f64) -> Result<Pose, Problem> {
    rigid_pose(r, t, scale).map_err(|what| field_problem(name, what))
}
