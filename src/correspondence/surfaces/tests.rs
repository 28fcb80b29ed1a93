use fringeflow_simd::Level;

use crate::correspondence::drift::{Drift, DriftScratch, KnownDrift};
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::semi_global::test_scene::TestScene;
use crate::correspondence::view::View;

use super::evidence::Sampling;
use super::order_scores::Gate;
use super::*;

#[test]
fn nodes_of_a_plane_have_its_orders_at_every_level() {
    let scene = TestScene::new();
    let explained = Level::ALL.map(|level| {
        level.limit_to();
        let mut scratch = Scratch::default();
        let drift = explain(scene.view(), &scene.delta, None, &mut scratch, &mut DriftScratch::default());
        (drift, scratch)
    });
    let [(drift, scratch), others @ ..] = &explained;
    for (other, of_other) in others {
        assert!(other == drift && of_other.nodes.nodes == scratch.nodes.nodes);
    }
    assert!(scratch.clear_share() > 0.7, "{}", scratch.clear_share());
    let (mut right, mut wrong) = (0, 0);
    for piece in (0..scene.cam1.height).flat_map(|v| scratch.nodes.row(v)) {
        let node = &scratch.nodes.nodes[piece.node as usize];
        for pixel in (piece.begin as usize..piece.end as usize).filter(|_| node.is_clear()) {
            let order = node.order(piece.offset + i32::from(scratch.runs.relative[pixel]));
            let turns = f64::from(order) + f64::from(scene.cam1.phase[pixel]) / 65536.0;
            // The scene contains some pixels whose phase is off by any amount.
            let off = (turns - f64::from(scene.turns[pixel])).abs();
            right += usize::from(off < 0.1);
            wrong += usize::from(off > 0.9 && off.fract() < 0.1);
        }
    }
    assert!(right > 20_000 && wrong * 50 < right, "{right} right, {wrong} wrong");
}

#[test]
fn a_drift_that_is_known_is_found_again_and_a_wrong_one_changes_nothing() {
    let scene = TestScene::new();
    let explained = |known: Option<KnownDrift>| {
        let (mut scratch, known) =
            (Scratch::default(), known.and_then(|known| Drift::from_known(&known, &scene.table)));
        let drift = explain(scene.view(), &scene.delta, known.as_ref(), &mut scratch, &mut DriftScratch::default());
        (drift, scratch.nodes.nodes)
    };
    let (alone, nodes) = explained(None);
    let known = alone.to_known();
    assert_eq!(KnownDrift::from_numbers(known.to_numbers()), Some(known));
    let (again, of_again) = explained(Some(known));
    // A quarter of the sd of δ: the sample is another one.
    let off_turns = again.distance_turns(&alone, &scene.table);
    assert!(off_turns < 0.004, "{off_turns}");
    let (mut same, mut clear) = (0, 0);
    for (node, other) in nodes.iter().zip(&of_again).filter(|(node, other)| node.is_clear() && other.is_clear()) {
        (clear, same) = (clear + 1, same + usize::from(node.label == other.label));
    }
    assert!(same * 100 >= clear * 99 && clear > 100, "{same} of {clear}");
    let off = |place: usize, by: f32| {
        let mut numbers = known.to_numbers();
        numbers[place] += by;
        KnownDrift::from_numbers(numbers)
    };
    // Its mean by 7°, 22° and any amount; the first mode by a pixel and by any amount; an sd too large to tell orders
    // apart.
    for (place, by) in [(1, 0.02), (1, 0.06), (1, 1e30), (2, 1.0), (2, -1e30), (0, 0.5)] {
        let (drift, of_drift) = explained(off(place, by));
        assert!(drift == alone && of_drift == nodes, "{place} by {by}");
    }
}

#[test]
fn nothing_of_a_plane_in_the_volume_sees_outside() {
    let scene = TestScene::new();
    let (mut scratch, mut outside) = (Scratch::default(), Vec::new());
    let drift = explain(scene.view(), &scene.delta, None, &mut scratch, &mut DriftScratch::default());
    assert!(!scratch.mark_outside(scene.view(), &drift, 50.0, &mut outside).is_very_far);
    assert!(outside.iter().all(|outside| !outside));
    assert!(!scratch.mask_taken(scene.view(), &drift, &outside, &mut EpipolarImage::default()));
}

#[test]
fn a_plane_behind_the_volume_takes_the_places_that_it_is_seen_in() {
    let scene = TestScene::behind();
    let left = Level::ALL.map(|level| {
        level.limit_to();
        let (mut scratch, mut outside, mut open) = (Scratch::default(), Vec::new(), EpipolarImage::default());
        let drift = Drift::level(0.0, 0.05);
        scratch.divide(scene.view());
        let gate = Gate { cap_turns: 0.05, beyond_turns: 0.0, most_turns: 0.05 };
        scratch.decide(scene.view(), &drift, gate, Sampling::Many);
        assert!(scratch.mark_outside(scene.view(), &drift, 1.0, &mut outside).is_far);
        assert!(scratch.mask_taken(scene.view(), &drift, &outside, &mut open));
        open.phase
    });
    let with_phase = |phase: &[u16]| phase.iter().filter(|&&phase| phase != EpipolarImage::NO_PHASE).count();
    let (before, after) = (with_phase(&scene.cam2.phase), with_phase(&left[0]));
    assert!(3 * after < 2 * before, "{after} of {before}");
    let is_kept = |(&open, &phase): (&u16, &u16)| open == phase || open == EpipolarImage::NO_PHASE;
    assert!(left[0].iter().zip(&scene.cam2.phase).all(is_kept));
    assert!(left.iter().all(|phase| *phase == left[0]));
}

#[test]
fn no_node_lies_across_a_seam() {
    let scene = TestScene::new();
    let mut cam1 = scene.cam1.clone();
    let (width, height) = (cam1.width, cam1.height);
    // Around its middle the order of this surface rises by three: rows are united on one side, and contradict each
    // other on the other.
    for (pixel, phase) in cam1.phase.iter_mut().enumerate() {
        let [x, y] = [(pixel % width) as f64 - width as f64 / 2.0, (pixel / width) as f64 - height as f64 / 2.0];
        *phase = (3.0 * y.atan2(x) / std::f64::consts::TAU * 65536.0).round() as i64 as u16;
    }
    cam1.valid.fill(true);
    let mut scratch = Scratch::default();
    scratch.divide(View { cam1: &cam1, ..scene.view() });
    let (nodes, runs) = (&scratch.nodes, &scratch.runs);
    let absolute = |piece: &nodes::Piece, pixel: usize| {
        (piece.offset + i32::from(runs.relative[pixel])) * 65536 + i32::from(cam1.phase[pixel])
    };
    let (mut met, mut seams) = (0, 0);
    for v in 1..height {
        for (above, below) in nodes.row(v - 1).iter().flat_map(|a| nodes.row(v).iter().map(move |b| (a, b))) {
            let begin = (above.begin as usize + width).max(below.begin as usize);
            let end = (above.end as usize + width).min(below.end as usize);
            for pixel in begin..end.max(begin) {
                let contradicts = (absolute(below, pixel) - absolute(above, pixel - width)).abs() > 40_000;
                let is_middle = (pixel % width).abs_diff(width / 2) < 16 && v.abs_diff(height / 2) < 16;
                assert!(!contradicts || above.node != below.node || is_middle, "{v} {pixel}");
                met += 1;
                seams += usize::from(contradicts);
            }
        }
    }
    assert!(met > 20_000 && seams > 20, "{met} {seams}");
}
