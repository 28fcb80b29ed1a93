//! The search for candidates against its oracle over random rigs, and the whole chain on a simulated scene.

#![expect(clippy::unwrap_used, reason = "a rig that cannot be built fails the test")]

use std::f64::consts::TAU;

use fringeflow::correspondence::{DeltaGate, EpipolarImage, OutcomeCounts, SearchForm, SegmentTable, find_candidates};
use fringeflow::dataset::CameraId;
use fringeflow::geometry::{
    Camera, Distortion, EpipolarFrame, FringePattern, MeasurementVolume, Pixel, Point3, Pose, Rig, Vector3,
};
use fringeflow::phase::{PhaseMap, PhaseShifts};
use fringeflow::reconstruction::{Reconstruction, Reconstructor, Settings};
use fringeflow::simulation::{
    Arrangement, Board, ImageSeed, NoiseLevel, Object, Projected, RigOptions, Sensor, Simulation, SimulationOptions,
};

/// Repeatable numbers in [0, 1).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / f64::from(1 << 24)
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }

    fn camera(&mut self, size_px: [usize; 2], focal_px: f64, distorted: bool) -> Camera {
        let mut coefficient = |limit: f64| if distorted { self.between(-limit, limit) } else { 0.0 };
        let d = [coefficient(0.2), coefficient(0.3), coefficient(2e-3), coefficient(2e-3), 0.0];
        let [width, height] = size_px;
        Camera::new(
            [focal_px, 1.01 * focal_px],
            [0.5 * width as f64, 0.48 * height as f64],
            Distortion::from_opencv(&d),
            size_px,
        )
    }

    /// A rig with toed-in cameras, side by side or one above the other, the projector within the base or beyond.
    fn rig(&mut self) -> (Rig, MeasurementVolume, FringePattern) {
        let distorted = self.next() < 0.5;
        let vertical = self.next() < 0.3;
        let base = if vertical { Vector3::y() } else { Vector3::x() } * self.between(0.06, 0.14);
        // Now and then exactly at C1, where the back-projection phase does not change along a segment.
        let place = if self.next() < 0.1 { 0.0 } else { self.between(-0.6, 1.6) };
        let target = Point3::new(0.5 * base.x, 0.5 * base.y, 0.3);
        let off_base =
            Vector3::new(if vertical { self.between(-0.05, 0.05) } else { 0.0 }, self.between(-0.05, 0.05), 0.0);
        let rig = Rig {
            cam1: self.camera([96, 80], 270.0, distorted),
            cam2: self.camera([100, 84], 280.0, distorted),
            projector: self.camera([1024, 1024], 2400.0, distorted),
            cam2_from_cam1: looking_at(&Point3::from(base), &target),
            projector_from_cam1: looking_at(
                &Point3::from(if place == 0.0 { Vector3::zeros() } else { base * place + off_base }),
                &target,
            ),
        };
        let pose = Pose::translation(target.x, target.y, target.z);
        let half_depth = self.between(0.008, 0.03);
        let half = Vector3::new(0.05, 0.04, half_depth);
        let volume = MeasurementVolume::new(pose, Point3::from(-half), Point3::from(half)).unwrap();
        let sign = if self.next() < 0.5 { 1.0 } else { -1.0 };
        let pattern = FringePattern { period_px: self.between(8.0, 40.0), sign, offset_rad: self.between(0.0, TAU) };
        (rig, volume, pattern)
    }

    /// A phase map: a smooth slope with jumps and holes, or noise.
    fn map(&mut self, width: usize, height: usize) -> PhaseMap {
        let (du, dv, noisy) = (self.between(-9000.0, 9000.0), self.between(-3000.0, 3000.0), self.next() < 0.3);
        let jump = self.between(0.0, width as f64) as usize;
        let phase = |i: usize, random: f64| {
            let (u, v) = (i % width, i / width);
            let step = if u > jump { 20_000.0 } else { 0.0 };
            if noisy { (random * 65536.0) as i64 as u16 } else { (u as f64 * du + v as f64 * dv + step) as i64 as u16 }
        };
        PhaseMap {
            width,
            height,
            phase: (0..width * height).map(|i| phase(i, self.next())).collect(),
            valid: (0..width * height).map(|_| self.next() < 0.97).collect(),
            modulation: vec![50.0; width * height],
            mean: vec![100; width * height],
            ..PhaseMap::default()
        }
    }
}

/// Pose `device_from_cam1` of a device at `centre` whose axis meets `target`.
fn looking_at(centre: &Point3, target: &Point3) -> Pose {
    let z = (target - centre).normalize();
    let x = Vector3::y().cross(&z).normalize();
    let y = z.cross(&x);
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_rows(&[
        x.transpose(),
        y.transpose(),
        z.transpose(),
    ]));
    let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
    Pose::from_parts((rotation * -centre.coords).into(), rotation)
}

#[test]
fn the_projector_side_search_finds_what_the_plain_scan_finds() {
    let mut random = Random(7);
    let mut candidates = 0;
    for case in 0..60 {
        let (rig, volume, pattern) = random.rig();
        let table = SegmentTable::build(&rig, &volume, &pattern).unwrap();
        let (cam1, cam2) = (random.map(96, 80), random.map(100, 84));
        let image = EpipolarImage::resample(&cam2, &table).unwrap();
        for threshold_turns in [0.002, 0.02, 0.1, 0.3, 0.6] {
            let gate = DeltaGate { mean_turns: random.between(-0.05, 0.05) as f32, threshold_turns };
            let plain = find_candidates(&cam1, &image, &table, &gate, SearchForm::PlainScan);
            let fast = find_candidates(&cam1, &image, &table, &gate, SearchForm::ProjectorSide);
            assert!(plain == fast, "case {case}, threshold {threshold_turns}");
            candidates += plain.all().len();
        }
    }
    assert!(candidates > 100_000, "the rigs hardly had candidates: {candidates}");
}

#[test]
fn every_point_of_the_volume_lies_on_its_segment() {
    let mut random = Random(11);
    let mut seen = 0;
    for _ in 0..40 {
        let (rig, volume, pattern) = random.rig();
        let (table, frame) = (SegmentTable::build(&rig, &volume, &pattern).unwrap(), EpipolarFrame::new(&rig).unwrap());
        for _ in 0..300 {
            let (u, v) = (random.between(0.0, 96.0) as usize, random.between(0.0, 80.0) as usize);
            let segment = &table.segments()[v * 96 + u];
            let ray = rig.cam1.ray(&Pixel::new(u as f64, v as f64)).unwrap();
            let Some((near_m, far_m)) = volume.clip(&ray) else { continue };
            let point = Point3::from(ray * random.between(near_m, far_m));
            let within = |p: &Pixel| (0.0..=99.0).contains(&p.x) && (0.0..=83.0).contains(&p.y);
            let Some(raw) = rig.project_cam2(&point).filter(within) else { continue };
            assert!(!segment.is_none());
            let line = frame.line(&ray).unwrap();
            let column = line.column_of_depth(point.z);
            let on_line = frame.cam2_pixel(&Pixel::new(column, f64::from(segment.row_px))).unwrap();
            assert!((on_line - raw).norm() < 1e-3, "{on_line} {raw}");
            assert!(column >= f64::from(segment.begin_px) - 1e-3 && column <= f64::from(segment.end_px) + 1e-3);
            let wanted = pattern.phase_turns(rig.project_projector(&point).unwrap().x);
            assert!((f64::from(segment.phase_turns(column as f32)) - wanted).abs() < 2e-3);
            seen += 1;
        }
    }
    assert!(seen > 3000, "only {seen} points were seen");
}

fn simulation() -> Simulation {
    Simulation::new(SimulationOptions {
        object: Object::Prism,
        board: Board::Visible,
        rig: RigOptions {
            arrangement: Arrangement::TABLE_TOP,
            size_px: [320, 256],
            depth_m: 0.025,
            period_px: 16.0,
            sd_rad: 0.041,
            seed: 3,
        },
        steps: 4,
        two_directions: false,
        gray: false,
        noise: NoiseLevel::Normal,
        gamma: 1.0,
        supersampling: 1,
        seed: 3,
    })
    .unwrap()
}

fn reconstruct(simulation: &Simulation) -> Reconstruction {
    let rig = simulation.rig();
    let table = SegmentTable::build(&rig.calibrated, &rig.volume, &rig.columns).unwrap();
    let sensor = Sensor::exposed(NoiseLevel::Normal.noise(), 1.0);
    let fringes: Vec<(f64, Projected)> = simulation
        .images()
        .into_iter()
        .filter_map(|(_, pattern)| match pattern {
            Projected::Fringes { shift_rad, .. } => Some((shift_rad, pattern)),
            _ => None,
        })
        .collect();
    let [cam1, cam2] = CameraId::BOTH.map(|camera| {
        let view = &simulation.views()[camera as usize];
        let image = |(k, (_, pattern)): (usize, &(f64, Projected))| {
            sensor.image(view, pattern, ImageSeed { seed: 3, camera: camera as u8, image: k as u32 }).pixels
        };
        fringes.iter().enumerate().map(image).collect::<Vec<_>>()
    });
    let shifts = PhaseShifts::new(&fringes.iter().map(|(s, _)| *s).collect::<Vec<_>>()).unwrap();
    let reconstructor = Reconstructor::new(&rig.calibrated, table, shifts, Settings::default()).unwrap();
    reconstructor.reconstruct(&slices(&cam1), &slices(&cam2)).unwrap()
}

fn slices(images: &[Vec<u8>]) -> Vec<&[u8]> {
    images.iter().map(Vec::as_slice).collect()
}

#[test]
fn a_simulated_scene_is_reconstructed_and_every_pixel_accounted_for() {
    let simulation = simulation();
    let made = reconstruct(&simulation);
    let truth = simulation.truth();
    let counts = OutcomeCounts::of(&made.matches.outcomes);
    assert_eq!(counts.iter().map(|(_, n)| n).sum::<u64>(), 320 * 256);
    let found: u64 = counts.iter().filter(|(o, _)| o.is_found()).map(|(_, n)| n).sum();
    assert_eq!(found, made.cloud.points.len() as u64);
    let (mut right, mut wrong) = (0, 0);
    for point in &made.cloud.points {
        let pixel = usize::from(point.cam1_px[1]) * 320 + usize::from(point.cam1_px[0]);
        if truth.measurable[pixel] {
            let [u, v] = truth.cam2_px[pixel];
            let off = (point.cam2_px[0] - u).hypot(point.cam2_px[1] - v);
            if off <= 2.0 { right += 1 } else { wrong += 1 }
        }
    }
    let measurable = truth.measurable.iter().filter(|&&m| m).count();
    assert!(right * 1000 > measurable * 975, "{right} of {measurable} found");
    assert!(wrong * 1000 < measurable * 3, "{wrong} of {measurable} wrong");
    let deltas: Vec<f64> = made.cloud.points.iter().map(|p| f64::from(p.delta_rad)).filter(|d| d.abs() < 0.5).collect();
    let mean = deltas.iter().sum::<f64>() / deltas.len() as f64;
    let sd = (deltas.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / deltas.len() as f64).sqrt();
    assert!(
        (made.matches.delta.sd_rad / sd - 1.0).abs() < 0.25,
        "{} measured, {sd} over the points",
        made.matches.delta.sd_rad
    );
}

#[test]
fn the_number_of_threads_does_not_show() {
    let simulation = simulation();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| reconstruct(&simulation))
    };
    assert!(with(1) == with(3));
}
