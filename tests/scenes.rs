//! The harder scenes of the virtual scanner contain the difficulties that they are made for, and their ground truth
//! states them.

#![expect(clippy::unwrap_used, reason = "a scene that cannot be simulated fails the test")]

use fringeflow_dataset::CameraId;
use fringeflow_lab::simulation::{
    Board, BoardApart, ImageSeed, NoiseLevel, Object, Sensor, Simulation, SimulationOptions, Staging, Surface,
};
use fringeflow_patterns::Pattern;

const SIZE_PX: [usize; 2] = [640, 512];

fn options(object: Object, board: Board) -> SimulationOptions {
    let usual = SimulationOptions::usual(object);
    SimulationOptions { board, steps: 4, gray: false, noise: NoiseLevel::None, supersampling: 1, ..usual }
}

fn simulate(object: Object, board: Board, staging: Staging) -> Simulation {
    Simulation::staged(options(object, board), staging).unwrap()
}

/// Grey levels of a camera under white light.
fn white_image(simulation: &Simulation, camera: CameraId) -> Vec<u8> {
    let seed = ImageSeed { seed: 1, camera: 0, image: 0 };
    Sensor::exposed(None, 1.0).image(&simulation.views()[camera as usize], &Pattern::White, seed).pixels
}

fn count(mask: impl IntoIterator<Item = bool>) -> usize {
    mask.into_iter().filter(|&is_set| is_set).count()
}

#[test]
fn clutter_occludes_shadows_absorbs_and_reflects() {
    let simulation = simulate(Object::Clutter, Board::Visible, Staging::default());
    let truth = simulation.truth();
    let hits_volume = |i: usize| truth.cam2_px[i][0].is_finite() && truth.in_volume[i];
    let pixels = 0..SIZE_PX[0] * SIZE_PX[1];
    let hidden = count(pixels.clone().map(|i| hits_volume(i) && truth.lit[i] && !truth.seen_by_cam2[i]));
    let shadowed = count(pixels.map(|i| hits_volume(i) && truth.seen_by_cam2[i] && !truth.lit[i]));
    let samples = simulation.views()[0].centres.iter().map(|centre| centre.sample);
    let dark = count(samples.map(|s| s.reflected > 0.0 && (0.05..0.15).contains(&s.albedo)));
    let saturated =
        CameraId::BOTH.map(|camera| count(white_image(&simulation, camera).into_iter().map(|grey| grey == 255)));
    assert!(hidden > 5000 && shadowed > 5000, "{hidden} hidden from C2, {shadowed} in shadow");
    assert!(dark > 5000, "{dark} dark");
    assert!(saturated.iter().all(|&count| count > 300), "{saturated:?} saturated");
    assert!(count(truth.measurable.iter().copied()) > 150_000);
}

/// Sizes of the connected components of a mask, pixels.
fn component_sizes(mask: &[bool]) -> Vec<usize> {
    let mut left = mask.to_vec();
    let mut sizes = Vec::new();
    for start in 0..mask.len() {
        let (mut open, mut size) = (vec![start], 0);
        while let Some(i) = open.pop() {
            if std::mem::take(&mut left[i]) {
                size += 1;
                // Pixels at the border of the image are never set, so neighbours do not wrap from row to row.
                open.extend([i.wrapping_sub(1), i + 1, i.wrapping_sub(SIZE_PX[0]), i + SIZE_PX[0]]);
                open.retain(|&i| i < mask.len());
            }
        }
        sizes.extend((size > 0).then_some(size));
    }
    sizes
}

#[test]
fn crumbs_are_separate_components_of_50_pixels_at_all_heights() {
    let simulation = simulate(Object::Crumbs, Board::None, Staging::default());
    let sizes = component_sizes(&simulation.truth().measurable);
    let mean = sizes.iter().sum::<usize>() as f64 / sizes.len() as f64;
    assert!(sizes.len() > 100 && (40.0..60.0).contains(&mean), "{} components of {mean} pixels", sizes.len());
    assert!(sizes.iter().all(|size| (5..90).contains(size)), "{sizes:?}");
    let heights: Vec<f64> = simulation.views()[0].centres.iter().filter_map(|c| Some(c.hit?.point.z)).collect();
    let in_span = |low: f64| heights.iter().filter(|z| (low..low + 6.0).contains(*z)).count();
    assert!([0.0, 6.0, 12.0, 18.0].into_iter().all(|low| in_span(low) > heights.len() / 10));
}

#[test]
fn a_board_behind_the_volume_is_bright_but_never_measurable() {
    for (object, depth_m) in [(Object::Tooth, 0.025), (Object::Machine, 0.06)] {
        let mut options = options(object, Board::BEHIND);
        options.rig.depth_m = depth_m;
        let simulation = Simulation::new(options).unwrap();
        let truth = simulation.truth();
        let white = white_image(&simulation, CameraId::Cam1);
        let mut board = 0;
        for (i, centre) in simulation.views()[0].centres.iter().enumerate() {
            if centre.hit.is_some_and(|hit| hit.surface == Surface::Board) {
                assert!(!truth.in_volume[i] && !truth.measurable[i] && !truth.reference[i], "{object:?}");
                board += usize::from(truth.lit[i] && truth.seen_by_cam2[i] && white[i] > 60);
            }
        }
        assert!(board > 80_000, "{object:?}: {board} bright pixels of the board");
        assert!(count(truth.reference.iter().copied()) > 5000, "{object:?}");
    }
}

#[test]
fn a_covered_half_has_no_reference_and_is_black() {
    let uncovered = simulate(Object::Elephant, Board::Visible, Staging::default());
    let in_right_half = |u: f64| u >= SIZE_PX[0] as f64 / 2.0 - 0.5;
    for camera in CameraId::BOTH {
        let staging = Staging { covered: Some(camera), ..Staging::default() };
        let covered = simulate(Object::Elephant, Board::Visible, staging);
        let (truth, before) = (covered.truth(), uncovered.truth());
        let mut kept = 0;
        for i in 0..truth.reference.len() {
            let u = (i % SIZE_PX[0]) as f64;
            let is_covered = in_right_half(if camera == CameraId::Cam1 { u } else { before.cam2_px[i][0].into() });
            for (now, then) in [
                (truth.reference[i], before.reference[i]),
                (truth.measurable[i], before.measurable[i]),
                (truth.seen_by_cam2[i], before.seen_by_cam2[i]),
            ] {
                assert_eq!(now, then && !is_covered, "{camera:?}, pixel {i}");
            }
            kept += usize::from(truth.reference[i]);
        }
        assert!(kept > 50_000, "{camera:?}: {kept}");
        let white = white_image(&covered, camera);
        // 2 is the grey level without light.
        let is_black_if_covered = |i: usize| !in_right_half((i % SIZE_PX[0]) as f64) || white[i] == 2;
        assert!((0..white.len()).all(is_black_if_covered), "{camera:?}");
    }
}

#[test]
fn parts_outside_the_volume_are_seen_but_not_measurable() {
    let shifted = |shift_mm| simulate(Object::Machine, Board::Visible, Staging { shift_mm, ..Staging::default() });
    for shift_mm in [[35.0, 0.0, 0.0], [0.0, 0.0, -10.0]] {
        let simulation = shifted(shift_mm);
        let truth = simulation.truth();
        let cam1_from_volume = simulation.rig().exact_volume.cam1_from_volume();
        let (mut inside, mut outside) = (0, 0);
        for (i, centre) in simulation.views()[0].centres.iter().enumerate() {
            let Some(hit) = centre.hit else { continue };
            // To the frame of the volume: turned by 180° about x, with z = 12 mm of the object at the centre of the
            // volume, so the board is 0.5 mm in front of the far face.
            let [x, y, z] = [hit.point.x + shift_mm[0], shift_mm[1] - hit.point.y, 12.0 - hit.point.z + shift_mm[2]];
            let is_inside = x.abs() < 50.0 && y.abs() < 40.0 && z.abs() < 12.5;
            assert_eq!(truth.in_volume[i], is_inside, "{x} {y} {z}");
            let point = truth.point[i].map(|c| f64::from(c) * 1e-3);
            let in_volume = cam1_from_volume.inverse_transform_point(&point.into());
            assert!((in_volume.x * 1e3 - x).abs() < 1e-3 && (in_volume.z * 1e3 - z).abs() < 1e-3);
            inside += usize::from(truth.measurable[i]);
            outside += usize::from(truth.lit[i] && truth.seen_by_cam2[i] && !truth.in_volume[i]);
            assert!(!truth.measurable[i] || truth.in_volume[i]);
        }
        assert!(inside > 20_000 && outside > 5_000, "{shift_mm:?}: {inside} inside, {outside} outside");
    }
    let refused = Simulation::staged(
        options(Object::Plane, Board::None),
        Staging { shift_mm: [0.0, f64::NAN, 0.0], ..Staging::default() },
    );
    assert!(refused.err().unwrap().to_string().contains("shift is NaN mm"));
}

/// Mask of the pixels of C1 that see a surface.
fn mask_of(simulation: &Simulation, surface: Surface) -> Vec<bool> {
    let centres = simulation.views()[0].centres.iter();
    centres.map(|centre| centre.hit.is_some_and(|hit| hit.surface == surface)).collect()
}

/// Asserts that a surface outside the volume is never measurable. Returns its number of pixels.
fn assert_never_measurable(simulation: &Simulation, surface: Surface) -> usize {
    let (truth, mask) = (simulation.truth(), mask_of(simulation, surface));
    for i in (0..mask.len()).filter(|&i| mask[i]) {
        assert!(!truth.in_volume[i] && !truth.measurable[i] && !truth.reference[i], "{surface:?}, pixel {i}");
    }
    count(mask)
}

#[test]
fn a_board_outside_the_volume_has_its_distance_and_is_never_measurable() {
    for (distance_mm, tilt_deg) in [(-30.0, 0.0), (-5.0, 25.0), (5.0, -25.0), (85.0, 20.0), (400.0, 0.0), (1000.0, 0.0)]
    {
        let board = BoardApart { distance_mm, albedo: 0.3, tilt_deg };
        let simulation = simulate(Object::Tooth, Board::Apart(board), Staging::default());
        assert!(assert_never_measurable(&simulation, Surface::Board) > 30_000, "{board:?}");
        assert!(count(simulation.truth().reference.iter().copied()) > 2000, "{board:?}");
        let (rig, truth) = (simulation.rig(), simulation.truth());
        let volume = &rig.exact_volume;
        let mask = mask_of(&simulation, Surface::Board);
        let z_mm: Vec<f64> = (0..mask.len())
            .filter(|&i| mask[i])
            .map(|i| {
                let point = truth.point[i].map(|c| f64::from(c) / 1e3);
                let z = volume.cam1_from_volume().inverse_transform_point(&point.into()).z;
                1e3 * if distance_mm > 0.0 { z - volume.max().z } else { z - volume.min().z }
            })
            .collect();
        if tilt_deg == 0.0 {
            assert!(z_mm.iter().all(|z| (z - distance_mm).abs() < 1e-3), "{board:?}");
        } else {
            let (least, most) = z_mm.iter().fold((f64::MAX, f64::MIN), |(a, b), &z| (a.min(z), b.max(z)));
            assert!(most - least > 15.0, "{board:?}: {least} to {most} mm");
        }
    }
}

#[test]
fn a_brighter_board_is_brighter_and_a_farther_one_darker() {
    let mean = |distance_mm, albedo| {
        let board = BoardApart { distance_mm, albedo, tilt_deg: 0.0 };
        let simulation = simulate(Object::Tooth, Board::Apart(board), Staging::default());
        let (mask, white) = (mask_of(&simulation, Surface::Board), white_image(&simulation, CameraId::Cam1));
        let lit = (0..mask.len()).filter(|&i| mask[i] && simulation.truth().lit[i]);
        let (sum, count) = lit.fold((0.0, 0.0), |(sum, count), i| (sum + f64::from(white[i]), count + 1.0));
        sum / count
    };
    let (black, white, far) = (mean(15.0, 0.05), mean(15.0, 0.8), mean(400.0, 0.8));
    assert!(black < 20.0 && white > 150.0 && far < 0.4 * white, "{black}, {white}, {far}");
}

#[test]
fn a_hand_occludes_and_shadows_and_is_never_measurable() {
    for depth_m in [0.025, 0.11] {
        let mut options = options(Object::Elephant, Board::None);
        options.rig.depth_m = depth_m;
        let [without, with] =
            [false, true].map(|hand| Simulation::staged(options, Staging { hand, ..Staging::default() }).unwrap());
        let pixels = assert_never_measurable(&with, Surface::Hand);
        assert!((20_000..200_000).contains(&pixels), "{depth_m} m: {pixels} pixels of the hand");
        let measurable = |simulation: &Simulation| count(simulation.truth().measurable.iter().copied());
        assert!(measurable(&with) < measurable(&without) * 9 / 10 && measurable(&with) > 10_000, "{depth_m} m");
        let in_shadow = |simulation: &Simulation| {
            let (truth, mask) = (simulation.truth(), mask_of(simulation, Surface::Object));
            count((0..mask.len()).map(|i| mask[i] && truth.in_volume[i] && !truth.lit[i]))
        };
        assert!(in_shadow(&with) > in_shadow(&without), "{depth_m} m: no shadow of the hand");
    }
}

#[test]
fn every_object_fills_the_requested_share_of_the_image() {
    // The tray is larger than the image, where its straight border would cross whole rows of the counted pixels at once.
    // Bodies of the crowd hide each other as they grow, so their share jumps.
    for object in Object::ALL.into_iter().filter(|object| object.fits_volume()) {
        // Crumbs are far apart: enlarged to 5 %, most of them would leave the image.
        let wanted = if object == Object::Crumbs { 1.0 } else { 5.0 };
        let simulation = simulate(object, Board::None, Staging { share_percent: Some(wanted), ..Staging::default() });
        let mask = mask_of(&simulation, Surface::Object);
        let percent = 100.0 * count(mask.iter().copied()) as f64 / mask.len() as f64;
        assert!((percent / wanted - 1.0).abs() < 0.04, "{object:?}: {percent} %");
    }
    let too_much = Staging { share_percent: Some(90.0), ..Staging::default() };
    assert!(Simulation::staged(options(Object::Tooth, Board::None), too_much).is_err());
}
