//! Detection in rendered images with exact truth.

mod render;

use super::*;
use render::Taken;

const CHARUCO: &str = "charuco:14x10:square=12:marker=9:dictionary=4x4_250";

/// Root mean square of the errors along each axis, largest error, number of detections; ids are checked.
fn errors(board: &Board, taken: &Taken, found: &[Detection]) -> (f64, f64, usize) {
    let features = board.features();
    // The board may be found turned where it looks the same.
    let is_upright = taken.turned_deg[2].abs() < 90.0;
    let sign = if is_upright || board.turns() == 1 { 1.0 } else { -1.0 };
    let distance = |d: &Detection| {
        let truth = taken.pixel([sign * features[d.feature][0], sign * features[d.feature][1]]);
        (d.pixel[0] - truth[0]).hypot(d.pixel[1] - truth[1])
    };
    let squares: f64 = found.iter().map(|d| distance(d).powi(2)).sum();
    let most = found.iter().map(distance).fold(0.0, f64::max);
    ((squares / (2 * found.len()) as f64).sqrt(), most, found.len())
}

/// Errors in pixels that OpenCV 5.0 reaches on the same images, with the best window of its `cornerSubPix`.
#[test]
fn positions_are_exact() {
    for (spec, taken, most_rms, least) in [
        (CHARUCO, Taken::usual(), 0.008, 117),
        (CHARUCO, Taken { noise: 8.0, ..Taken::usual() }, 0.025, 117),
        (CHARUCO, Taken { blur_px: 2.0, ..Taken::usual() }, 0.02, 115),
        (CHARUCO, Taken { turned_deg: [0.0, 60.0, 20.0], ..Taken::usual() }, 0.012, 100),
        ("chessboard:9x6:square=18", Taken { gamma: 1.8, gradient: 0.8, white: 160.0, ..Taken::usual() }, 0.008, 54),
        ("circles:9x7:spacing=17:diameter=11", Taken { turned_deg: [0.0, 60.0, 20.0], ..Taken::usual() }, 0.008, 63),
        ("asymmetric-circles:4x11:spacing=11:diameter=11", Taken::usual(), 0.007, 44),
        ("aprilgrid:6x5:tag=18:gap=5.4", Taken::usual(), 0.009, 120),
    ] {
        let board: Board = spec.parse().unwrap();
        let found = detect(&board, &taken.image(&board)).unwrap();
        let (rms, most, n) = errors(&board, &taken, &found);
        assert!(rms <= most_rms && most < 8.0 * most_rms && n >= least, "{spec}: {rms:.4}, {most:.3}, {n}: {taken:?}");
    }
}
