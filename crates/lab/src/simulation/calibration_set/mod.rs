//! The images of a calibration with exact truth: a board in the hand, all patterns of the projector, both cameras.
//!
//! ```text
//! FOLDER/patterns.toml                what the projector shows
//! FOLDER/view_00/cam1/000.png         the number is that of the image in patterns.toml
//! FOLDER/view_00/cam2/000.png
//! FOLDER/exact.yml, volume.json       the rig, and its measurement volume
//! FOLDER/truth.json                   settings, the pose of the board in each view, where each device sees its features
//! ```
//!
//! In: a board, a rig and settings. Out: the folder. Rays are traced once per view and camera; all images follow from
//! that, unless the board moves meanwhile. Cost: about half a second of a core per view and camera, and 20 ms an image,
//! at 640 × 512 pixels. Results do not depend on the number of threads.

mod image;
mod light;
mod poses;
mod surface;
mod truth;

use std::f64::consts::TAU;
use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::path::Path;

use nalgebra::{Translation3, UnitQuaternion};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use fringeflow::calibration::{Unit, calibration_text};
use fringeflow::geometry::{Point3, Pose, Vector3};
use fringeflow_base::atomic_file::{WriteError, WriteProblem};
use fringeflow_base::new_folder::NewFolder;
use fringeflow_base::png_encoding;
use fringeflow_board::Board;
use fringeflow_dataset::CameraId;
use fringeflow_patterns::{FringeCycle, PATTERNS_FILE, PatternSet, even_shifts_rad};

use super::sensor::{ImageSeed, NoiseLevel, Sensor};
use super::solid::MM_PER_M;
use super::{RigOptions, SimulationError, VirtualRig, check_range};

use image::Exposure;
use light::Eye;
use surface::Surface;

/// Settings of the images of a calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationSetOptions {
    /// The board.
    pub board: Board,
    /// The rig. Its calibration error does not count.
    pub rig: RigOptions,
    /// Number of views.
    pub views: usize,
    /// Phase shifts of the fringes.
    pub steps: usize,
    /// Noise of the cameras.
    pub noise: NoiseLevel,
    /// Exponent of the projector.
    pub gamma: f64,
    /// Exposure; 1 keeps white print in the middle of the volume at 200 grey levels.
    pub exposure: f64,
    /// Ambient light relative to that of the projector.
    pub ambient: f64,
    /// Height of the bend of the board, from its lowest to its highest point, millimetres.
    pub bend_mm: f64,
    /// Blur of cameras and projector (standard deviation, their pixels) at a tenth of the distance off the focus.
    pub defocus_px: f64,
    /// Share by which the brightness of the images beats.
    pub beat: f64,
    /// Way of the board from the first to the last image of a view, millimetres. It turns by 0.1° per millimetre.
    pub motion_mm: f64,
    /// Share of the time in which the shutter is open, 0 to 1: how much the motion blurs.
    pub blur: f64,
    /// Seed of poses, bend, motion and noise.
    pub seed: u64,
}

/// Figures of a simulated calibration.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct CalibrationSetSummary {
    /// Views.
    pub views: usize,
    /// Images of a view and camera.
    pub images: usize,
    /// Mean number of features of the board in an image of C1, of C2, and of the projector.
    pub features_seen: [f64; 3],
}

/// Most views.
const MOST_VIEWS: usize = 100;
/// Turn of the board per millimetre of motion, rad.
const TURN_RAD_PER_MM: f64 = 0.001_745;
/// Periods of the beat per image, which no number of steps divides.
const BEATS_PER_IMAGE: f64 = 0.370_8;
/// Poses in an exposure of a moving board.
const POSES_IN_EXPOSURE: usize = 3;

/// A simulated calibration, ready to be written.
pub struct CalibrationSet {
    options: CalibrationSetOptions,
    rig: VirtualRig,
    patterns: PatternSet,
    /// Bend of the board, and the poses `cam1_from_board` of the first image of each view.
    bend: [f64; 3],
    poses: Vec<Pose>,
}

impl CalibrationSet {
    /// Checks the settings and draws the poses.
    ///
    /// # Errors
    /// A setting is out of range, or cameras and projector cannot see the board together.
    pub fn new(options: CalibrationSetOptions) -> Result<Self, SimulationError> {
        check_range("the number of views", options.views as f64, 1.0, MOST_VIEWS as f64, "")?;
        check_range("the bend of the board", options.bend_mm, 0.0, 100.0, "mm")?;
        check_range("the defocus", options.defocus_px, 0.0, 20.0, "px")?;
        check_range("the beat", options.beat, 0.0, 1.0, "")?;
        check_range("the motion of the board", options.motion_mm, 0.0, 100.0, "mm")?;
        check_range("blur", options.blur, 0.0, 1.0, "")?;
        check_range("the ambient light", options.ambient, 0.0, 10.0, "")?;
        check_range("exposure", options.exposure, 0.01, 100.0, "")?;
        check_range("gamma", options.gamma, 0.2, 5.0, "")?;
        let rig = VirtualRig::new(&RigOptions { sd_rad: 0.0, ..options.rig })?;
        let projector_px = [rig.exact.projector.width_px(), rig.exact.projector.height_px()];
        let cycle = FringeCycle { pattern: rig.columns, shifts_rad: even_shifts_rad(options.steps) };
        let patterns = PatternSet::calibration(projector_px, &cycle)?;
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        let bend = [0, 1, 2].map(|_| 2.0 * rng.random::<f64>() - 1.0);
        let surface = Surface::new(&options.board, options.bend_mm, bend);
        let poses = poses::draw(&rig.exact, &rig.exact_volume, &surface, options.views, options.seed)?;
        Ok(Self { options, rig, patterns, bend, poses })
    }

    /// Number of images of all views and cameras.
    #[must_use]
    pub fn images(&self) -> usize {
        2 * self.options.views * self.patterns.images.len()
    }

    /// The exact rig and its measurement volume.
    #[must_use]
    pub fn rig(&self) -> &VirtualRig {
        &self.rig
    }

    /// Takes the images and writes the folder, which must be new or empty and appears when it is complete. `done` is
    /// called after each image.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub fn write(&self, folder: &Path, done: impl Fn() + Sync) -> Result<CalibrationSetSummary, SimulationError> {
        let fail = |e: io::Error| match e.kind() {
            io::ErrorKind::AlreadyExists => WriteError { path: folder.to_owned(), problem: WriteProblem::Exists },
            _ => WriteError { path: folder.to_owned(), problem: WriteProblem::Io(e) },
        };
        let new = NewFolder::begin(folder).map_err(fail)?;
        let truth = truth::Truth::new(self);
        std::fs::write(new.path().join(PATTERNS_FILE), self.patterns.to_toml()).map_err(fail)?;
        std::fs::write(new.path().join("exact.yml"), calibration_text(&self.rig.exact, Unit::Millimetre))
            .map_err(fail)?;
        std::fs::write(new.path().join("volume.json"), truth.volume_text()?).map_err(fail)?;
        std::fs::write(new.path().join("truth.json"), truth.text()?).map_err(fail)?;
        for view in 0..self.poses.len() {
            for camera in CameraId::BOTH {
                let images = new.path().join(format!("view_{view:02}")).join(camera.folder());
                std::fs::create_dir_all(&images)
                    .and_then(|()| self.take(view, camera, &images, &done))
                    .map_err(fail)?;
            }
        }
        new.finish().map_err(fail)?;
        Ok(truth.summary(self.patterns.images.len()))
    }

    fn surface(&self) -> Surface<'_> {
        Surface::new(&self.options.board, self.options.bend_mm, self.bend)
    }

    /// The pose of the board in a view, `place` images after the first one.
    fn pose(&self, view: usize, place: f64) -> Pose {
        let last = (self.patterns.images.len() - 1).max(1) as f64;
        let way_mm = self.options.motion_mm * place / last;
        let mut rng = ChaCha8Rng::seed_from_u64(self.options.seed.rotate_left(32) ^ view as u64);
        let mut direction = || Vector3::from([0, 1, 2].map(|_| 2.0 * rng.random::<f64>() - 1.0)).normalize();
        let (along, axis) = (direction(), direction());
        let moved = Translation3::from(along * (way_mm / MM_PER_M));
        self.poses[view] * Pose::from_parts(moved, UnitQuaternion::new(axis * (way_mm * TURN_RAD_PER_MM)))
    }

    /// Poses during the exposure of an image.
    fn exposed_poses(&self, view: usize, image: usize) -> Vec<Pose> {
        let n = if self.options.blur > 0.0 { POSES_IN_EXPOSURE } else { 1 };
        let share = |k: usize| (k as f64 + 0.5) / n as f64 - 0.5;
        (0..n).map(|k| self.pose(view, image as f64 + self.options.blur * share(k))).collect()
    }

    /// Takes the images of a view and a camera.
    fn take(&self, view: usize, camera: CameraId, folder: &Path, done: &(impl Fn() + Sync)) -> io::Result<()> {
        let (options, exact, surface) = (&self.options, &self.rig.exact, self.surface());
        let middle = self.rig.exact_volume.cam1_from_volume() * Point3::origin();
        let lens = if camera == CameraId::Cam1 { &exact.cam1 } else { &exact.cam2 };
        let in_camera = if camera == CameraId::Cam1 { middle } else { exact.cam2_from_cam1 * middle };
        let focus_m = [in_camera.z, (exact.projector_from_cam1 * middle).z];
        let eye = Eye { rig: exact, surface: &surface, camera, focus_m, defocus_px: options.defocus_px };
        let size_px = [lens.width_px(), lens.height_px()];
        let usual = Sensor::exposed(options.noise.noise(), options.gamma);
        let gain = usual.gain * options.exposure / self.rig.light(&options.rig);
        let sensor = Sensor { gain, ambient: options.ambient, ..usual };
        let seed = ImageSeed { seed: options.seed, camera: camera as u8, image: 0 };
        let sensitivity = sensor.sensitivity(size_px, seed);
        let still = (options.motion_mm == 0.0).then(|| eye.light(&[self.pose(view, 0.0)]));
        self.patterns.images.par_iter().enumerate().try_for_each(|(index, pattern)| {
            let moved = still.is_none().then(|| eye.light(&self.exposed_poses(view, index)));
            let light = moved.as_ref().or(still.as_ref()).map_or(&[][..], Vec::as_slice);
            let lamp = 1.0 + options.beat * (TAU * (BEATS_PER_IMAGE * index as f64 + 0.618 * view as f64)).sin();
            let number = ((view * 2 + camera as usize) * self.patterns.images.len() + index) as u64;
            let exposure = Exposure { sensor: &sensor, sensitivity: &sensitivity, lamp, seed: [number, options.seed] };
            let pixels = exposure.image(light, size_px[0], pattern);
            let mut out = BufWriter::new(File::create(folder.join(format!("{index:03}.png")))?);
            png_encoding::encode(&mut out, size_px, png::ColorType::Grayscale, png::BitDepth::Eight, &pixels)?;
            out.flush()?;
            done();
            Ok(())
        })
    }
}

#[cfg(test)]
mod tests;
