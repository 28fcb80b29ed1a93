//! The virtual scanner: the images that a real scanner would take, and their truth.
//!
//! ```text
//!  RigOptions ─► VirtualRig (exact, calibrated, volume) ─┐
//!                                                        ├─► View of C1, of C2 ─► image of any Pattern
//!  Object, Board ─► Scene (pose relative to C1) ─────────┘   truth
//!  MotionOptions ─► pose of the object in every phase image of a Simulation
//!  Board of a calibration, VirtualRig or drawn_rig ─► CalibrationSet: images and truth of a calibration
//!  Sweep ─► pose of the scene, image by image (VirtualScanner) ─► PoseImages ─► ImageLoop: images of a moving scanner
//! ```
//!
//! In: a few options. Out: a [`View`] per camera and pose of the scene, from which [`Sensor::image`] computes the image
//! of any pattern; or, with [`Simulation`], a whole dataset folder. Rays are traced once per pose: a view of 640 × 512
//! pixels costs one to four seconds of one core, depending on the object. Objects, sizes and parameters are those of
//! section 3 of the paper. There are also harder ones: see [`Object`] and [`Staging`].
//!
//! Results depend only on options and seeds, not on the number of threads.

mod alignment;
mod board;
mod calibration_error;
mod calibration_set;
mod coated_solid;
mod colour_filter;
mod configured;
mod covered_camera;
mod device;
mod drawn_rig;
mod faults;
mod hand;
mod image_loop;
mod image_share;
mod loop_file;
mod motion;
mod normal;
mod object;
mod packing;
mod pose_images;
mod projector_place;
mod ray;
mod rig;
mod scaled_solid;
mod scene;
mod schedule;
mod sensor;
mod sequence;
mod smooth_surface;
mod solid;
mod staging;
mod sweep;
mod trace;
mod tremor;
mod truth;
mod view;
mod virtual_scanner;

pub use board::{Board, BoardApart};
pub use calibration_error::CalibrationDeviation;
pub use calibration_set::{CalibrationSet, CalibrationSetOptions, CalibrationSetSummary};
pub use colour_filter::{Colour, ColourFilter};
pub use configured::{ConfiguredScanner, read_configuration, read_virtual_configuration, setup_text};
pub use drawn_rig::drawn_rig;
pub use faults::{FaultOptions, Faults, ImageFault};
pub use image_loop::ImageLoop;
pub use loop_file::LoopFileProblem;
pub use motion::MotionOptions;
pub use object::Object;
pub use pose_images::PoseImages;
pub use rig::{Arrangement, GivenRig, RigOptions, VirtualRig};
pub use scene::{Scene, Surface};
pub use schedule::{Schedule, Tick};
pub use sensor::{ImageSeed, Noise, NoiseLevel, Sensor};
pub use sequence::{Simulation, SimulationOptions, SimulationSummary};
pub use solid::{Material, PointMm, Solid};
pub use staging::Staging;
pub use sweep::{Sweep, SweepOptions, SweepSpeed};
pub use trace::Hit;
pub use truth::truth;
pub use view::{Centre, Sample, View};
pub use virtual_scanner::{VirtualScanner, VirtualScannerOptions};

#[cfg(test)]
pub(crate) use normal::standard_normal;

use fringeflow::geometry::VolumeError;
use fringeflow_base::atomic_file::WriteError;
use fringeflow_dataset::DatasetError;
use fringeflow_patterns::PatternProblem;
use fringeflow_pixels::{DeviceImagesError, SourceFormat};

/// Errors of a simulation.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// An option is out of its range.
    #[error("{what} is {}; it must lie between {min} and {}", in_unit(*value, unit), in_unit(*max, unit))]
    Range {
        /// Name of the option.
        what: &'static str,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
    },
    /// There is no object with this name.
    #[error("object {name:?} is not known; use {}", Object::names())]
    UnknownObject {
        /// The name.
        name: String,
    },
    /// There is no noise level with this name.
    #[error("noise level {name:?} is not known; use none, low, normal or high")]
    UnknownNoise {
        /// The name.
        name: String,
    },
    /// Images of this format or arrangement cannot have the chosen size.
    #[error(transparent)]
    Images(#[from] DeviceImagesError),
    /// The images would have to be compressed.
    #[error("images in {format} cannot be simulated, because this program does not compress images")]
    Compressed {
        /// The format.
        format: SourceFormat,
    },
    /// There is no board with this name.
    #[error("board {name:?} is not known; use none, dark, visible, behind, or a distance from the volume in mm")]
    UnknownBoard {
        /// The name.
        name: String,
    },
    /// A board apart from the measurement volume is too close to it.
    #[error("the board's distance is {distance_mm} mm; keep at least {least_mm} mm from the volume, or use visible")]
    BoardGap {
        /// Its distance, millimetres.
        distance_mm: f64,
        /// The smallest distance, millimetres.
        least_mm: f64,
    },
    /// A camera or the projector is too close to the front of the board, or behind it.
    #[error(
        "the board leaves only {sight_mm:.0} mm to a camera or the projector; move it closer to the volume, or tilt \
         it less"
    )]
    BoardAtDevice {
        /// Distance between the board and the nearest device, millimetres; negative if the device is behind the board.
        sight_mm: f64,
    },
    /// The projector does not stand before the measurement volume.
    #[error(
        "the projector at {}, {}, {} mm stands {gap_mm:.0} mm before the measurement volume; keep at least {least_mm} \
         mm, with a smaller Z",
        at_mm[0], at_mm[1], at_mm[2]
    )]
    ProjectorAtVolume {
        /// Its place in the frame of C1, millimetres.
        at_mm: [f64; 3],
        /// Its distance from the near face of the volume, millimetres; negative behind it.
        gap_mm: f64,
        /// The smallest distance, millimetres.
        least_mm: f64,
    },
    /// The projector would look along its columns.
    #[error(
        "the projector at {}, {}, {} mm would look at the volume along its own columns, which then have no direction; \
         move it out of their line, with another X or Y",
        at_mm[0], at_mm[1], at_mm[2]
    )]
    ProjectorAlongColumns {
        /// Its place in the frame of C1, millimetres.
        at_mm: [f64; 3],
    },
    /// No size of the object fills this share of the image.
    #[error(
        "no size of the {object} fills {percent} % of the image, the last one tried fills {found_percent:.1} %; use \
         another share"
    )]
    Share {
        /// The object.
        object: &'static str,
        /// The wanted share, percent.
        percent: f64,
        /// The share at the last size tried, percent.
        found_percent: f64,
    },
    /// No calibration error causes the wanted sd of δ.
    #[error("no calibration error of this rig causes an sd of δ of {sd_rad} rad; use a smaller sd")]
    NoCalibration {
        /// The wanted sd, rad.
        sd_rad: f64,
    },
    /// The number of poses of a sweep is not a multiple of the steps.
    #[error(
        "the sweep has {poses} poses, which is not a multiple of {steps} steps; use {fewer} or {more} poses",
        fewer = poses / steps * steps,
        more = (poses / steps + 1) * steps
    )]
    PosesAndSteps {
        /// Number of poses.
        poses: usize,
        /// Phase shifts.
        steps: usize,
    },
    /// The sweep leaves the measurement volume.
    #[error(
        "pose {pose} of the sweep moves the object {excess_mm:.2} mm out of the measurement volume; use less travel or \
         rotation, or a deeper volume, or allow it (outside_mm)"
    )]
    OutOfVolume {
        /// First pose outside.
        pose: usize,
        /// Distance outside, millimetres.
        excess_mm: f64,
    },
    /// A description cannot be written as JSON.
    #[error("cannot write the description of the virtual scanner: {0}")]
    Description(#[from] serde_json::Error),
    /// The measurement volume is invalid.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// No pose of the calibration board was found that shows enough of it.
    #[error(
        "view {view}: no pose of {board} was found that both cameras see and the projector lights; use a board of about \
         the size of the measurement volume"
    )]
    BoardUnseen {
        /// The board.
        board: String,
        /// Number of the view.
        view: usize,
    },
    /// The patterns of the projector are not possible.
    #[error(transparent)]
    Patterns(#[from] PatternProblem),
    /// A file or folder could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The dataset could not be written.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
}

/// Formats a value with its unit, if it has one.
fn in_unit(value: f64, unit: &str) -> String {
    format!("{value} {unit}").trim_end().to_owned()
}

fn check_range(what: &'static str, value: f64, min: f64, max: f64, unit: &'static str) -> Result<(), SimulationError> {
    if value >= min && value <= max { Ok(()) } else { Err(SimulationError::Range { what, value, unit, min, max }) }
}
