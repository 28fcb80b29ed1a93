//! Priors from earlier windows: with the right prior, a moving scene is measured nearly as well as one at rest. A wrong
//! prior makes no false points.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a dataset that cannot be written fails the test")]

use fringeflow::correspondence::{Drift, KnownDrift, SegmentTable};
use fringeflow::geometry::Vector3;
use fringeflow::phase::PhaseShifts;
use fringeflow::prior::{Moment, Prior, Relief, RigidMotion, WindowTimes};
use fringeflow::reconstruction::{Reconstruction, Reconstructor, Settings};
use fringeflow_dataset::{CameraId, Dataset, GreyImage, Truth};
use fringeflow_lab::evaluation::{Frames, Scores, against_rendered};
use fringeflow_lab::simulation::{
    Board, MotionOptions, NoiseLevel, Object, RigOptions, Simulation, SimulationOptions, Staging,
};
use fringeflow_tracking::TrackedStream;
use fringeflow_tracking::fusion::{FusionSettings, Tracker};

const SIZE_PX: [usize; 2] = [320, 256];
const STEPS: usize = 4;
const WINDOW: usize = 6;
/// First image of the window in the middle of the sequence, at the moment of the truth.
const MIDDLE: usize = 5;
const SPACING_NS: u64 = 10_000_000;

struct Scene {
    _folder: tempfile::TempDir,
    dataset: Dataset,
}

impl Scene {
    /// An object that moves by 0.5 mm and 0.1° from image to image.
    fn new() -> Self {
        let usual = SimulationOptions::usual(Object::Nose);
        let rig = RigOptions { size_px: SIZE_PX, period_px: 24.0, ..usual.rig };
        let options = SimulationOptions {
            board: Board::Visible,
            rig,
            steps: STEPS,
            noise: NoiseLevel::Normal,
            supersampling: 1,
            gray: false,
            ..usual
        };
        let motion =
            MotionOptions { mm_per_image: 0.5, deg_per_image: 0.1, cycles: 4, blur: 0.0, tremor: 0.02, seed: 1 };
        let simulation = Simulation::staged(options, Staging { motion: Some(motion), ..Staging::default() }).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("set");
        simulation.write(&target, || ()).unwrap();
        Self { dataset: Dataset::open(&target, None).unwrap(), _folder: folder }
    }

    fn reconstructor(&self) -> Reconstructor {
        let setup = &self.dataset.setup;
        let pattern = &setup.sequence.pattern;
        let table = SegmentTable::build(&setup.rig, setup.volume.as_ref().unwrap(), pattern).unwrap();
        let shifts = PhaseShifts::new(setup.cycle_shifts_rad()).unwrap();
        Reconstructor::new(&setup.rig, pattern, table, &shifts, Settings::default()).unwrap()
    }

    fn images(&self, start: usize) -> [Vec<GreyImage>; 2] {
        let numbers: Vec<usize> = (start..start + WINDOW).collect();
        CameraId::BOTH.map(|camera| self.dataset.phase_images(camera, &numbers).unwrap())
    }

    /// Reconstructs the window in the middle, with a prior if given.
    fn reconstruct_middle(&self, prior: Option<(&Prior, Moment)>) -> Reconstruction {
        let [cam1, cam2] = self.images(MIDDLE);
        let [cam1, cam2] = [&cam1, &cam2].map(|images| GreyImage::levels_of(images));
        self.reconstructor().reconstruct(MIDDLE % STEPS, &cam1, &cam2, prior).unwrap()
    }

    fn scores(&self, result: &Reconstruction) -> Scores {
        let Some(Truth::Rendered(truth)) = self.dataset.truth().unwrap() else {
            panic!("no truth of a rendered scene")
        };
        against_rendered(&result.cloud, SIZE_PX, &truth, &Frames::from_setup(&self.dataset.setup)).unwrap().scores
    }

    /// Reconstructs the same window as the last one of a tracked stream. Returns its prior too.
    fn reconstruct_stream(&self) -> (Reconstruction, Prior) {
        let tracker = Tracker::new(self.dataset.setup.rig.cam1, FusionSettings::default());
        let mut stream = TrackedStream::new(self.reconstructor(), tracker);
        let mut prior = None;
        for start in 0..=MIDDLE {
            let [cam1, cam2] = self.images(start);
            let [cam1, cam2] = [&cam1, &cam2].map(|images| GreyImage::levels_of(images));
            let first_ns = start as u64 * SPACING_NS;
            let times =
                WindowTimes { exposures_ns: [first_ns, first_ns + (WINDOW as u64 - 1) * SPACING_NS], images: WINDOW };
            let result = stream.reconstruct(start % STEPS, &cam1, &cam2, &times).unwrap();
            if start == MIDDLE {
                return (result, prior.unwrap());
            }
            stream.track(&result, &times);
            prior = stream.tracker().prior(result.matches.drift.as_ref().map(Drift::to_known));
        }
        panic!("the window in the middle was not reached")
    }
}

#[test]
fn a_right_prior_helps_and_a_wrong_one_does_no_harm() {
    let scene = Scene::new();
    let alone = scene.scores(&scene.reconstruct_middle(None));
    let (streamed, right) = scene.reconstruct_stream();
    let known = scene.scores(&streamed);
    assert!(known.com_percent > 96.5 && known.com_percent > alone.com_percent + 3.0, "{known:?}; alone {alone:?}");
    assert!(known.fpc_percent < 0.1, "{known:?}");

    let moment = Moment { age_s: 0.01, spacing_s: 0.01 };
    let with_motion = |velocity_m_s: Vector3, rate_rad_s: Vector3| Prior {
        motion: RigidMotion { velocity_m_s, rate_rad_s },
        relief: right.relief.clone(),
        drift: right.drift,
    };
    let with_drift = |index: usize, change: f32| {
        let mut numbers = right.drift.unwrap().to_numbers();
        numbers[index] += change;
        Prior { drift: KnownDrift::from_numbers(numbers), ..right.clone() }
    };
    let RigidMotion { velocity_m_s, rate_rad_s } = right.motion;
    let single_point = Relief::from_points(SIZE_PX, std::iter::once(([160, 128], 0.1)));
    let wrong_motions = [
        ("opposite direction", with_motion(-velocity_m_s, -rate_rad_s)),
        ("other direction", with_motion(Vector3::new(velocity_m_s.y, -velocity_m_s.z, velocity_m_s.x), rate_rad_s)),
        ("three times as fast", with_motion(3.0 * velocity_m_s, 3.0 * rate_rad_s)),
        ("a metre per image", with_motion(Vector3::repeat(60.0), Vector3::zeros())),
        ("spinning", with_motion(Vector3::zeros(), Vector3::repeat(40.0))),
        ("not a number", with_motion(Vector3::repeat(f64::NAN), rate_rad_s)),
        ("relief of another scene", Prior { relief: single_point, ..right.clone() }),
    ];
    let wrong_drifts = [
        ("δ off by 3°", with_drift(1, 0.008)),
        ("δ off by 15°", with_drift(1, 0.04)),
        ("a pixel off", with_drift(2, 1.0)),
        ("many pixels off", with_drift(3, -40.0)),
        ("unbounded", with_drift(4, f32::MAX)),
        ("no scatter", with_drift(0, -0.99 * right.drift.unwrap().to_numbers()[0])),
    ];
    for (name, prior) in wrong_drifts {
        let scores = scene.scores(&scene.reconstruct_middle(Some((&prior, moment))));
        assert!(scores.fpc_percent < known.fpc_percent + 0.02, "{name}: {scores:?}; known {known:?}");
        assert!(scores.com_percent > known.com_percent - 0.2, "{name}: {scores:?}; known {known:?}");
    }
    for (name, prior) in wrong_motions {
        let scores = scene.scores(&scene.reconstruct_middle(Some((&prior, moment))));
        assert!(scores.fpc_percent < alone.fpc_percent.max(0.05) + 0.05, "{name}: {scores:?}; alone {alone:?}");
        assert!(scores.com_percent > alone.com_percent - 1.0, "{name}: {scores:?}; alone {alone:?}");
    }
}
