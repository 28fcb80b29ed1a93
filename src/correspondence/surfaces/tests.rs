use super::super::drift::DriftRoom;
use super::super::semi_global::test_scene::TestScene;
use super::*;
use crate::simd::Level;

fn view(scene: &TestScene) -> View<'_> {
    View { cam1: &scene.cam1, cam2: &scene.cam2, table: &scene.table }
}

#[test]
fn nodes_of_a_plane_have_its_orders_at_every_level() {
    let scene = TestScene::new();
    let explained = Level::ALL.map(|level| {
        level.limit_to();
        let mut room = Room::default();
        let drift = explain(view(&scene), &scene.delta, &mut room, &mut DriftRoom::default());
        (drift, room)
    });
    let [(drift, room), others @ ..] = &explained;
    for (other, of_other) in others {
        assert!(other == drift && of_other.nodes.nodes == room.nodes.nodes);
    }
    assert!(room.clear_share() > 0.7, "{}", room.clear_share());
    let (mut right, mut wrong) = (0, 0);
    for piece in (0..scene.cam1.height).flat_map(|v| room.nodes.of_row(v)) {
        let node = &room.nodes.nodes[piece.node as usize];
        for pixel in (piece.begin as usize..piece.end as usize).filter(|_| node.is_clear()) {
            let order = node.order(piece.offset + i32::from(room.runs.relative[pixel]));
            let turns = f64::from(order) + f64::from(scene.cam1.phase[pixel]) / 65536.0;
            // Some pixels are off by anything, by the scene.
            let off = (turns - f64::from(scene.turns[pixel])).abs();
            right += usize::from(off < 0.1);
            wrong += usize::from(off > 0.9 && off.fract() < 0.1);
        }
    }
    assert!(right > 20_000 && wrong * 50 < right, "{right} right, {wrong} wrong");
}

#[test]
fn nothing_of_a_plane_in_the_volume_sees_outside() {
    let scene = TestScene::new();
    let (mut room, mut outside) = (Room::default(), Vec::new());
    let drift = explain(view(&scene), &scene.delta, &mut room, &mut DriftRoom::default());
    assert!(!room.mark_outside(view(&scene), &drift, 50.0, &mut outside));
    assert!(outside.iter().all(|outside| !outside));
}
