//! Renders the images of a moving virtual scanner, pose by pose. Each round of the sweep gives the same images.

use fringeflow_dataset::{CameraId, GreyImage};

use super::sensor::Sensitivity;
use super::view::View;
use super::{Scene, Sensor, SimulationError, VirtualScanner};

/// Renders the images pose by pose, round after round.
pub struct PoseImages<'a> {
    scanner: &'a VirtualScanner,
    resting: Scene,
    sensor: Sensor,
    /// Of both cameras.
    sensitivities: [Sensitivity; 2],
    pose: usize,
}

impl<'a> PoseImages<'a> {
    /// Starts with the first pose.
    #[must_use]
    pub fn new(scanner: &'a VirtualScanner) -> Self {
        let (sensor, size_px) = (scanner.sensor(), scanner.options().rig.size_px);
        let sensitivity = |camera| sensor.sensitivity(size_px, scanner.image_seed(camera, 0));
        Self { scanner, resting: scanner.scene(), sensor, sensitivities: CameraId::BOTH.map(sensitivity), pose: 0 }
    }

    /// Renders the images of both cameras at the next pose, while the projector shows a step.
    ///
    /// # Errors
    /// [`SimulationError::Range`]: the supersampling is refused.
    pub fn take(&mut self, step: usize) -> Result<[GreyImage; 2], SimulationError> {
        let (scanner, pose) = (self.scanner, self.pose);
        let scene = self.resting.clone().at(scanner.cam1_from_object(pose));
        let (rig, supersampling) = (&scanner.rig().exact, scanner.options().supersampling);
        let image = |camera: CameraId| {
            let view = View::for_images(rig, &scene, camera, supersampling)?;
            let (pattern, seed) = (scanner.projected(step), scanner.image_seed(camera, pose));
            let sensitivity = &self.sensitivities[camera as usize];
            Ok::<_, SimulationError>(self.sensor.exposure((&view, &[]), &pattern, sensitivity, seed))
        };
        let images = [image(CameraId::Cam1)?, image(CameraId::Cam2)?];
        self.pose = (pose + 1) % scanner.sweep().poses();
        Ok(images)
    }
}
