//! Rendered windows with lost, duplicated and swapped images, for tests and measurements.

use std::f64::consts::TAU;

use nalgebra::Translation3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use fringeflow::geometry::{Pose, Vector3};
use fringeflow::phase::{
    MotionFit, SequenceCheck, SequenceFault, SequenceFaultKind, Validity, decode_moving, usual_extra_images,
};
use fringeflow_base::grey::GreyLevels;
use fringeflow_dataset::{CameraId, GreyImage};
use fringeflow_lab::simulation::{
    Arrangement, Board, ImageSeed, NoiseLevel, Object, RigOptions, Scene, Sensor, View, VirtualRig,
};
use fringeflow_patterns::{Direction, Pattern};

/// The images are the middle of images of this width: they have the same focal length in pixels, and the same fringes.
const FULL_WIDTH_PX: f64 = 640.0;
/// Direction of motion, frame of the measurement volume.
const DIRECTION: [f64; 3] = [0.62, -0.35, 0.70];

/// A fault to inject into a window. Image numbers count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Injection {
    /// No fault.
    None,
    /// All images are ahead of the declared steps by this number.
    Slip(usize),
    /// After image `.0`, `.1` images are lost.
    Lost(usize, usize),
    /// The image is delivered twice; later images are delayed by one.
    Frozen(usize),
    /// The projector shows the pattern of the image twice; later patterns are delayed by one.
    Repeated(usize),
    /// After image `.0`, the projector skips `.1` patterns.
    Skipped(usize, usize),
    /// The image and the next one are exchanged.
    Swapped(usize),
}

/// A scene that moves past both cameras, ray-traced pose by pose.
pub(crate) struct MovingScene {
    pub(crate) rig: VirtualRig,
    /// Views of cameras 1 and 2, by pose.
    views: [Vec<View>; 2],
    noise: NoiseLevel,
}

/// Pose and step of each image of a window.
type Origins = Vec<[usize; 2]>;

impl Injection {
    /// The fault to expect; `None` if a single window cannot show it.
    pub(crate) fn fault(self) -> Option<SequenceFaultKind> {
        match self {
            Self::None | Self::Slip(_) => None,
            Self::Lost(after, images) | Self::Skipped(after, images) => Some(SequenceFaultKind::Lost { after, images }),
            Self::Frozen(image) | Self::Repeated(image) => Some(SequenceFaultKind::Duplicated { image }),
            Self::Swapped(first) => Some(SequenceFaultKind::Swapped { first }),
        }
    }

    /// Draws a fault of kind 1 to 6 at a random place.
    pub(crate) fn draw(kind: usize, steps: usize, images: usize, rng: &mut ChaCha8Rng) -> Self {
        let image = rng.random_range(0..images - 1);
        let count = rng.random_range(1..(steps - 1).max(2));
        match kind {
            1 => Self::Slip(rng.random_range(1..steps)),
            2 => Self::Lost(image, count),
            3 => Self::Frozen(image),
            4 => Self::Repeated(image),
            5 => Self::Skipped(image, count),
            _ => Self::Swapped(image),
        }
    }

    /// Origins of the images of a window that starts with `first_step`.
    fn origins(self, first_step: usize, images: usize) -> Origins {
        let at = |pose: usize, step: usize| [pose, first_step + step];
        (0..images)
            .map(|i| match self {
                Self::Slip(ahead) => at(i, i + ahead),
                Self::Lost(after, lost) if i > after => at(i + lost, i + lost),
                Self::Skipped(after, lost) if i > after => at(i, i + lost),
                Self::Frozen(image) if i > image => at(i - 1, i - 1),
                Self::Repeated(image) if i > image => at(i, i - 1),
                Self::Swapped(first) if i == first => at(i + 1, i + 1),
                Self::Swapped(first) if i == first + 1 => at(i - 1, i - 1),
                _ => at(i, i),
            })
            .collect()
    }
}

impl MovingScene {
    /// Renders an object that moves by `mm_per_image`, at `poses` poses.
    pub(crate) fn new(object: Object, size_px: [usize; 2], mm_per_image: f64, poses: usize, noise: NoiseLevel) -> Self {
        let focal_px = Arrangement::TABLE_TOP.camera_focal_px * FULL_WIDTH_PX / size_px[0] as f64;
        let arrangement = Arrangement { camera_focal_px: focal_px, ..Arrangement::TABLE_TOP };
        let options = RigOptions { arrangement, size_px, seed: 3, ..RigOptions::usual(0.06) };
        let rig = VirtualRig::new(&options).unwrap();
        let cam1_from_volume = *rig.exact_volume.cam1_from_volume();
        let resting = Scene::from_object(object, Board::Visible, &rig.exact_volume);
        let at = |pose: usize| -> Scene {
            let offset =
                Vector3::from(DIRECTION).normalize() * (mm_per_image * 1e-3 * (pose as f64 - poses as f64 / 2.0));
            let moved: Pose = cam1_from_volume * Translation3::from(offset) * cam1_from_volume.inverse();
            resting.clone().at(moved * resting.cam1_from_object())
        };
        // At rest all poses are the same.
        let traced = if mm_per_image == 0.0 { 1 } else { poses };
        let view = |camera, pose| View::trace(&rig.exact, &at(pose), camera, 1).unwrap();
        let views = CameraId::BOTH.map(|camera| (0..traced).map(|pose| view(camera, pose)).collect());
        Self { rig, views, noise }
    }

    /// The images of a window of a camera, 0 or 1. The seed determines the noise.
    pub(crate) fn window(
        &self,
        camera: usize,
        steps: usize,
        first_step: usize,
        injection: Injection,
        seed: u64,
    ) -> Vec<GreyImage> {
        let images = steps + usual_extra_images(steps);
        let sensor = Sensor::exposed(self.noise.noise(), 1.0);
        let image_at = |[pose, step]: [usize; 2]| {
            let shift_rad = shifts_rad(steps)[step % steps];
            let pattern = Pattern::Fringes { direction: Direction::Columns, pattern: self.rig.columns, shift_rad };
            let views = &self.views[camera];
            let view = &views[pose.min(views.len() - 1)];
            // An exposure that is delivered twice has the same noise both times.
            sensor.image(view, &pattern, ImageSeed { seed, camera: camera as u8, image: pose as u32 })
        };
        injection.origins(first_step, images).into_iter().map(image_at).collect()
    }
}

/// Evenly spaced phase shifts of a cycle, rad.
pub(crate) fn shifts_rad(steps: usize) -> Vec<f64> {
    (0..steps).map(|k| TAU * k as f64 / steps as f64).collect()
}

/// The fault that the images of a window show.
pub(crate) fn find_fault(
    window: &[GreyImage],
    size_px: [usize; 2],
    steps: usize,
    first_step: usize,
) -> Option<SequenceFault> {
    let check = SequenceCheck::new(&shifts_rad(steps), first_step, window.len());
    let levels: Vec<GreyLevels<'_>> = GreyImage::levels_of(window);
    check.find_fault(&levels, size_px[0], size_px[1], &Validity::default())
}

/// Median motion of a window without a fault, rad per image.
pub(crate) fn motion_rad(window: &[GreyImage], size_px: [usize; 2], steps: usize, first_step: usize) -> f64 {
    let shifts: Vec<f64> = shifts_rad(steps).into_iter().cycle().skip(first_step % steps).take(window.len()).collect();
    let fit = MotionFit::new(&shifts).unwrap();
    let levels: Vec<GreyLevels<'_>> = GreyImage::levels_of(window);
    let map = decode_moving(&levels, size_px[0], size_px[1], &fit, &Validity::default()).unwrap();
    f64::from(map.motion.unwrap().median_rad)
}

/// Random numbers for a seed.
pub(crate) fn seeded_rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}
