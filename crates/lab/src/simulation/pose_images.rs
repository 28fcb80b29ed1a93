//! Renders the images of a moving virtual scanner, pose by pose.
//!
//! All rays are traced again every few poses. In between, most pixels are tracked from the previous pose. So images
//! must be rendered in the order of the poses. Each round of the sweep gives the same images.

use fringeflow_dataset::{CameraId, GreyImage};

use super::view::View;
use super::{Scene, Sensor, SimulationError, VirtualScanner};

/// Number of poses from one complete trace to the next.
const TRACKED_POSES: usize = 16;

/// Renders the images pose by pose, round after round.
pub struct PoseImages<'a> {
    scanner: &'a VirtualScanner,
    resting: Scene,
    sensor: Sensor,
    pose: usize,
    views: [Option<View>; 2],
}

impl<'a> PoseImages<'a> {
    /// Starts with the first pose.
    #[must_use]
    pub fn new(scanner: &'a VirtualScanner) -> Self {
        let (resting, sensor) = (scanner.scene(), scanner.sensor());
        Self { scanner, resting, sensor, pose: 0, views: [None, None] }
    }

    /// Renders the images of both cameras at the next pose, while the projector shows a step.
    ///
    /// # Errors
    /// [`SimulationError::Range`]: [`View::trace`] refuses an option.
    pub fn take(&mut self, step: usize) -> Result<[GreyImage; 2], SimulationError> {
        let (scanner, pose) = (self.scanner, self.pose);
        let scene = self.resting.clone().at(scanner.cam1_from_object(pose));
        let (rig, supersampling) = (&scanner.rig().exact, scanner.options().supersampling);
        let mut image = |camera: CameraId| {
            let view = &mut self.views[camera as usize];
            let traced = match view.take().filter(|_| !pose.is_multiple_of(TRACKED_POSES)) {
                Some(previous) => View::trace_after(&previous, rig, &scene, camera, supersampling)?,
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
