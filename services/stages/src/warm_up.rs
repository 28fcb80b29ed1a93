//! The window that a stage works on before its first one, so that its memory, tables and threads are there.
//!
//! In: the setup. Out: images of a wall in the middle of the measurement volume, and what the stages before make of
//! them. Nothing of it is counted or sent, and workers keep no information, so the clouds do not depend on it. Cost:
//! that of some windows, before the stage reports for the first time; the scan starts after that.
//!
//! A restarted service does not warm up: windows already wait for it.

use std::f64::consts::TAU;
use std::sync::Arc;

use fringeflow::cloud::Cloud;
use fringeflow::correspondence::SegmentTable;
use fringeflow::geometry::{Camera, Pixel, Point3, Pose};
use fringeflow::worker::{CloudWorker, Correspondences, PhasePair, PhaseWorker};
use fringeflow_base::grey::{GreyLevels, PixelFormat};
use fringeflow_config::ScannerConfiguration;
use fringeflow_dataset::Setup;
use fringeflow_runtime::{Host, ServiceError};

use crate::{correspondence, phase};

/// Mean and amplitude of the fringes, grey levels.
const FRINGES_GREY: [f64; 2] = [100.0, 60.0];

/// Side of the tiles between whose corners the phase of the wall is linear, pixels.
const TILE_PX: usize = 16;

/// Images of a wall.
pub(crate) struct WarmUp<'a> {
    configuration: &'a ScannerConfiguration,
    setup: &'a Setup,
    /// Images of both cameras, by step of the cycle.
    images: [Vec<Vec<u8>>; 2],
}

impl<'a> WarmUp<'a> {
    /// The warm-up of a service; `None` after a restart, or without a measurement volume.
    pub(crate) fn of(host: &'a Host) -> Option<Self> {
        let depth_m = middle_of_volume_m(&host.setup).filter(|_| host.restarts() == 0)?;
        Some(Self::new(&host.configuration, &host.setup, depth_m))
    }

    /// Images of a wall at a depth in front of camera 1.
    fn new(configuration: &'a ScannerConfiguration, setup: &'a Setup, depth_m: f64) -> Self {
        let rig = &setup.rig;
        let cameras = [(&rig.cam1, Pose::identity()), (&rig.cam2, rig.cam2_from_cam1.inverse())];
        let format = configuration.pixel_format();
        let images = cameras.map(|(camera, cam1_from_camera)| {
            let turns = phases_of_wall(camera, &cam1_from_camera, setup, depth_m);
            setup.cycle_shifts_rad().iter().map(|&shift_rad| image(&turns, shift_rad, format)).collect()
        });
        Self { configuration, setup, images }
    }

    /// Decodes the wall, in a window that begins with step `first_step` of the cycle.
    pub(crate) fn decode(&self, first_step: usize, worker: &mut PhaseWorker, out: &mut PhasePair) {
        let images = self.configuration.measurement.settings.window_images(self.setup.steps);
        let format = self.configuration.pixel_format();
        let [cam1, cam2] = self.images.each_ref().map(|of_camera| {
            let steps = of_camera.iter().cycle().skip(first_step).take(images);
            steps.map(|bytes| GreyLevels { format, bytes }).collect::<Vec<_>>()
        });
        note_failure(worker.step(first_step, &cam1, &cam2, None, out));
    }

    /// Phase maps of the wall.
    pub(crate) fn maps(&self) -> Result<PhasePair, ServiceError> {
        let mut maps = PhasePair::default();
        self.decode(0, &mut phase::new_worker(self.configuration, self.setup)?, &mut maps);
        Ok(maps)
    }

    /// Triangulates the wall.
    pub(crate) fn triangulate(
        &self,
        table: &Arc<SegmentTable>,
        worker: &mut CloudWorker,
        out: &mut Cloud,
    ) -> Result<(), ServiceError> {
        let mut found = Correspondences::default();
        let mut search = correspondence::new_worker(self.configuration, self.setup, table)?;
        // A search that fails leaves correspondences without a size, which cannot be triangulated.
        match search.step(&self.maps()?, &mut found) {
            Ok(()) => worker.step(&found, out),
            failure => note_failure(failure),
        }
        Ok(())
    }
}

/// A window of a real scene may succeed where the wall does not, so the service starts all the same.
pub(crate) fn note_failure<T, E: std::fmt::Display>(result: Result<T, E>) {
    if let Err(error) = result {
        tracing::debug!("the warm-up yields nothing: {error}");
    }
}

/// Depth of the middle of the measurement volume in front of camera 1, metres.
fn middle_of_volume_m(setup: &Setup) -> Option<f64> {
    let corners = setup.volume.as_ref()?.corners_cam1();
    let depth_m = corners.iter().map(|corner| corner.z).sum::<f64>() / corners.len() as f64;
    (depth_m > 0.0).then_some(depth_m)
}

/// Returns the phase of each pixel, turns; 0 where the wall is not seen or not lit.
fn phases_of_wall(camera: &Camera, cam1_from_camera: &Pose, setup: &Setup, depth_m: f64) -> Vec<f64> {
    let [width, height] = setup.image_size_px;
    let centre = cam1_from_camera * Point3::origin();
    let turns = |u: usize, v: usize| {
        let ray = cam1_from_camera.rotation * camera.ray(&Pixel::new(u as f64, v as f64))?;
        let point = centre + ray * ((depth_m - centre.z) / ray.z);
        let lit_by = setup.rig.project_projector(&point)?;
        Some(setup.sequence.pattern.phase_turns(lit_by.x))
    };
    let corners_across = width.div_ceil(TILE_PX) + 1;
    let corners =
        (0..=height.div_ceil(TILE_PX)).flat_map(|v| (0..corners_across).map(move |u| (u * TILE_PX, v * TILE_PX)));
    let corners: Vec<f64> = corners.map(|(u, v)| turns(u, v).unwrap_or(0.0)).collect();
    let interpolate = |u: usize, v: usize| {
        let [right, down] = [u, v].map(|at| (at % TILE_PX) as f64 / TILE_PX as f64);
        let corner = v / TILE_PX * corners_across + u / TILE_PX;
        let along = |corner: usize| corners[corner] + right * (corners[corner + 1] - corners[corner]);
        along(corner) + down * (along(corner + corners_across) - along(corner))
    };
    (0..height).flat_map(|v| (0..width).map(move |u| (u, v))).map(|(u, v)| interpolate(u, v)).collect()
}

/// Returns the image of a step, as a camera sends it.
fn image(turns: &[f64], shift_rad: f64, format: PixelFormat) -> Vec<u8> {
    let [mean, amplitude] = FRINGES_GREY;
    let value = |turns: &f64| {
        let grey = mean + amplitude * (TAU * turns + shift_rad).cos();
        (grey / f64::from(format.grey_per_value())).round() as u16
    };
    turns.iter().flat_map(|turns| value(turns).to_le_bytes().into_iter().take(format.bytes())).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use std::path::Path;

    use fringeflow::worker::CorrespondenceWorker;
    use fringeflow_runtime::ServiceArgs;

    use super::*;

    /// The scanner of a small recording, and its segment table.
    pub(crate) fn scanner() -> (ScannerConfiguration, Setup, Arc<SegmentTable>) {
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recordings/tooth.toml");
        let arguments = ServiceArgs { config, ..ServiceArgs::default() };
        let configuration = arguments.configuration().unwrap();
        let setup = arguments.setup(&configuration).unwrap();
        let table = arguments.segment_table(&configuration, &setup).unwrap();
        (configuration, setup, Arc::new(table))
    }

    /// Phase maps of a wall that is nearer than the middle of the volume.
    pub(crate) fn maps_of_wall(configuration: &ScannerConfiguration, setup: &Setup, nearer_m: f64) -> PhasePair {
        WarmUp::new(configuration, setup, middle_of_volume_m(setup).unwrap() - nearer_m).maps().unwrap()
    }

    /// The workers of all stages, and what they make of a window that begins with a step.
    struct Chain(PhaseWorker, CorrespondenceWorker, CloudWorker);

    impl Chain {
        fn new(configuration: &ScannerConfiguration, setup: &Setup, table: &Arc<SegmentTable>) -> Self {
            let cloud = CloudWorker::new(&setup.rig, Arc::clone(table)).unwrap();
            let phase = phase::new_worker(configuration, setup).unwrap();
            Self(phase, correspondence::new_worker(configuration, setup, table).unwrap(), cloud)
        }

        fn results(&mut self, first_step: usize, wall: &WarmUp<'_>) -> (PhasePair, Correspondences, Cloud) {
            let (mut maps, mut found, mut cloud) = <(PhasePair, Correspondences, Cloud)>::default();
            wall.decode(first_step, &mut self.0, &mut maps);
            self.1.step(&maps, &mut found).unwrap();
            self.2.step(&found, &mut cloud);
            (maps, found, cloud)
        }
    }

    #[test]
    fn a_warm_worker_and_a_fresh_one_give_the_same_bytes() {
        let (configuration, setup, table) = scanner();
        let depth_m = middle_of_volume_m(&setup).unwrap();
        let warm_up = WarmUp::new(&configuration, &setup, depth_m);
        let mut warm = Chain::new(&configuration, &setup, &table);
        let (mut maps, mut found, mut cloud) = <(PhasePair, Correspondences, Cloud)>::default();
        warm_up.decode(0, &mut warm.0, &mut maps);
        warm.1.step(&warm_up.maps().unwrap(), &mut found).unwrap();
        warm_up.triangulate(&table, &mut warm.2, &mut cloud).unwrap();
        // The wall reaches all of the pixels, so the warm-up uses as much memory as any window.
        let seen = found.matches.outcomes.iter().filter(|outcome| outcome.is_found()).count();
        assert!(2 * seen > setup.image_pixels() && cloud.points.len() == seen, "{seen} of {}", setup.image_pixels());
        for (first_step, nearer_m) in [(1, 0.004), (2, -0.003)] {
            let window = WarmUp::new(&configuration, &setup, depth_m - nearer_m);
            let fresh = Chain::new(&configuration, &setup, &table).results(first_step, &window);
            assert!(fresh.2.points.len() > seen / 2);
            assert!(warm.results(first_step, &window) == fresh, "step {first_step}");
        }
    }

    #[test]
    fn a_wall_that_cannot_be_searched_is_not_triangulated() {
        let (configuration, setup, table) = scanner();
        let mut dark = WarmUp::new(&configuration, &setup, middle_of_volume_m(&setup).unwrap());
        dark.images.iter_mut().flatten().for_each(|image| image.fill(0));
        let mut worker = CloudWorker::new(&setup.rig, Arc::clone(&table)).unwrap();
        let mut cloud = Cloud::default();
        dark.triangulate(&table, &mut worker, &mut cloud).unwrap();
        assert!(cloud.points.is_empty());
    }

    #[test]
    fn deep_images_have_the_same_grey_levels() {
        let turns = [0.0, 0.25, 0.5];
        assert_eq!(image(&turns, 0.0, PixelFormat::Grey), [160, 100, 40]);
        let deep: Vec<u16> =
            image(&turns, 0.0, PixelFormat::Y12).chunks(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
        assert_eq!(deep, [2560, 1600, 640]);
    }
}
