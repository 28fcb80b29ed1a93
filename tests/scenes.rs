//! What makes the harder scenes of the virtual scanner hard is really in them, and their truth says so.

#![expect(clippy::unwrap_used, reason = "a scene that cannot be simulated fails the test")]

use fringeflow_dataset::CameraId;
use fringeflow_lab::simulation::{
    Board, BoardApart, ImageSeed, NoiseLevel, Object, Projected, Sensor, Simulation, SimulationOptions, Staging,
    Surface,
};

const SIZE_PX: [usize; 2] = [640, 512];

fn options(object: Object, board: Board) -> SimulationOptions {
    let usual = SimulationOptions::usual(object);
    SimulationOptions { board, steps: 4, gray: false, noise: NoiseLevel::None, supersampling: 1, ..usual }
}

fn staged(object: Object, board: Board, staging: Staging) -> Simulation {
    Simulation::staged(options(object, board), staging).unwrap()
}

/// Grey levels of a camera under white light.
fn white(simulation: &Simulation, camera: CameraId) -> Vec<u8> {
    let seed = ImageSeed { seed: 1, camera: 0, image: 0 };
    Sensor::exposed(None, 1.0).image(&simulation.views()[camera as usize], &Projected::White, seed).pixels
}

fn count(mask: impl IntoIterator<Item = bool>) -> usize {
    mask.into_iter().filter(|&is| is).count()
}

#[test]
fn clutter_hides_shadows_swallows_and_reflects() {
    let simulation = staged(Object::Clutter, Board::Visible, Staging::default());
    let truth = simulation.truth();
    let seen = |i: usize| truth.cam2_px[i][0].is_finite() && truth.in_volume[i];
    let pixels = 0..SIZE_PX[0] * SIZE_PX[1];
    let hidden = count(pixels.clone().map(|i| seen(i) && truth.lit[i] && !truth.seen_by_cam2[i]));
    let shadowed = count(pixels.map(|i| seen(i) && truth.seen_by_cam2[i] && !truth.lit[i]));
    let samples = simulation.views()[0].centres.iter().map(|centre| centre.sample);
    let dark = count(samples.map(|s| s.reflected > 0.0 && (0.05..0.15).contains(&s.albedo)));
    let saturated = CameraId::BOTH.map(|camera| count(white(&simulation, camera).into_iter().map(|grey| grey == 255)));
    assert!(hidden > 5000 && shadowed > 5000, "{hidden} hidden from C2, {shadowed} in shadow");
    assert!(dark > 5000, "{dark} dark");
    assert!(saturated.iter().all(|&count| count > 300), "{saturated:?} saturated");
    assert!(count(truth.measurable.iter().copied()) > 150_000);
}

/// Sizes of the connected pieces of a mask, pixels.
fn pieces(mask: &[bool]) -> Vec<usize> {
    let mut left = mask.to_vec();
    let mut sizes = Vec::new();
    for start in 0..mask.len() {
        let (mut open, mut size) = (vec![start], 0);
        while let Some(i) = open.pop() {
            if std::mem::take(&mut left[i]) {
                size += 1;
                // The border of the image belongs to no piece.
                open.extend([i.wrapping_sub(1), i + 1, i.wrapping_sub(SIZE_PX[0]), i + SIZE_PX[0]]);
                open.retain(|&i| i < mask.len());
            }
        }
        sizes.extend((size > 0).then_some(size));
    }
    sizes
}

#[test]
fn crumbs_are_separate_pieces_of_fifty_pixels_at_any_height() {
    let simulation = staged(Object::Crumbs, Board::None, Staging::default());
    let sizes = pieces(&simulation.truth().measurable);
    let mean = sizes.iter().sum::<usize>() as f64 / sizes.len() as f64;
    assert!(sizes.len() > 100 && (40.0..60.0).contains(&mean), "{} pieces of {mean} pixels", sizes.len());
    assert!(sizes.iter().all(|size| (5..90).contains(size)), "{sizes:?}");
    let heights: Vec<f64> = simulation.views()[0].centres.iter().filter_map(|c| Some(c.hit?.point.z)).collect();
    let in_span = |low: f64| heights.iter().filter(|z| (low..low + 6.0).contains(*z)).count();
    assert!([0.0, 6.0, 12.0, 18.0].into_iter().all(|low| in_span(low) > heights.len() / 10));
}

#[test]
fn a_board_behind_the_volume_is_bright_and_never_measurable() {
    for (object, depth_m) in [(Object::Tooth, 0.025), (Object::Machine, 0.06)] {
        let mut options = options(object, Board::BEHIND);
        options.rig.depth_m = depth_m;
        let simulation = Simulation::new(options).unwrap();
        let truth = simulation.truth();
        let white = white(&simulation, CameraId::Cam1);
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
fn behind_a_flap_there_is_no_reference_and_no_light() {
    let free = staged(Object::Elephant, Board::Visible, Staging::default());
    let right = |u: f64| u >= SIZE_PX[0] as f64 / 2.0 - 0.5;
    for camera in CameraId::BOTH {
        let staging = Staging { covered: Some(camera), ..Staging::default() };
        let covered = staged(Object::Elephant, Board::Visible, staging);
        let (truth, before) = (covered.truth(), free.truth());
        let mut kept = 0;
        for i in 0..truth.reference.len() {
            let u = (i % SIZE_PX[0]) as f64;
            let is_hidden = right(if camera == CameraId::Cam1 { u } else { before.cam2_px[i][0].into() });
            for (now, then) in [
                (truth.reference[i], before.reference[i]),
                (truth.measurable[i], before.measurable[i]),
                (truth.seen_by_cam2[i], before.seen_by_cam2[i]),
            ] {
                assert_eq!(now, then && !is_hidden, "{camera:?}, pixel {i}");
            }
            kept += usize::from(truth.reference[i]);
        }
        assert!(kept > 50_000, "{camera:?}: {kept}");
        let white = white(&covered, camera);
        let is_black = |i: usize| !right((i % SIZE_PX[0]) as f64) || white[i] == 2;
        assert!((0..white.len()).all(is_black), "{camera:?}");
    }
}

#[test]
fn what_leaves_the_volume_is_seen_but_not_measurable() {
    let shifted = |shift_mm| staged(Object::Machine, Board::Visible, Staging { shift_mm, ..Staging::default() });
    for shift_mm in [[35.0, 0.0, 0.0], [0.0, 0.0, -10.0]] {
        let simulation = shifted(shift_mm);
        let truth = simulation.truth();
        let cam1_from_volume = simulation.rig().exact_volume.cam1_from_volume();
        let (mut inside, mut outside) = (0, 0);
        for (i, centre) in simulation.views()[0].centres.iter().enumerate() {
            let Some(hit) = centre.hit else { continue };
            // The middle of the object is half a millimetre nearer than half its board, turned towards the sensor.
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

/// Whether the ray of each pixel of C1 meets a surface.
fn meets(simulation: &Simulation, surface: Surface) -> Vec<bool> {
    let centres = simulation.views()[0].centres.iter();
    centres.map(|centre| centre.hit.is_some_and(|hit| hit.surface == surface)).collect()
}

/// Nothing of what is apart from the volume counts as measured, however it is lit and seen.
fn assert_apart(simulation: &Simulation, surface: Surface) -> usize {
    let (truth, met) = (simulation.truth(), meets(simulation, surface));
    for i in (0..met.len()).filter(|&i| met[i]) {
        assert!(!truth.in_volume[i] && !truth.measurable[i] && !truth.reference[i], "{surface:?}, pixel {i}");
    }
    count(met)
}

#[test]
fn a_board_at_any_distance_is_where_it_should_be_and_never_measurable() {
    for (distance_mm, tilt_deg) in [(-30.0, 0.0), (-5.0, 25.0), (5.0, -25.0), (85.0, 20.0), (400.0, 0.0), (1000.0, 0.0)]
    {
        let board = BoardApart { distance_mm, albedo: 0.3, tilt_deg };
        let simulation = staged(Object::Tooth, Board::Apart(board), Staging::default());
        assert!(assert_apart(&simulation, Surface::Board) > 30_000, "{board:?}");
        assert!(count(simulation.truth().reference.iter().copied()) > 2000, "{board:?}");
        let (rig, truth) = (simulation.rig(), simulation.truth());
        let volume = &rig.exact_volume;
        let met = meets(&simulation, Surface::Board);
        let z_mm: Vec<f64> = (0..met.len())
            .filter(|&i| met[i])
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
        let simulation = staged(Object::Tooth, Board::Apart(board), Staging::default());
        let (met, white) = (meets(&simulation, Surface::Board), white(&simulation, CameraId::Cam1));
        let lit = (0..met.len()).filter(|&i| met[i] && simulation.truth().lit[i]);
        let (sum, count) = lit.fold((0.0, 0.0), |(sum, count), i| (sum + f64::from(white[i]), count + 1.0));
        sum / count
    };
    let (black, white, far) = (mean(15.0, 0.05), mean(15.0, 0.8), mean(400.0, 0.8));
    assert!(black < 20.0 && white > 150.0 && far < 0.4 * white, "{black}, {white}, {far}");
}

#[test]
fn a_hand_hides_and_shadows_and_is_never_measurable() {
    for depth_m in [0.025, 0.11] {
        let mut options = options(Object::Elephant, Board::None);
        options.rig.depth_m = depth_m;
        let [free, hand] =
            [false, true].map(|hand| Simulation::staged(options, Staging { hand, ..Staging::default() }).unwrap());
        let pixels = assert_apart(&hand, Surface::Hand);
        assert!((20_000..200_000).contains(&pixels), "{depth_m} m: {pixels} pixels of the hand");
        let measurable = |simulation: &Simulation| count(simulation.truth().measurable.iter().copied());
        assert!(measurable(&hand) < measurable(&free) * 9 / 10 && measurable(&hand) > 10_000, "{depth_m} m");
        let in_shadow = |simulation: &Simulation| {
            let (truth, met) = (simulation.truth(), meets(simulation, Surface::Object));
            count((0..met.len()).map(|i| met[i] && truth.in_volume[i] && !truth.lit[i]))
        };
        assert!(in_shadow(&hand) > in_shadow(&free), "{depth_m} m: no shadow of the hand");
    }
}

#[test]
fn every_object_fills_the_share_of_the_image_that_is_asked_for() {
    // A tray is not made to be smaller than the image: its straight border passes whole rows of the pixels that are counted.
    for object in Object::ALL.into_iter().filter(|&object| object != Object::Tray) {
        // Crumbs lie so far apart that, larger, most of them leave the image.
        let wanted = if object == Object::Crumbs { 1.0 } else { 5.0 };
        let simulation = staged(object, Board::None, Staging { share_percent: Some(wanted), ..Staging::default() });
        let met = meets(&simulation, Surface::Object);
        let percent = 100.0 * count(met.iter().copied()) as f64 / met.len() as f64;
        assert!((percent / wanted - 1.0).abs() < 0.04, "{object:?}: {percent} %");
    }
    let too_much = Staging { share_percent: Some(90.0), ..Staging::default() };
    assert!(Simulation::staged(options(Object::Tooth, Board::None), too_much).is_err());
}
