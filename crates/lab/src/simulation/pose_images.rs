//! The images of a moving virtual scanner, pose after pose.
//!
//! Rays of a pose are all traced anew every few poses; between them most pixels follow from the pose before. So images
//! must be made in the order of the poses, and every round of the sweep has the same.

use fringeflow_dataset::{CameraId, GreyImage};

use super::view::View;
use super::{Scene, Sensor, SimulationError, VirtualScanner};

/// Poses from one whose rays are all traced to the next.
const TRACKED_POSES: usize = 16;

/// Makes the images of one pose after the other, round after round.
pub struct PoseImages<'a> {
    scanner: &'a VirtualScanner,
    resting: Scene,
    sensor: Sensor,
    pose: usize,
    views: [Option<View>; 2],
}

impl<'a> PoseImages<'a> {
    /// Begins with the first pose.
    #[must_use]
    pub fn new(scanner: &'a VirtualScanner) -> Self {
        let (resting, sensor) = (scanner.scene(), scanner.sensor());
        Self { scanner, resting, sensor, pose: 0, views: [None, None] }
    }

    /// The images of both cameras at the next pose, while the projector shows a step.
    ///
    /// # Errors
    /// [`SimulationError::Range`]: an option that [`View::trace`] refuses.
    pub fn take(&mut self, step: usize) -> Result<[GreyImage; 2], SimulationError> {
        let (scanner, pose) = (self.scanner, self.pose);
        let scene = self.resting.clone().at(scanner.cam1_from_object(pose));
        let (rig, supersampling) = (&scanner.rig().exact, scanner.options().supersampling);
        let mut image = |camera: CameraId| {
            let view = &mut self.views[camera as usize];
            let traced = match view.take().filter(|_| !pose.is_multiple_of(TRACKED_POSES)) {
                Some(before) => View::trace_after(&before, rig, &scene, camera, supersampling)?,
                None => View::trace(rig, &scene, camera, supersampling)?,
            };
            let image = self.sensor.image(&traced, &scanner.projected(step), scanner.image_seed(camera, pose));
            *view = Some(traced);
            Ok::<_, SimulationError>(image)
        };
        let images = [image(CameraId::Cam1)?, image(CameraId::Cam2)?];
        self.pose = (pose + 1) % scanner.sweep().poses();
        Ok(images)
    }
}
