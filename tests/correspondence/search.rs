//! The search for candidates against reference implementations, over random rigs.

use fringeflow::correspondence::{DeltaGate, EpipolarImage, SegmentTable, find_candidates, find_unique_candidates};
use fringeflow::geometry::{EpipolarFrame, FringePattern, MeasurementVolume, Pixel, Point3, Rig};
use fringeflow::phase::{Modulation, PhaseMap};
use fringeflow_simd::Level;

use crate::random::Random;

#[test]
fn unique_candidates_are_the_single_ones_of_the_full_search() {
    let mut random = Random(7);
    let mut unique_count = 0;
    for case in 0..60 {
        let (rig, volume, pattern) = random.rig();
        let table = SegmentTable::build(&rig, &volume, &pattern).unwrap();
        let (cam1, cam2) = (random.map(96, 80), random.map(100, 84));
        let image = EpipolarImage::resample(&cam2, &table).unwrap();
        for threshold_turns in [0.002, 0.02, 0.1, 0.3, 0.6] {
            let gate = DeltaGate { mean_turns: random.between(-0.05, 0.05) as f32, threshold_turns };
            let all = find_candidates(&cam1, &image, &table, &gate);
            for level in Level::ALL {
                level.limit_to();
                let unique = find_unique_candidates(&cam1, &image, &table, &gate);
                for (pixel, (&absolute, &delta)) in unique.absolute.iter().zip(&unique.delta).enumerate() {
                    let found = (absolute != i32::MIN).then_some((absolute, delta));
                    let expected = match all.for_pixel(pixel) {
                        [c] => Some((i32::from(c.order) * 65536 + i32::from(cam1.phase[pixel]), c.delta)),
                        _ => None,
                    };
                    assert_eq!(found, expected, "case {case}, threshold {threshold_turns}, {}, {pixel}", level.name());
                    unique_count += usize::from(found.is_some());
                }
            }
        }
    }
    assert!(unique_count > 100_000, "only {unique_count} unique candidates were compared");
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
            let segment = table.segment(v * 96 + u);
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
            let expected = pattern.phase_turns(rig.project_projector(&point).unwrap().x);
            assert!((f64::from(segment.phase_turns(column as f32)) - expected).abs() < 2e-3);
            seen += 1;
        }
    }
    assert!(seen > 3000, "only {seen} points were seen");
}

#[test]
fn of_two_points_at_one_place_of_camera_2_the_nearer_is_known() {
    let mut random = Random(13);
    let mut compared = 0;
    for _ in 0..40 {
        let (rig, volume, pattern) = random.rig();
        let table = SegmentTable::build(&rig, &volume, &pattern).unwrap();
        let cam1_from_cam2 = rig.cam2_from_cam1.inverse();
        for _ in 0..200 {
            let place = Pixel::new(random.between(0.0, 99.0), random.between(0.0, 83.0));
            let ray = rig.cam2.ray(&place).unwrap();
            let near_m = random.between(0.25, 0.33);
            let pixel_at = |depth_m: f64| {
                let pixel = rig.cam1.project(&(cam1_from_cam2 * Point3::from(ray * depth_m)))?;
                let (u, v) = (pixel.x.round(), pixel.y.round());
                let inside = (0.0..96.0).contains(&u) && (0.0..80.0).contains(&v);
                inside.then(|| v as usize * 96 + u as usize)
            };
            let (Some(near), Some(far)) = (pixel_at(near_m), pixel_at(near_m + 0.04)) else { continue };
            if !table.has_segment(near) || !table.has_segment(far) {
                continue;
            }
            assert!(table.nearness_to_cam2(near) > table.nearness_to_cam2(far), "{place} at {near_m} m");
            compared += 1;
        }
    }
    assert!(compared > 1000, "only {compared} pairs were compared");
}

/// A phase that changes linearly over the raw image of camera 2, turns.
#[derive(Clone, Copy)]
struct PhasePlane {
    du: f64,
    dv: f64,
    offset: f64,
}

impl PhasePlane {
    fn at(self, pixel: &Pixel) -> f64 {
        self.du * pixel.x + self.dv * pixel.y + self.offset
    }

    fn map(self, width: usize, height: usize) -> PhaseMap {
        let phase = |i: usize| {
            let turns = self.at(&Pixel::new((i % width) as f64, (i / width) as f64));
            ((turns - turns.floor()) * 65536.0) as u16
        };
        PhaseMap {
            width,
            height,
            phase: (0..width * height).map(phase).collect(),
            valid: vec![true; width * height],
            modulation: vec![Modulation::from_grey(50.0); width * height],
            mean: vec![100; width * height],
            ..PhaseMap::default()
        }
    }
}

/// A point on a ray of camera 1 at which camera 2 sees the phase of the pixel.
struct Crossing {
    cam2_px: Pixel,
    /// Back-projection phase, turns.
    projected_turns: f64,
    /// Whether it is clearly inside the volume and the image of camera 2.
    is_certain: bool,
}

/// Finds crossings by stepping along a ray of camera 1, from in front of the volume to behind it, and looking up the
/// raw image of camera 2. Uses neither epipolar frame nor table. Returns `None` if the phase hardly changes along the
/// ray, so that rounding would decide.
fn find_crossings(
    rig: &Rig,
    volume: &MeasurementVolume,
    pattern: &FringePattern,
    plane: PhasePlane,
    pixel: Pixel,
    phase_turns: f64,
) -> Option<Vec<Crossing>> {
    const STEPS: u32 = 3000;
    let ray = rig.cam1.ray(&pixel)?;
    let (near_m, far_m) = volume.clip(&ray)?;
    let margin_m = 0.05 * (far_m - near_m);
    let depth = |k: u32| near_m - margin_m + (far_m - near_m + 2.0 * margin_m) * f64::from(k) / f64::from(STEPS);
    let project = |depth_m: f64| rig.project_cam2(&Point3::from(ray * depth_m));
    let mut crossings = Vec::new();
    for k in 0..STEPS {
        let (before, after) = (project(depth(k))?, project(depth(k + 1))?);
        let rise = plane.at(&after) - plane.at(&before);
        if rise.abs() < 0.01 * (after - before).norm() {
            return None;
        }
        let (a, b) = (plane.at(&before) - phase_turns, plane.at(&after) - phase_turns);
        if a.floor() != b.floor() {
            let share = (a.max(b).floor() - a) / (b - a);
            let depth_m = depth(k) + share * (depth(k + 1) - depth(k));
            let cam2_px = project(depth_m)?;
            let in_image = (1.0..98.0).contains(&cam2_px.x) && (1.0..82.0).contains(&cam2_px.y);
            crossings.push(Crossing {
                cam2_px,
                projected_turns: pattern.phase_turns(rig.project_projector(&Point3::from(ray * depth_m))?.x),
                is_certain: in_image && (near_m..far_m).contains(&depth_m),
            });
        }
    }
    Some(crossings)
}

#[test]
fn candidates_are_the_crossings_in_the_raw_image() {
    let mut random = Random(17);
    let (mut certain, mut candidates) = (0, 0);
    for case in 0..40 {
        let (rig, volume, pattern) = random.rig();
        let (table, frame) = (SegmentTable::build(&rig, &volume, &pattern).unwrap(), EpipolarFrame::new(&rig).unwrap());
        let plane =
            PhasePlane { du: random.between(-0.12, 0.12), dv: random.between(-0.12, 0.12), offset: random.next() };
        let cam1 = random.map(96, 80);
        let image = EpipolarImage::resample(&plane.map(100, 84), &table).unwrap();
        let gate = DeltaGate { mean_turns: 0.0, threshold_turns: 0.6 };
        let lists = find_candidates(&cam1, &image, &table, &gate);
        for _ in 0..160 {
            let (u, v) = (random.between(0.0, 96.0) as usize, random.between(0.0, 80.0) as usize);
            let pixel = v * 96 + u;
            if !cam1.valid[pixel] {
                continue;
            }
            let phase_turns = f64::from(cam1.phase[pixel]) / 65536.0;
            let place = Pixel::new(u as f64, v as f64);
            let Some(crossings) = find_crossings(&rig, &volume, &pattern, plane, place, phase_turns) else { continue };
            let found: Vec<(Pixel, f64)> = lists
                .for_pixel(pixel)
                .iter()
                .map(|c| {
                    let row = f64::from(table.row_px(pixel));
                    let back_projected = f64::from(c.order) + phase_turns + f64::from(c.delta) / 65536.0;
                    (frame.cam2_pixel(&Pixel::new(f64::from(c.column_px), row)).unwrap(), back_projected)
                })
                .collect();
            let same = |crossing: &Crossing, &(cam2_px, turns): &(Pixel, f64)| {
                (crossing.cam2_px - cam2_px).norm() < 0.05 && (crossing.projected_turns - turns).abs() < 0.01
            };
            for crossing in crossings.iter().filter(|crossing| crossing.is_certain) {
                assert!(found.iter().any(|f| same(crossing, f)), "case {case}, {place}: {} missed", crossing.cam2_px);
                certain += 1;
            }
            for f in &found {
                assert!(crossings.iter().any(|crossing| same(crossing, f)), "case {case}, {place}: {} is false", f.0);
                candidates += 1;
            }
        }
    }
    assert!(certain > 1000 && candidates >= certain, "{certain} crossings, {candidates} candidates");
}
