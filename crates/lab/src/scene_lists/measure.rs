//! Measures a scene of a list: takes its images in memory, finds the cloud by two methods, and compares both with the
//! exact truth.

use fringeflow::correspondence::{ResolutionMethod, SegmentTable, SegmentTableError};
use fringeflow::geometry::EpipolarError;
use fringeflow::phase::{PhaseShifts, ShiftError};
use fringeflow::reconstruction::{Reconstruction, ReconstructionError, Reconstructor, Settings};
use fringeflow_dataset::{CameraId, GreyImage};
use rayon::prelude::*;
use serde::Serialize;

use super::ListedScene;
use crate::evaluation::{Evaluation, EvaluationError, Frames, Scores, against_rendered};
use crate::preview::{Picture, judgement_picture, modulation_picture, outcome_picture, phase_picture};
use crate::simulation::{Simulation, SimulationError};

/// Why a scene cannot be measured.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The scene is not possible.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The rig has no segment table.
    #[error(transparent)]
    Table(#[from] SegmentTableError),
    /// The rig has no epipolar frame.
    #[error(transparent)]
    Epipolar(#[from] EpipolarError),
    /// The phase shifts determine no phase.
    #[error(transparent)]
    Shifts(#[from] ShiftError),
    /// The method finds no cloud.
    #[error(transparent)]
    Reconstruction(#[from] ReconstructionError),
    /// The cloud cannot be compared, as without a single point that can be measured.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
}

/// Figures of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SceneFigures {
    /// Mean number of periods on a segment: n.
    pub mean_periods: f64,
    /// Standard deviation of δ that the calibration error causes, rad.
    pub sd_rad: f64,
    /// Expected false candidates by Eq. (1), from the two above.
    pub efc: f64,
    /// Scores of the method that was asked for.
    pub scores: Scores,
    /// Scores of the paper's method; `None` if it finds no cloud.
    pub paper: Option<Scores>,
}

/// A measured scene, with the results of the method that was asked for.
pub struct MeasuredScene {
    /// The figures.
    pub figures: SceneFigures,
    /// Scores and judgements.
    evaluation: Evaluation,
    reconstruction: Reconstruction,
    size_px: [usize; 2],
}

impl ListedScene {
    /// Takes the images of the scene, finds the cloud with these settings, and compares it with the truth.
    ///
    /// # Errors
    /// [`SceneError`].
    pub fn reconstruct(&self, settings: Settings) -> Result<(Reconstruction, Evaluation), SceneError> {
        let simulation = self.simulation()?;
        Window::take(self, &simulation)?.measure(&simulation, simulation.segment_table()?, settings)
    }

    /// Measures the scene by a method, and by the paper's.
    ///
    /// # Errors
    /// [`SceneError`]. A failure of the paper's method beside another is none.
    pub fn measure(&self, method: ResolutionMethod) -> Result<MeasuredScene, SceneError> {
        let simulation = self.simulation()?;
        let window = Window::take(self, &simulation)?;
        let table = simulation.segment_table()?;
        let settings_of = |method| {
            let mut settings = Settings::default();
            settings.matching.method = method;
            settings
        };
        let (reconstruction, evaluation) = window.measure(&simulation, table.clone(), settings_of(method))?;
        let paper = window.measure(&simulation, table, settings_of(ResolutionMethod::Paper));
        let summary = simulation.summary();
        let figures = SceneFigures {
            mean_periods: summary.mean_periods,
            sd_rad: summary.calibration_error.delta_rms,
            efc: summary.expected_false_candidates,
            scores: evaluation.scores,
            paper: paper.ok().map(|(_, evaluation)| evaluation.scores),
        };
        Ok(MeasuredScene { figures, evaluation, reconstruction, size_px: self.options.rig.size_px })
    }
}

/// Measures scenes by a method, several at once. Calls `on_scene` after each. The figures are in the order of the scenes.
pub fn measure_all(
    scenes: &[ListedScene],
    method: ResolutionMethod,
    on_scene: impl Fn() + Sync,
) -> Vec<Result<SceneFigures, SceneError>> {
    let measure = |scene: &ListedScene| {
        let figures = scene.measure(method).map(|measured| measured.figures);
        on_scene();
        figures
    };
    scenes.par_iter().map(measure).collect()
}

impl MeasuredScene {
    /// Pictures of right and wrong points, outcomes, wrapped phase and modulation, with their names.
    #[must_use]
    pub fn pictures(&self) -> [(&'static str, Picture); 4] {
        let Reconstruction { matches, cam1, .. } = &self.reconstruction;
        [
            ("judgement", judgement_picture(&self.evaluation.judgements, self.size_px)),
            ("decisions", outcome_picture(&matches.outcomes, self.size_px)),
            ("phase", phase_picture(cam1)),
            ("modulation", modulation_picture(cam1)),
        ]
    }
}

/// The images of one cloud.
pub(super) struct Window {
    /// Phase shifts of a cycle, rad.
    shifts: PhaseShifts,
    /// Index of the first image in the cycle.
    first_step: usize,
    /// Images of C1 and of C2.
    images: [Vec<GreyImage>; 2],
}

impl Window {
    /// Takes the images: one cycle, and with motion as many more as the method usually takes, around the moment of the
    /// truth.
    pub(super) fn take(scene: &ListedScene, simulation: &Simulation) -> Result<Self, SceneError> {
        let steps = scene.options.steps;
        let (all, count) = match scene.staging.motion {
            Some(motion) => (steps * motion.cycles, Settings::default().window_images(steps)),
            None => (steps, steps),
        };
        let first = all.saturating_sub(count) / 2;
        let shifts = PhaseShifts::new(&simulation.cycle_shifts_rad())?;
        let take = |camera| {
            let images = (first..first + count).map(|number| simulation.phase_image(camera, number));
            images.collect::<Result<Vec<_>, _>>()
        };
        let images = [take(CameraId::Cam1)?, take(CameraId::Cam2)?];
        Ok(Self { shifts, first_step: first % steps, images })
    }

    /// Finds the cloud with these settings and compares it with the truth.
    pub(super) fn measure(
        &self,
        simulation: &Simulation,
        table: SegmentTable,
        settings: Settings,
    ) -> Result<(Reconstruction, Evaluation), SceneError> {
        let rig = simulation.rig();
        let mut reconstructor = Reconstructor::new(&rig.calibrated, &rig.columns, table, &self.shifts, settings)?;
        let [cam1, cam2] = self.images.each_ref().map(|images| GreyImage::levels_of(images));
        let reconstruction = reconstructor.reconstruct(self.first_step, &cam1, &cam2, None)?;
        let frames = Frames {
            cam1_from_volume: *rig.volume.cam1_from_volume(),
            exact_cam1_from_volume: *rig.exact_volume.cam1_from_volume(),
            unit_m: Simulation::TRUTH_UNIT.in_metres(),
        };
        let size_px = simulation.options().rig.size_px;
        let evaluation = against_rendered(&reconstruction.cloud, size_px, simulation.truth(), &frames)?;
        Ok((reconstruction, evaluation))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene_lists::{SceneKind, SceneList};

    /// The scene with small images and wide fringes, which take little time.
    fn small(number: usize) -> ListedScene {
        let mut scene = SceneList::Build.scene(number);
        scene.options.rig.size_px = [160, 128];
        scene.options.rig.period_px = 40.0;
        scene.options.supersampling = 1;
        scene
    }

    #[test]
    fn an_isolated_and_a_moving_scene_are_measured_the_same_every_time() {
        let method = ResolutionMethod::Moments;
        for kind in [SceneKind::Isolated, SceneKind::Moving] {
            let number = (0..).find(|&number| SceneList::Build.scene(number).kind == kind).unwrap();
            let measured = small(number).measure(method).unwrap();
            let scores = measured.figures.scores;
            assert!(scores.reference > 500 && scores.com_percent > 50.0, "{kind:?}: {scores:?}");
            assert!(measured.figures.paper.is_some());
            let names = measured.pictures().map(|(name, picture)| (name, picture.pixels().is_empty()));
            assert_eq!(names.map(|(name, _)| name)[0], "judgement");
            assert!(names.iter().all(|(_, is_empty)| !is_empty));
            assert_eq!(small(number).measure(method).unwrap().figures, measured.figures);
        }
    }
}
