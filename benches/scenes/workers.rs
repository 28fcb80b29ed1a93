//! The three workers, one after the other in one thread. In an instance, each has its own process.

use std::sync::Arc;

use fringeflow::cloud::Cloud;
use fringeflow::correspondence::{MatchSettings, SegmentTable};
use fringeflow::phase::Validity;
use fringeflow::worker::{CloudWorker, CorrespondenceWorker, Correspondences, PhasePair, PhaseWorker};
use fringeflow_base::grey::GreyLevels;

use super::{Scene, shifts};

/// The workers and their outputs.
pub(crate) struct Workers {
    phase: PhaseWorker,
    correspondence: CorrespondenceWorker,
    cloud: CloudWorker,
    pub(crate) maps: PhasePair,
    pub(crate) found: Correspondences,
    pub(crate) points: Cloud,
}

impl Workers {
    /// Creates workers for a scene and a number of steps.
    pub(crate) fn new(scene: &Scene, steps: usize) -> Self {
        Self::with_table(scene, Arc::new(scene.table()), steps)
    }

    /// Creates workers with an existing segment table.
    pub(crate) fn with_table(scene: &Scene, table: Arc<SegmentTable>, steps: usize) -> Self {
        Self::with_settings(scene, table, steps, MatchSettings::default())
    }

    /// Creates workers with an existing segment table and other settings.
    pub(crate) fn with_settings(
        scene: &Scene,
        table: Arc<SegmentTable>,
        steps: usize,
        settings: MatchSettings,
    ) -> Self {
        let (rig, shifts) = (&scene.rig.calibrated, shifts(steps));
        Self {
            phase: PhaseWorker::new(rig, &scene.rig.columns, &shifts, Validity::default()),
            correspondence: CorrespondenceWorker::new(Arc::clone(&table), &shifts, settings),
            cloud: CloudWorker::new(rig, table).unwrap(),
            maps: PhasePair::default(),
            found: Correspondences::default(),
            points: Cloud::default(),
        }
    }

    /// Makes the cloud of a window that starts with step `first_step`.
    pub(crate) fn cloud(&mut self, first_step: usize, window: &[Vec<GreyLevels<'_>>; 2]) -> &Cloud {
        self.decode(first_step, window);
        self.search();
        self.triangulate()
    }

    /// Computes the phase maps of the images.
    pub(crate) fn decode(&mut self, first_step: usize, [cam1, cam2]: &[Vec<GreyLevels<'_>>; 2]) {
        self.phase.step(first_step, cam1, cam2, None, &mut self.maps).unwrap();
    }

    /// Computes the correspondences of the phase maps.
    pub(crate) fn search(&mut self) {
        self.correspondence.step(&self.maps, &mut self.found).unwrap();
    }

    /// Computes the points of the correspondences.
    pub(crate) fn triangulate(&mut self) -> &Cloud {
        self.cloud.step(&self.found, &mut self.points);
        &self.points
    }
}
