//! `fringeflow simulate`: writes a simulated dataset folder, the images of a calibration, or a recording of the virtual
//! scanner of a configuration.

mod calibration_set;
mod configured;
mod recording;
mod simulated_time;

use std::io::Write as _;
use std::path::PathBuf;
use std::str::FromStr;

use fringeflow::calibration::Unit;
use fringeflow::geometry::FringePattern;
use fringeflow_dataset::{CameraId, check_new};
use fringeflow_lab::evaluation::SimulatedDatasetError;
use fringeflow_lab::simulation::{
    Arrangement, Board, BoardApart, GivenRig, MotionOptions, NoiseLevel, Object, RigOptions, Simulation,
    SimulationError, SimulationOptions, SimulationSummary, Staging,
};
use fringeflow_pixels::{BayerGrey, DeviceImages, SourceFormat, StereoLayout};

use crate::acting_options::{ActingOptions, Mode};
use crate::calibrated_rig::CalibratedRig;
use crate::failure::Failure;
use crate::output_folder::has_extension;
use crate::progress;
use crate::values::{one_of, parse_size, unit};

use calibration_set::CalibrationArgs;
use configured::ConfiguredSimulation;

/// Arguments of `fringeflow simulate`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Dataset folder to write: a new or an empty one. With --config also: recording to write (.mcap).
    #[arg(short, long, value_name = "FOLDER|REC.mcap")]
    output: PathBuf,
    /// Take the images of the rig of a configuration, with any cameras; see configs/demo.toml and configs/rigs. Table
    /// [virtual_scanner] says what it sees.
    ///
    /// A recording holds what the virtual scanner delivers live and the true poses of the object. A dataset holds one cycle
    /// at rest, Gray code and the truth, so `evaluate` judges the rig. No service runs. The same configuration gives the
    /// same bytes.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Seconds to record, at most 3600. The default is one round of the sweep.
    #[arg(long, value_name = "S", value_parser = recording::parse_seconds)]
    seconds: Option<f64>,
    /// Object to measure. clutter and crumbs are hard, and tray is larger than the image.
    #[arg(long, value_name = "NAME", default_value = "elephant", value_parser = one_of(&Object::ALL, Object::name))]
    object: Object,
    /// Board under the object: visible, dark or none. Or a board outside the measurement volume, which is seen but not
    /// measured: its distance behind the volume in millimetres. Below 0 it stands before the volume and covers the
    /// right part. behind means 15. The default is visible, for crumbs none.
    #[arg(long, value_name = "KIND|MM", value_parser = Board::from_str, allow_negative_numbers = true)]
    board: Option<Board>,
    /// Albedo of a board outside the volume, 0 to 2: black paper 0.05, grey 0.3, white 0.8 [default: 0.62].
    #[arg(long, value_name = "SHARE")]
    board_albedo: Option<f64>,
    /// Rotation of that board about the vertical axis, -80 to 80 degrees. Above 0 its right border is farther from the
    /// sensor. Its distance is that of its nearest point [default: 0].
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    board_tilt: Option<f64>,
    /// Scale the object to fill this share of the image of C1, 0.1 to 60. Board and hand do not count.
    #[arg(long, value_name = "PERCENT")]
    share: Option<f64>,
    /// Add a hand with spread fingers, 15 mm before the measurement volume. It is seen but not measured.
    #[arg(long)]
    hand: bool,
    /// Shift the object from the middle of the measurement volume: right, down and away from the sensor.
    #[arg(
        long,
        value_name = "X,Y,Z mm",
        default_value = "0,0,0",
        value_parser = parse_shift,
        allow_hyphen_values = true
    )]
    shift: [f64; 3],
    /// Mean albedo of the object, 0 to 1. Its darker and brighter parts change by the same factor [default: 0.8].
    #[arg(long, value_name = "SHARE")]
    albedo: Option<f64>,
    /// Gloss of the whole object, 0 to 10. From about 1 on, highlights saturate the camera.
    #[arg(long, value_name = "GLOSS", default_value_t = 0.0)]
    gloss: f64,
    /// Cover the right half of a camera with a dark flap.
    #[arg(long, value_name = "CAMERA", value_parser = one_of(&CameraId::BOTH, CameraId::folder))]
    cover: Option<CameraId>,
    /// Move the object by MM from phase image to phase image, obliquely through the measurement volume. The other
    /// images and the truth show it at rest, at the middle of the sequence.
    #[arg(long, value_name = "MM")]
    motion: Option<f64>,
    /// Rotate the object from phase image to phase image. The default is 0.2° for each millimetre of --motion.
    #[arg(long, value_name = "DEG")]
    turn: Option<f64>,
    /// Number of cycles of phase images with --motion. The default gives 16 images or more.
    #[arg(long, value_name = "C")]
    cycles: Option<usize>,
    /// Share of the time in which the shutter is open, 0 to 1. Above 0, the motion blurs the images.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    blur: f64,
    /// Tremor of the hand on top of --motion: root mean square along each axis, and as many degrees about it.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    tremor: f64,
    /// Phase images of a cycle in each direction, 3 to 16.
    #[arg(long, value_name = "N", default_value_t = 8)]
    steps: usize,
    /// Width and height of the images, pixels.
    #[arg(long, value_name = "WxH", default_value = "640x512", value_parser = parse_size)]
    size: [usize; 2],
    /// Noise of the cameras.
    #[arg(
        long,
        value_name = "LEVEL",
        default_value = "normal",
        value_parser = one_of(&NoiseLevel::ALL, NoiseLevel::name)
    )]
    noise: NoiseLevel,
    /// Format of the images, as in cameras.format. GREY has 8 bits, Y10 to Y16 have 10 to 16. With any other format, such
    /// as RGGB, Y12P, YUYV or RGB3, the files are the bytes that a camera would send. Compressed formats are not
    /// possible.
    #[arg(long, value_name = "FORMAT", default_value = "GREY", value_parser = SourceFormat::from_str)]
    format: SourceFormat,
    /// Grey level of a Bayer mosaic, when the dataset is read. The default is raw.
    #[arg(long, value_name = "LEVEL", value_parser = one_of(&BayerGrey::ALL, BayerGrey::name))]
    bayer: Option<BayerGrey>,
    /// Put the views of both cameras into one image.
    #[arg(long, value_name = "LAYOUT", value_parser = one_of(&StereoLayout::ALL, StereoLayout::name))]
    stereo_layout: Option<StereoLayout>,
    /// Exposure of the cameras, 0.01 to 100. With 1, bright parts in the middle of the volume do not saturate.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    exposure: f64,
    /// Exponent of the projector. 1 is linear.
    #[arg(long, value_name = "G", default_value_t = 1.0)]
    gamma: f64,
    /// Seed of noise and calibration error. The same seed gives the same bytes.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Standard deviation of δ that the calibration error causes. 0 makes the calibration exact.
    #[arg(long, value_name = "RAD", default_value_t = 0.041)]
    sd: f64,
    /// Weight of the errors of k2, p1 and p2 of C2 and projector within --sd, 0 to 10. Every other calibration error
    /// has weight 1.
    #[arg(long, value_name = "FACTOR", default_value_t = 0.0)]
    lens_error: f64,
    /// Depth of the measurement volume, 1 to 300 millimetres. The default is 25, for the nose 45.
    #[arg(long, value_name = "MM")]
    depth: Option<f64>,
    /// Fringe period, projector pixels. The default is that of --rig, else 16.
    #[arg(long, value_name = "PX")]
    period: Option<f64>,
    /// Simulate this rig instead of the built-in one: a calibration file (OpenCV YAML, with --volume), a configuration
    /// of a scanner (.toml), a dataset folder or a recording (.mcap).
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Measurement volume of --rig: xmin,ymin,zmin,xmax,ymax,zmax in the frame of camera 1 (write --volume=-50,…), or a
    /// JSON file as in `fringeflow rig`. A calibration file needs it.
    #[arg(long, value_name = "BOX|FILE", allow_hyphen_values = true)]
    volume: Option<String>,
    /// Unit of lengths in the calibration file of --rig and in --volume. The default is that of the input, else mm.
    #[arg(long, value_name = "UNIT", value_parser = unit())]
    units: Option<Unit>,
    /// Put the centre of the projector here, in the frame of camera 1: right, down and away from the sensor. It is aimed
    /// so that the middle of its image is at the middle of the volume, and its columns stay as upright as possible.
    #[arg(long, value_name = "X,Y,Z mm", value_parser = parse_place, allow_hyphen_values = true)]
    projector_at: Option<[f64; 3]>,
    /// Put the projector in the middle of the base. There every second wrong fringe order passes the test.
    #[arg(long)]
    symmetric: bool,
    /// Project fringes and Gray code along the projector's rows too.
    #[arg(long)]
    two_directions: bool,
    /// Write no Gray-code images.
    #[arg(long)]
    no_gray: bool,
    /// Samples along each side of a pixel, 1 to 4.
    #[arg(long, value_name = "K", default_value_t = 2)]
    supersampling: usize,
    #[command(flatten)]
    calibration: CalibrationArgs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Default rotation of the object per millimetre of motion, degrees.
const DEG_PER_MM: f64 = 0.2;

#[derive(serde::Serialize)]
struct Report<'a> {
    folder: &'a std::path::Path,
    object: &'static str,
    #[serde(flatten)]
    summary: SimulationSummary,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["output", "json", "threads", "simd"],
    choices: &[
        &[
            Mode {
                name: "with --config and a recording (.mcap)",
                is_chosen: |args| args.config.is_some() && has_extension(&args.output, "mcap"),
                options: &["config", "seconds"],
            },
            Mode { name: "with --config and a folder", is_chosen: |args| args.config.is_some(), options: &["config"] },
            Mode {
                name: "with --calibration-board",
                is_chosen: Args::is_calibration,
                options: &[
                    "calibration_board",
                    "views",
                    "board_bend",
                    "board_motion",
                    "defocus",
                    "beat",
                    "ambient",
                    "drawn_rig",
                    "blur",
                    "steps",
                    "size",
                    "noise",
                    "exposure",
                    "gamma",
                    "seed",
                    "depth",
                    "period",
                    "rig",
                    "volume",
                    "units",
                    "projector_at",
                    "symmetric",
                ],
            },
            Mode {
                name: "without --config and --calibration-board",
                is_chosen: |_| true,
                options: &[
                    "object",
                    "board",
                    "board_albedo",
                    "board_tilt",
                    "share",
                    "hand",
                    "shift",
                    "albedo",
                    "gloss",
                    "cover",
                    "motion",
                    "turn",
                    "cycles",
                    "blur",
                    "tremor",
                    "steps",
                    "size",
                    "noise",
                    "format",
                    "stereo_layout",
                    "exposure",
                    "gamma",
                    "seed",
                    "sd",
                    "lens_error",
                    "depth",
                    "period",
                    "rig",
                    "volume",
                    "units",
                    "projector_at",
                    "symmetric",
                    "two_directions",
                    "no_gray",
                    "supersampling",
                ],
            },
        ],
        &[
            Mode {
                name: "with --board-motion",
                is_chosen: |args| args.is_calibration() && args.calibration.board_motion > 0.0,
                options: &["blur"],
            },
            Mode { name: "without --board-motion", is_chosen: Args::is_calibration, options: &[] },
            Mode {
                name: "with --motion",
                is_chosen: |args| args.motion.is_some(),
                options: &["turn", "cycles", "blur", "tremor"],
            },
            Mode { name: "without --motion", is_chosen: |_| true, options: &[] },
        ],
        &[
            Mode {
                name: "with a board outside the volume, as in --board 85",
                is_chosen: |args| matches!(args.board(), Board::Apart(_)),
                options: &["board_albedo", "board_tilt"],
            },
            Mode { name: "without a board outside the volume", is_chosen: |_| true, options: &[] },
        ],
        &[
            Mode {
                name: "with a Bayer mosaic, as in --format RGGB",
                is_chosen: |args| args.format.bayer_order().is_some(),
                options: &["bayer"],
            },
            Mode { name: "without a Bayer mosaic", is_chosen: |_| true, options: &[] },
        ],
        &[
            Mode { name: "with --rig", is_chosen: |args| args.rig.is_some(), options: &["rig", "volume", "units"] },
            Mode {
                name: "with --drawn-rig",
                is_chosen: |args| args.calibration.drawn_rig.is_some(),
                options: &["drawn_rig", "size"],
            },
            Mode {
                name: "without --rig and --drawn-rig",
                is_chosen: |_| true,
                options: &["size", "depth", "symmetric", "drawn_rig"],
            },
        ],
        &[
            Mode { name: "with --drawn-rig", is_chosen: |args| args.calibration.drawn_rig.is_some(), options: &[] },
            Mode { name: "without --drawn-rig", is_chosen: |_| true, options: &["projector_at"] },
        ],
        &[
            Mode { name: "with --projector-at", is_chosen: |args| args.projector_at.is_some(), options: &[] },
            Mode { name: "without --projector-at", is_chosen: |_| true, options: &["symmetric"] },
        ],
        &[
            Mode { name: "with --sd 0", is_chosen: |args| args.sd <= 0.0, options: &[] },
            Mode { name: "with --sd above 0", is_chosen: |_| true, options: &["lens_error"] },
        ],
    ],
};

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        if let Some(config) = self.config.as_ref().filter(|_| has_extension(&self.output, "mcap")) {
            return recording::record(config, &self.output, self.seconds, self.json);
        }
        check_new(&self.output)?;
        if let Some(config) = &self.config {
            let options = ConfiguredSimulation::read(config)?.dataset_options(config)?;
            return self.write(&Simulation::new(options)?);
        }
        if let Some(board) = &self.calibration.calibration_board {
            return self.write_calibration_set(board);
        }
        let staging = Staging {
            shift_mm: self.shift,
            covered: self.cover,
            share_percent: self.share,
            albedo: self.albedo,
            gloss: self.gloss,
            hand: self.hand,
            motion: self.motion(),
        };
        self.write(&Simulation::staged(self.options()?, staging)?)
    }

    fn is_calibration(&self) -> bool {
        self.calibration.calibration_board.is_some()
    }

    /// Takes the images, writes the dataset, and prints its figures.
    fn write(&self, simulation: &Simulation) -> Result<(), Failure> {
        let bar = progress::bar("taking images", simulation.images().len() as u64);
        simulation.write(&self.output, || bar.inc(1))?;
        bar.finish_and_clear();
        self.print(simulation)
    }

    /// The board that the options describe.
    fn board(&self) -> Board {
        match self.board.unwrap_or(self.object.usual_board()) {
            Board::Apart(apart) => Board::Apart(BoardApart {
                albedo: self.board_albedo.unwrap_or(apart.albedo),
                tilt_deg: self.board_tilt.unwrap_or(apart.tilt_deg),
                ..apart
            }),
            other => other,
        }
    }

    fn options(&self) -> Result<SimulationOptions, Failure> {
        Ok(SimulationOptions {
            object: self.object,
            board: self.board(),
            rig: self.rig_options()?,
            steps: self.steps,
            two_directions: self.two_directions,
            gray: !self.no_gray,
            white_and_black: true,
            noise: self.noise,
            images: DeviceImages::new(self.format, self.bayer, self.stereo_layout).map_err(SimulationError::from)?,
            gamma: self.gamma,
            exposure: self.exposure,
            supersampling: self.supersampling,
            seed: self.seed,
            binning: 1,
        })
    }

    /// The built-in rig, or the rig of --rig.
    fn rig_options(&self) -> Result<RigOptions, Failure> {
        let usual = RigOptions::usual(self.depth.map_or(self.object.usual_depth_m(), |mm| mm * 1e-3));
        let options = RigOptions {
            arrangement: if self.symmetric { Arrangement::SYMMETRIC } else { Arrangement::TABLE_TOP },
            projector_at_mm: self.projector_at,
            size_px: self.size,
            period_px: self.period.unwrap_or(usual.period_px),
            sd_rad: self.sd,
            lens_error: self.lens_error,
            seed: self.seed,
            ..usual
        };
        let Some(file) = &self.rig else { return Ok(options) };
        let calibrated = CalibratedRig::read(file, self.units, self.volume.as_deref())?;
        let volume = calibrated.required_volume(file)?;
        let pattern = match calibrated.measurement {
            Some((pattern, _)) => FringePattern { period_px: self.period.unwrap_or(pattern.period_px), ..pattern },
            None => options.pattern(),
        };
        Ok(options.with_given(GivenRig { rig: calibrated.rig, volume, pattern }))
    }

    fn motion(&self) -> Option<MotionOptions> {
        self.motion.map(|mm_per_image| MotionOptions {
            mm_per_image,
            deg_per_image: self.turn.unwrap_or(DEG_PER_MM * mm_per_image),
            cycles: self.cycles.unwrap_or(MotionOptions::usual_cycles(self.steps)),
            blur: self.blur,
            tremor: self.tremor,
            seed: self.seed,
        })
    }

    fn print(&self, simulation: &Simulation) -> Result<(), Failure> {
        let mut out = std::io::stdout().lock();
        let s = simulation.summary();
        if self.json {
            let report = Report { folder: &self.output, object: simulation.options().object.name(), summary: s };
            serde_json::to_writer(&mut out, &report).map_err(std::io::Error::from)?;
            writeln!(out)?;
        } else {
            writeln!(
                out,
                "{}: {} images per camera, {} measurable pixels\n\
                 n {:.2} periods on a segment, sd of δ {:.4} rad, efc {:.3}, projector at {:.2} of the base\n\
                 epipolar error of the calibration {:.3} px rms",
                self.output.display(),
                s.images,
                s.measurable,
                s.mean_periods,
                s.calibration_error.delta_rms,
                s.expected_false_candidates,
                s.projector_place,
                s.calibration_error.epi_rms,
            )?;
        }
        Ok(())
    }
}

/// Parses a shift written as `X,Y,Z`.
fn parse_shift(text: &str) -> Result<[f64; 3], String> {
    parse_three(text)
        .ok_or_else(|| format!("{text:?} is not a shift; write three lengths in millimetres as in 30,0,-5"))
}

/// Parses a place written as `X,Y,Z`.
fn parse_place(text: &str) -> Result<[f64; 3], String> {
    let wrong = || format!("{text:?} is not a place; write three lengths in millimetres as in 150,-60,0");
    parse_three(text).ok_or_else(wrong)
}

fn parse_three(text: &str) -> Option<[f64; 3]> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse()).collect();
    numbers.ok()?.try_into().ok()
}

impl From<SimulatedDatasetError> for Failure {
    fn from(error: SimulatedDatasetError) -> Self {
        match error {
            SimulatedDatasetError::Simulation(error) => error.into(),
            error => Self::unusable(error),
        }
    }
}

impl From<SimulationError> for Failure {
    fn from(error: SimulationError) -> Self {
        match error {
            SimulationError::Dataset(error) => Self::Dataset(error),
            SimulationError::Write(error) => Self::Write(error),
            error => Self::unusable(error),
        }
    }
}
