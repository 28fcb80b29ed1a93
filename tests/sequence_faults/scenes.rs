//! Windows of rendered images in which images are lost, duplicated and swapped, for tests and for measuring.

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
    Arrangement, Board, Direction, ImageSeed, NoiseLevel, Object, Projected, RigOptions, Scene, Sensor, View,
    VirtualRig,
};

/// Focal length of cameras that see the fringes as cameras of 640 × 512 pixels do, whose middle they are.
const FULL_WIDTH_PX: f64 = 640.0;
/// Direction of the way, frame of the measurement volume.
const DIRECTION: [f64; 3] = [0.62, -0.35, 0.70];

/// What goes wrong with the images of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Injection {
    /// Nothing.
    None,
    /// The images of the camera are those of other steps all alike.
    Slip(usize),
    /// So many images are lost behind one.
    Lost(usize, usize),
    /// The very same image comes twice, those behind it are one late.
    Frozen(usize),
    /// The projector shows a pattern twice and goes on from there.
    Repeated(usize),
    /// The projector leaves so many patterns out.
    Skipped(usize, usize),
    /// An image and the next one are exchanged.
    Swapped(usize),
}

/// A scene that moves past both cameras, ray-traced pose by pose.
pub(crate) struct MovingScene {
    /// The rig.
    pub(crate) rig: VirtualRig,
    /// Of camera 1 and 2.
    views: [Vec<View>; 2],
    noise: NoiseLevel,
}

/// Where the images of a window come from: pose and step of each.
type Places = Vec<[usize; 2]>;

impl Injection {
    /// The fault that it is; `None` where a window by itself shows none.
    pub(crate) fn fault(self) -> Option<SequenceFaultKind> {
        match self {
            Self::None | Self::Slip(_) => None,
            Self::Lost(after, images) | Self::Skipped(after, images) => Some(SequenceFaultKind::Lost { after, images }),
            Self::Frozen(image) | Self::Repeated(image) => Some(SequenceFaultKind::Duplicated { image }),
            Self::Swapped(first) => Some(SequenceFaultKind::Swapped { first }),
        }
    }

    /// One of a kind, 1 to 6, at random.
    pub(crate) fn draw(kind: usize, steps: usize, images: usize, rng: &mut ChaCha8Rng) -> Self {
        let place = rng.random_range(0..images - 1);
        let few = rng.random_range(1..(steps - 1).max(2));
        match kind {
            1 => Self::Slip(rng.random_range(1..steps)),
            2 => Self::Lost(place, few),
            3 => Self::Frozen(place),
            4 => Self::Repeated(place),
            5 => Self::Skipped(place, few),
            _ => Self::Swapped(place),
        }
    }

    /// Pose and step of the images of a window that begins with a step.
    fn places(self, first_step: usize, images: usize) -> Places {
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
    /// An object that moves by so many millimetres an image, for so many images.
    pub(crate) fn new(object: Object, size_px: [usize; 2], mm_per_image: f64, poses: usize, noise: NoiseLevel) -> Self {
        let focal_px = Arrangement::TABLE_TOP.camera_focal_px * FULL_WIDTH_PX / size_px[0] as f64;
        let arrangement = Arrangement { camera_focal_px: focal_px, ..Arrangement::TABLE_TOP };
        let options = RigOptions { arrangement, size_px, seed: 3, ..RigOptions::usual(0.06) };
        let rig = VirtualRig::new(&options).unwrap();
        let cam1_from_volume = *rig.exact_volume.cam1_from_volume();
        let resting = Scene::from_object(object, Board::Visible, &rig.exact_volume);
        let at = |pose: usize| -> Scene {
            let way = Vector3::from(DIRECTION).normalize() * (mm_per_image * 1e-3 * (pose as f64 - poses as f64 / 2.0));
            let moved: Pose = cam1_from_volume * Translation3::from(way) * cam1_from_volume.inverse();
            resting.clone().at(moved * resting.cam1_from_object())
        };
        // At rest all poses are the same.
        let traced = if mm_per_image == 0.0 { 1 } else { poses };
        let view = |camera, pose| View::trace(&rig.exact, &at(pose), camera, 1).unwrap();
        let views = CameraId::BOTH.map(|camera| (0..traced).map(|pose| view(camera, pose)).collect());
        Self { rig, views, noise }
    }

    /// The images of a window of a camera, 0 or 1; the seed makes the noise.
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
        let of = |[pose, step]: [usize; 2]| {
            let shift_rad = shifts_rad(steps)[step % steps];
            let pattern = Projected::Fringes { direction: Direction::Columns, pattern: self.rig.columns, shift_rad };
            let views = &self.views[camera];
            let view = &views[pose.min(views.len() - 1)];
            // The same exposure has the same noise.
            sensor.image(view, &pattern, ImageSeed { seed, camera: camera as u8, image: pose as u32 })
        };
        injection.places(first_step, images).into_iter().map(of).collect()
    }
}

/// Evenly spaced shifts of a cycle, rad.
pub(crate) fn shifts_rad(steps: usize) -> Vec<f64> {
    (0..steps).map(|k| TAU * k as f64 / steps as f64).collect()
}

/// What the images of a window tell.
pub(crate) fn told(
    window: &[GreyImage],
    size_px: [usize; 2],
    steps: usize,
    first_step: usize,
) -> Option<SequenceFault> {
    let check = SequenceCheck::new(&shifts_rad(steps), first_step, window.len());
    let levels: Vec<GreyLevels<'_>> = GreyImage::levels_of(window);
    check.find_fault(&levels, size_px[0], size_px[1], &Validity::default())
}

/// Median motion of a window in which nothing is wrong, rad an image.
pub(crate) fn motion_rad(window: &[GreyImage], size_px: [usize; 2], steps: usize, first_step: usize) -> f64 {
    let shifts: Vec<f64> = shifts_rad(steps).into_iter().cycle().skip(first_step % steps).take(window.len()).collect();
    let fit = MotionFit::new(&shifts).unwrap();
    let levels: Vec<GreyLevels<'_>> = GreyImage::levels_of(window);
    let map = decode_moving(&levels, size_px[0], size_px[1], &fit, &Validity::default()).unwrap();
    f64::from(map.motion.unwrap().median_rad)
}

/// Random numbers.
pub(crate) fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}
