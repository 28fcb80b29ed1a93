//! The images of a moving scanner, rendered in advance and shown in a loop, because ray tracing is slower than real
//! time.
//!
//! In: a [`VirtualScanner`]. Out: for each pose of its sweep the image of each camera, with one phase shift (step) of
//! the pattern: the step that is due if the images follow each other in order. Each step occurs regularly among the
//! poses. If the projector shows another step, a nearby pose has it, so the fringes are always correct.
//!
//! A pose of both cameras at 640 × 512 pixels costs about half a second of one core, depending on the object, so the
//! loop is stored in a file.

use std::ops::ControlFlow;

use fringeflow_base::grey::{GreyLevels, PixelFormat};
use fringeflow_dataset::CameraId;

use super::SimulationError;
use super::pose_images::PoseImages;
use super::virtual_scanner::VirtualScanner;

/// One round of images of both cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageLoop {
    size_px: [usize; 2],
    format: PixelFormat,
    poses: usize,
    steps: usize,
    /// Bytes of the images, pose by pose, C1 before C2.
    pub(super) pixels: Vec<u8>,
}

impl ImageLoop {
    /// Creates a loop of black images.
    pub(super) fn black(scanner: &VirtualScanner) -> Self {
        let (size_px, poses) = (scanner.options().rig.size_px, scanner.sweep().poses());
        let format = scanner.options().format;
        let pixels = vec![0; poses * 2 * size_px[0] * size_px[1] * format.bytes()];
        Self { size_px, format, poses, steps: scanner.options().steps, pixels }
    }

    /// Renders the images. `on_pose` is called after each pose. If it cancels, the result is `None`.
    ///
    /// # Errors
    /// As [`PoseImages::take`].
    pub fn render(
        scanner: &VirtualScanner,
        mut on_pose: impl FnMut(usize) -> ControlFlow<()>,
    ) -> Result<Option<Self>, SimulationError> {
        let mut images = Self::black(scanner);
        let (steps, bytes) = (images.steps, images.image_bytes());
        let mut rendered = PoseImages::new(scanner);
        for (pose, pair) in images.pixels.chunks_exact_mut(2 * bytes).enumerate() {
            for (image, pixels) in rendered.take(pose % steps)?.iter().zip(pair.chunks_exact_mut(bytes)) {
                pixels.copy_from_slice(&image.pixels);
            }
            if on_pose(pose).is_break() {
                return Ok(None);
            }
        }
        Ok(Some(images))
    }

    /// Width and height of an image, pixels.
    #[must_use]
    pub fn size_px(&self) -> [usize; 2] {
        self.size_px
    }

    /// Returns the image of an exposure while the projector shows a step: the image of the nearest pose with that step.
    /// Returns `None` for an unknown step.
    #[must_use]
    pub fn image(&self, camera: CameraId, exposure_number: u64, step: u32) -> Option<GreyLevels<'_>> {
        let pose = self.pose(exposure_number, step)?;
        let bytes = self.image_bytes();
        let image = self.pixels.get((2 * pose + camera as usize) * bytes..)?.get(..bytes)?;
        Some(GreyLevels { format: self.format, bytes: image })
    }

    /// Returns the pose shown in an exposure.
    fn pose(&self, exposure_number: u64, step: u32) -> Option<usize> {
        let (poses, steps, step) = (self.poses, self.steps, step as usize);
        if step >= steps {
            return None;
        }
        let turn = (exposure_number % poses as u64) as usize;
        // Number of poses forward to the next one with the step. If that is more than half a cycle, go back instead.
        let ahead = (step + steps - turn % steps) % steps;
        let back = if ahead > steps / 2 { steps } else { 0 };
        Some((turn + ahead + poses - back) % poses)
    }

    fn image_bytes(&self) -> usize {
        self.size_px[0] * self.size_px[1] * self.format.bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::virtual_scanner::tests::options;
    use crate::simulation::{Sensor, View, VirtualScannerOptions};

    fn scanner() -> VirtualScanner {
        VirtualScanner::new(options()).unwrap()
    }

    #[test]
    fn images_in_order_run_through_the_loop() {
        let images = ImageLoop::black(&scanner());
        for k in 0..100_u64 {
            assert_eq!(images.pose(k, (k % 4) as u32), Some((k % 24) as usize));
        }
    }

    #[test]
    fn another_step_finds_the_nearest_pose_with_it() {
        let images = ImageLoop::black(&scanner());
        for (exposure, step) in (0..48).flat_map(|k| (0..4).map(move |s| (k, s))) {
            let pose = images.pose(exposure, step).unwrap();
            assert_eq!(pose % 4, step as usize);
            let apart = pose.abs_diff((exposure % 24) as usize);
            assert!(apart.min(24 - apart) <= 2, "exposure {exposure}, step {step}: pose {pose}");
        }
        assert_eq!(images.pose(3, 4), None);
        assert!(images.image(CameraId::Cam2, u64::MAX, 3).is_some_and(|image| image.pixels() == 80 * 64));
    }

    #[test]
    fn every_image_is_that_of_its_pose_and_step() {
        let scanner = scanner();
        let mut called = Vec::new();
        let on_pose = |pose| {
            called.push(pose);
            ControlFlow::Continue(())
        };
        let images = ImageLoop::render(&scanner, on_pose).unwrap().unwrap();
        assert_eq!(called, (0..24).collect::<Vec<_>>());
        let quiet = Sensor::exposed(None, 1.0);
        for pose in [0, 7, 23] {
            let scene = scanner.scene().at(scanner.cam1_from_object(pose));
            for camera in CameraId::BOTH {
                let view = View::trace(&scanner.rig().exact, &scene, camera, 1).unwrap();
                let expected = quiet.image(&view, &scanner.projected(pose % 4), scanner.image_seed(camera, pose));
                let image = images.image(camera, pose as u64, (pose % 4) as u32).unwrap().bytes;
                let pairs = image.iter().zip(&expected.pixels);
                let mean = pairs.map(|(&a, &b)| f64::from(a.abs_diff(b))).sum::<f64>() / image.len() as f64;
                assert!((0.3..3.0).contains(&mean), "pose {pose}, {camera:?}: {mean} grey levels apart");
            }
        }
        // Four images later the step is the same, but the pose and the noise are not.
        assert_ne!(images.image(CameraId::Cam1, 0, 0), images.image(CameraId::Cam1, 4, 0));
    }

    #[test]
    fn rendering_can_be_cancelled() {
        let mut calls = 0;
        let on_pose = |pose| {
            calls += 1;
            if pose == 1 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        assert!(ImageLoop::render(&scanner(), on_pose).unwrap().is_none());
        assert_eq!(calls, 2);
    }

    #[test]
    fn the_number_of_threads_changes_no_byte() {
        let sweep = crate::simulation::SweepOptions { poses: 4, ..options().sweep };
        let scanner = VirtualScanner::new(VirtualScannerOptions { sweep, ..options() }).unwrap();
        let with_threads = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| ImageLoop::render(&scanner, |_| ControlFlow::Continue(())).unwrap().unwrap())
        };
        assert_eq!(with_threads(1), with_threads(3));
    }
}
