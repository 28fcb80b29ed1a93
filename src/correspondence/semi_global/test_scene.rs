//! A plane with noise and holes, on which kernels are compared with their scalar forms.

use crate::correspondence::reference_methods::test_scene::{PATTERN, Scene as Plane};
use crate::correspondence::{DeltaHistogram, DeltaStatistics, ResolutionSettings, measure_delta};
use crate::geometry::{MeasurementVolume, Point3, Pose};
use crate::phase::{AbsolutePhase, Modulation, PhaseMap};

use crate::correspondence::drift::{Drift, DriftScratch, estimate_drift};
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::scene::Scene;
use crate::correspondence::segment_table::SegmentTable;
use crate::correspondence::surfaces;
use crate::correspondence::test_random::random;
use crate::correspondence::view::View;

/// The plane, its phases and its table.
pub(in crate::correspondence) struct TestScene {
    pub(in crate::correspondence) cam1: PhaseMap,
    pub(in crate::correspondence) cam2: EpipolarImage,
    pub(in crate::correspondence) table: SegmentTable,
    pub(in crate::correspondence) delta: DeltaStatistics,
    /// True absolute phase of C1, turns.
    pub(in crate::correspondence) turns: Vec<f32>,
    drift: Drift,
}

impl TestScene {
    pub(in crate::correspondence) fn new() -> Self {
        Self::from_volume([0.26, 0.34])
    }

    /// The plane far behind the volume.
    pub(in crate::correspondence) fn behind() -> Self {
        Self::from_volume([0.2, 0.24])
    }

    /// Distances of the volume, metres; that of the plane is 0.3.
    fn from_volume([near_m, far_m]: [f64; 2]) -> Self {
        let plane = Plane::new();
        let (min, max) = (Point3::new(-0.1, -0.1, near_m), Point3::new(0.1, 0.1, far_m));
        let volume = MeasurementVolume::new(Pose::identity(), min, max).unwrap();
        let table = SegmentTable::build(&plane.rig, &volume, &PATTERN).unwrap();
        let (cam1, cam2) = (seen(&plane.cam1_columns(), 3), seen(&plane.cam2_columns(), 5));
        let cam2 = EpipolarImage::resample(&cam2, &table).unwrap();
        let histogram = DeltaHistogram::from_all_candidates(&cam1, &cam2, &table, 0);
        let delta = measure_delta(&cam1, &cam2, &table, &histogram, ResolutionSettings::default().min_votes).unwrap();
        let drift = estimate_drift(&cam1, &cam2, &table, &delta);
        Self { cam1, cam2, table, delta, turns: plane.cam1_columns().turns, drift }
    }

    /// Its surfaces.
    pub(super) fn surfaces(&self) -> surfaces::Scratch {
        let mut scratch = surfaces::Scratch::default();
        surfaces::explain(self.view(), &self.delta, None, &mut scratch, &mut DriftScratch::default());
        scratch
    }

    /// Its inputs of matching.
    pub(in crate::correspondence) fn view(&self) -> View<'_> {
        View { cam1: &self.cam1, cam2: &self.cam2, table: &self.table }
    }

    pub(super) fn scene(&self) -> Scene<'_> {
        Scene { view: self.view(), drift: &self.drift }
    }
}

/// The phase as a camera sees it: with noise, some pixels off by any amount, some invalid.
fn seen(absolute: &AbsolutePhase, seed: u64) -> PhaseMap {
    let mut random = random(seed);
    let pixels = absolute.turns.len();
    let mut phase = Vec::with_capacity(pixels);
    for turns in &absolute.turns {
        let noise = random(900) as i32 - 450 + if random(50) == 0 { random(65536) as i32 } else { 0 };
        phase.push(((turns.rem_euclid(1.0) * 65536.0) as i32 + noise) as u16);
    }
    let modulation = (0..pixels).map(|_| Modulation::from_steps(4000 + random(9000) as u16)).collect();
    let valid = absolute.valid.iter().map(|&valid| valid && random(30) > 0).collect();
    PhaseMap { width: absolute.width, height: absolute.height, phase, modulation, valid, ..PhaseMap::default() }
}
