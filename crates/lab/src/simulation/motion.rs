//! An object that moves while a fringe sequence is taken: a steady motion, optionally with the tremor of a hand.
//!
//! In: the motion per image. Out: the pose of the object at any time, counted in images, relative to its pose in the
//! middle of the sequence; and the view of a camera, with each image at its own pose. Moving the object is equivalent
//! to moving the cameras.
//!
//! Rays are traced again for each image. The parts of a blurred image are tracked from the view of its middle where
//! that is exact.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Translation3, UnitQuaternion};

use fringeflow::geometry::{Pose, Vector3};
use fringeflow_dataset::{CameraId, Motion};

use super::tremor::Tremor;
use super::view::View;
use super::{Scene, SimulationError, VirtualRig, check_range};

/// Motion of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionOptions {
    /// Translation per image, in a fixed direction oblique to all axes of the measurement volume, millimetres.
    pub mm_per_image: f64,
    /// Rotation per image, about a fixed axis through the origin of the frame of the volume, degrees.
    pub deg_per_image: f64,
    /// Number of cycles of phase images.
    pub cycles: usize,
    /// Share of the frame period during which the shutter is open, 0 to 1.
    pub blur: f64,
    /// Root mean square of the tremor along each axis, millimetres, and about it, degrees. The tremor is zero in the
    /// middle of the sequence.
    pub tremor: f64,
    /// Seed of the tremor.
    pub seed: u64,
}

/// A moving object.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ObjectMotion {
    options: MotionOptions,
    images: usize,
    tremor: Tremor,
}

/// Direction of the translation and axis of the rotation in the frame of the measurement volume; normalized before use.
const DIRECTION: [f64; 3] = [0.62, -0.35, 0.70];
const AXIS: [f64; 3] = [0.30, 0.90, 0.25];
/// Bounds of the options.
const MAX_MM: f64 = 5.0;
const MAX_DEG: f64 = 5.0;
const MAX_CYCLES: f64 = 100.0;
/// Number of images after which the tremor repeats.
const TREMOR_PERIOD_IMAGES: usize = 240;
/// Number of parts of an exposure with blur. It is odd, so that one part is in the middle.
const PARTS: usize = 5;

impl MotionOptions {
    /// Returns the smallest number of cycles with at least sixteen images, each step several times, and a cycle in the
    /// middle.
    #[must_use]
    pub fn usual_cycles(steps: usize) -> usize {
        let least = 16_usize.div_ceil(steps.max(1)).max(2);
        // The middle of an odd number of images is an image, that of an even number lies between two. A cycle must
        // match this.
        if steps.is_multiple_of(2) || !least.is_multiple_of(2) { least } else { least + 1 }
    }
}

impl ObjectMotion {
    pub(super) fn new(options: MotionOptions, steps: usize) -> Result<Self, SimulationError> {
        check_range("the motion", options.mm_per_image, 0.0, MAX_MM, "mm per image")?;
        check_range("the rotation", options.deg_per_image, 0.0, MAX_DEG, "° per image")?;
        check_range("the number of cycles", options.cycles as f64, 1.0, MAX_CYCLES, "")?;
        check_range("the blur", options.blur, 0.0, 1.0, "of an image")?;
        let tremor = Tremor::new(TREMOR_PERIOD_IMAGES, options.tremor, options.tremor, options.seed)?;
        let motion = Self { options, images: steps * options.cycles, tremor };
        // At larger angles, interpolation between poses would rotate the shorter way.
        let farthest_rad = options.deg_per_image.to_radians() * motion.reference();
        check_range("the rotation from the middle of the sequence", farthest_rad, 0.0, FRAC_PI_2, "rad")?;
        Ok(motion)
    }

    /// Middle of the sequence, for which the truth holds, counted in images.
    fn reference(&self) -> f64 {
        (self.images as f64 - 1.0) / 2.0
    }

    /// Pose of the object at a time, relative to the middle of the sequence, in the frame of the measurement volume,
    /// metres.
    fn pose(&self, image: f64) -> Pose {
        let elapsed_images = image - self.reference();
        let [tremor, reference] = [image, self.reference()].map(|at| self.tremor.at(at));
        let distance_m = self.options.mm_per_image * 1e-3 * elapsed_images;
        let turn_rad = self.options.deg_per_image.to_radians() * elapsed_images;
        let shift = Vector3::from(DIRECTION).normalize() * distance_m + tremor[0] - reference[0];
        let turn = Vector3::from(AXIS).normalize() * turn_rad + tremor[1] - reference[1];
        Pose::from_parts(Translation3::from(shift), UnitQuaternion::from_scaled_axis(turn))
    }

    /// Returns the poses of all images.
    pub(super) fn description(&self) -> Motion {
        Motion { reference: self.reference(), poses: (0..self.images).map(|k| self.pose(k as f64)).collect() }
    }

    /// Returns the scene at another time, from the scene in the middle of the sequence.
    fn scene(&self, rig: &VirtualRig, reference: &Scene, image: f64) -> Scene {
        let cam1_from_volume = rig.exact_volume.cam1_from_volume();
        let motion = cam1_from_volume * self.pose(image) * cam1_from_volume.inverse();
        reference.clone().at(motion * reference.cam1_from_object())
    }

    /// Returns the view of a camera in the middle of the exposure of an image, and the views in its other parts.
    pub(super) fn views(
        &self,
        rig: &VirtualRig,
        reference: &Scene,
        camera: CameraId,
        image: usize,
        supersampling: usize,
    ) -> Result<(View, Vec<View>), SimulationError> {
        let scene = |time| self.scene(rig, reference, time);
        let middle = View::trace(&rig.exact, &scene(image as f64), camera, supersampling)?;
        let half = PARTS / 2;
        let offsets = (1..=half).flat_map(|i| [-1.0, 1.0].map(|side| side * i as f64 / PARTS as f64));
        let parts = offsets.filter(|_| self.options.blur > 0.0).map(|offset| {
            let scene = scene(image as f64 + self.options.blur * offset);
            View::for_images(&rig.exact, &scene, camera, supersampling)
        });
        let parts = parts.collect::<Result<_, _>>()?;
        Ok((middle, parts))
    }
}
