//! A scanner that is moved by hand over an object, without its images.
//!
//! In: options. Out: the texts that the configuration of a real scanner would contain ([`SetupText`]: calibration,
//! pattern, measurement volume), and the scene in front of the cameras for each pose of the sweep. It is cheap, since
//! no ray is traced.

use fringeflow::calibration::calibration_text;
use fringeflow::geometry::{Point3, Pose, Readout};
use fringeflow_base::grey::PixelFormat;
use fringeflow_dataset::{CameraId, DatasetDescription, FringeSequence, SetupText};
use fringeflow_patterns::{Direction, Pattern, even_shifts_rad};

use super::object::Object;
use super::scene::volume_from_object;
use super::sensor::{ImageSeed, NoiseLevel, Sensor};
use super::sequence::{UNIT, remarks};
use super::solid::MM_PER_M;
use super::sweep::{Sweep, SweepOptions, SweepSpeed};
use super::view::MAX_SUPERSAMPLING;
use super::{Board, RigOptions, Scene, SimulationError, VirtualRig, check_range};

/// Options of a virtual scanner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualScannerOptions {
    /// The object.
    pub object: Object,
    /// The board.
    pub board: Board,
    /// The rig, with the seed of its calibration error.
    pub rig: RigOptions,
    /// Phase shifts, 3 to 16.
    pub steps: usize,
    /// Noise of the cameras.
    pub noise: NoiseLevel,
    /// Format of the images.
    pub format: PixelFormat,
    /// Exponent of the projector, 1 for a linear one.
    pub gamma: f64,
    /// Exposure, relative to the default, at which nothing saturates.
    pub exposure: f64,
    /// Samples along each side of a pixel, 1 to 4.
    pub supersampling: usize,
    /// The motion of the scanner.
    pub sweep: SweepOptions,
    /// Seed of the noise.
    pub seed: u64,
}

impl VirtualScannerOptions {
    /// The default options for an object.
    #[must_use]
    pub fn usual(object: Object) -> Self {
        Self {
            object,
            board: Board::Visible,
            rig: RigOptions::usual(object.usual_depth_m()),
            steps: 4,
            noise: NoiseLevel::Normal,
            format: PixelFormat::Grey,
            gamma: 1.0,
            exposure: 1.0,
            supersampling: 1,
            sweep: SweepOptions::default(),
            seed: 1,
        }
    }
}

/// A scanner and its sweep over an object.
#[derive(Clone, Debug, PartialEq)]
pub struct VirtualScanner {
    options: VirtualScannerOptions,
    rig: VirtualRig,
    sweep: Sweep,
}

impl VirtualScanner {
    /// Builds the rig and plans the sweep.
    ///
    /// # Errors
    /// [`SimulationError`]: an option is out of range, the number of poses is not a multiple of the steps, or the sweep
    /// leaves the measurement volume.
    pub fn new(options: VirtualScannerOptions) -> Result<Self, SimulationError> {
        check_range("the number of steps", options.steps as f64, 3.0, 16.0, "images")?;
        check_range("gamma", options.gamma, 0.2, 5.0, "")?;
        check_range("exposure", options.exposure, 0.01, 100.0, "")?;
        check_range("supersampling", options.supersampling as f64, 1.0, MAX_SUPERSAMPLING as f64, "samples per side")?;
        let sweep = Sweep::new(options.sweep)?;
        let (poses, steps) = (sweep.poses(), options.steps);
        if !poses.is_multiple_of(steps) {
            return Err(SimulationError::PosesAndSteps { poses, steps });
        }
        let scanner = Self { options, rig: VirtualRig::new(&options.rig)?, sweep };
        scanner.check_volume()?;
        options.board.check()?;
        scanner.scene().check_board(&scanner.rig.exact)?;
        Ok(scanner)
    }

    /// Its options.
    #[must_use]
    pub fn options(&self) -> &VirtualScannerOptions {
        &self.options
    }

    /// The rig, exact and calibrated.
    #[must_use]
    pub fn rig(&self) -> &VirtualRig {
        &self.rig
    }

    /// Its sweep.
    #[must_use]
    pub fn sweep(&self) -> &Sweep {
        &self.sweep
    }

    /// Speed of the object in front of the cameras.
    #[must_use]
    pub fn speed(&self) -> SweepSpeed {
        self.sweep.speed(&self.corners())
    }

    /// Returns the texts that describe rig, pattern and measurement volume, as a real scanner has them.
    ///
    /// # Errors
    /// [`SimulationError::Description`].
    pub fn setup_text(&self) -> Result<SetupText, SimulationError> {
        let description = self.description().text()?;
        Ok(SetupText { description, calibration: calibration_text(&self.rig.calibrated, UNIT) })
    }

    /// Returns the description of the scanner, without the calibration.
    #[must_use]
    pub fn description(&self) -> DatasetDescription {
        let options = &self.options;
        DatasetDescription {
            name: options.object.name().to_owned(),
            unit: UNIT,
            readout: Readout::whole(options.rig.size_px),
            pixel_format: options.format,
            source: None,
            steps: options.steps,
            sequence: FringeSequence {
                pattern: self.rig.columns,
                shifts_rad: even_shifts_rad(options.steps),
                gray: None,
            },
            second_direction: None,
            volume: self.rig.volume,
            exact_cam1_from_volume: Some(*self.rig.exact_volume.cam1_from_volume()),
            motion: None,
            remarks: remarks(&self.rig, options.noise, options.format, options.gamma, options.seed),
        }
    }

    /// Pose of the frame of the object in that of the exact C1 at a pose of the sweep, metres.
    #[must_use]
    pub fn cam1_from_object(&self, pose: usize) -> Pose {
        let resting = volume_from_object(self.options.object);
        self.rig.exact_volume.cam1_from_volume() * self.sweep.pose(pose) * resting
    }

    /// The scene at rest; [`Scene::at`] moves it to a pose.
    pub(super) fn scene(&self) -> Scene {
        Scene::from_object(self.options.object, self.options.board, &self.rig.exact_volume)
    }

    /// The cameras.
    pub(super) fn sensor(&self) -> Sensor {
        let options = &self.options;
        let usual = Sensor::exposed(options.noise.noise(), options.gamma);
        let gain = usual.gain * options.exposure / self.rig.light(&options.rig);
        Sensor { format: options.format, gain, ..usual }
    }

    /// The pattern of a step.
    pub(super) fn projected(&self, step: usize) -> Pattern {
        let shift_rad = even_shifts_rad(self.options.steps).get(step).copied().unwrap_or_default();
        Pattern::Fringes { direction: Direction::Columns, pattern: self.rig.columns, shift_rad }
    }

    /// Seeds of the image at a pose.
    pub(super) fn image_seed(&self, camera: CameraId, pose: usize) -> ImageSeed {
        ImageSeed { seed: self.options.seed, camera: camera as u8, image: pose as u32 }
    }

    /// Corners of the box of the object at rest, in the frame of the measurement volume, metres.
    fn corners(&self) -> [Point3; 8] {
        let object = self.options.object;
        let (min, max) = object.solid().bounds_mm();
        std::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { min[axis] } else { max[axis] };
            volume_from_object(object) * (Point3::new(pick(0), pick(1), pick(2)) / MM_PER_M)
        })
    }

    fn check_volume(&self) -> Result<(), SimulationError> {
        let (volume, corners) = (&self.rig.exact_volume, self.corners());
        for number in 0..self.sweep.poses() {
            let pose = self.sweep.pose(number);
            let excess = |corner: &Point3| {
                let corner = pose * corner;
                let outside = |axis: usize| (corner[axis] - volume.max()[axis]).max(volume.min()[axis] - corner[axis]);
                outside(0).max(outside(1)).max(outside(2))
            };
            let excess_m = corners.iter().map(excess).fold(f64::NEG_INFINITY, f64::max);
            if excess_m * MM_PER_M > self.options.sweep.outside_mm {
                return Err(SimulationError::OutOfVolume { pose: number, excess_mm: excess_m * MM_PER_M });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use fringeflow_dataset::Setup;

    /// A small and fast scanner.
    pub(in crate::simulation) fn options() -> VirtualScannerOptions {
        let usual = VirtualScannerOptions::usual(Object::Tooth);
        let rig = RigOptions { size_px: [80, 64], seed: 3, ..usual.rig };
        VirtualScannerOptions { rig, sweep: SweepOptions { poses: 24, ..usual.sweep }, seed: 9, ..usual }
    }

    #[test]
    fn parsing_its_texts_gives_its_rig() {
        let scanner = VirtualScanner::new(options()).unwrap();
        let setup = Setup::parse(scanner.setup_text().unwrap(), None).unwrap();
        let rig = scanner.rig();
        let off = (setup.rig.cam2_from_cam1.to_homogeneous() - rig.calibrated.cam2_from_cam1.to_homogeneous()).amax();
        assert!(off < 1e-12, "pose of C2 {off} off");
        assert_eq!(setup.rig.cam1, rig.calibrated.cam1);
        assert_eq!((setup.steps, setup.sequence.shifts_rad.len(), setup.image_size_px), (4, 4, [80, 64]));
        let centre = |pose: &Pose| pose.translation.vector;
        let (volume, exact) = (setup.volume.unwrap(), setup.exact_cam1_from_volume.unwrap());
        assert!((centre(volume.cam1_from_volume()) - centre(rig.volume.cam1_from_volume())).norm() < 1e-12);
        assert!((centre(&exact) - centre(rig.exact_volume.cam1_from_volume())).norm() < 1e-12);
    }

    #[test]
    fn the_default_sweep_keeps_all_objects_that_fit_in_their_volumes() {
        for object in Object::ALL.into_iter().filter(|object| object.fits_volume()) {
            let rig = RigOptions { depth_m: object.usual_depth_m(), ..options().rig };
            let options = VirtualScannerOptions { object, rig, sweep: SweepOptions::default(), ..options() };
            let speed = VirtualScanner::new(options).unwrap().speed();
            assert!((0.024..0.036).contains(&speed.mean_mm), "{object:?}: {speed:?}");
        }
    }

    #[test]
    fn a_long_sweep_may_move_parts_of_the_object_out_of_the_volume() {
        let object = Object::Elephant;
        let (travel_mm, turn_deg) = ([20.0, 8.0, 3.0], [10.0, 15.0, 8.0]);
        let sweep = SweepOptions { poses: 1200, travel_mm, turn_deg, ..SweepOptions::default() };
        let rig = RigOptions { depth_m: 0.06, ..options().rig };
        let scanner = |outside_mm| {
            let sweep = SweepOptions { outside_mm, ..sweep };
            VirtualScanner::new(VirtualScannerOptions { object, rig, sweep, ..options() })
        };
        let speed = scanner(20.0).unwrap().speed();
        assert!((0.1..0.25).contains(&speed.max_mm), "{speed:?}");
        assert!(scanner(5.0).unwrap_err().to_string().contains("outside_mm"));
    }

    #[test]
    fn the_object_is_where_the_sweep_moves_it() {
        let scanner = VirtualScanner::new(options()).unwrap();
        let resting = scanner.scene();
        let centre = Point3::new(0.0, 0.0, 0.01);
        let shift = |pose| (scanner.cam1_from_object(pose) * centre - resting.cam1_from_object() * centre).norm();
        assert!((0.9e-3..1.2e-3).contains(&shift(0)) && shift(0) == shift(24), "{} m", shift(0));
        let across = (scanner.cam1_from_object(12) * centre - scanner.cam1_from_object(0) * centre).norm();
        assert!((1.8e-3..2.2e-3).contains(&across), "{across} m");
    }

    #[test]
    fn invalid_sweeps_are_refused() {
        let usual = options();
        let refused = |options| VirtualScanner::new(options).unwrap_err().to_string();
        let poses = |poses| VirtualScannerOptions { sweep: SweepOptions { poses, ..usual.sweep }, ..usual };
        assert!(refused(poses(26)).contains("use 24 or 28 poses"), "{}", refused(poses(26)));
        let far = SweepOptions { travel_mm: [40.0, 0.0, 0.0], ..usual.sweep };
        let refused = refused(VirtualScannerOptions { sweep: far, ..usual });
        assert!(refused.contains("pose 0 of the sweep moves the object 3."), "{refused}");
    }
}
