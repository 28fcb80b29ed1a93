use super::*;
use fringeflow_board::{BoardImage, detect};
use fringeflow_dataset::read_grey;

fn options(board: &str) -> CalibrationSetOptions {
    let rig = RigOptions { size_px: [320, 256], ..RigOptions::usual(0.025) };
    CalibrationSetOptions {
        board: board.parse().unwrap(),
        rig,
        views: 3,
        steps: 4,
        noise: NoiseLevel::None,
        gamma: 1.0,
        exposure: 1.0,
        ambient: 0.03,
        bend_mm: 0.0,
        defocus_px: 0.0,
        beat: 0.0,
        motion_mm: 0.0,
        blur: 0.0,
        seed: 1,
    }
}

/// Writes a set and returns its truth, and the grey levels of the images of C1 of view 0.
fn written(options: CalibrationSetOptions, folder: &Path) -> (serde_json::Value, Vec<Vec<u8>>) {
    let set = CalibrationSet::new(options).unwrap();
    set.write(folder, || ()).unwrap();
    let truth = serde_json::from_str(&std::fs::read_to_string(folder.join("truth.json")).unwrap()).unwrap();
    let image = |k: usize| read_grey(&folder.join(format!("view_00/cam1/{k:03}.png")), None, None).unwrap().pixels;
    (truth, (0..set.patterns.images.len()).map(image).collect())
}

#[test]
fn the_board_is_found_where_the_truth_says() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bend_mm) in [("flat", 0.0), ("bent", 3.0)] {
        let options = CalibrationSetOptions { bend_mm, ..options("charuco:9x7:square=11:marker=8:dictionary=4x4_50") };
        let board = options.board.clone();
        let (truth, _) = written(options, &folder.path().join(name));
        let (mut found, mut sum) = (0, [0.0; 2]);
        for view in 0..3 {
            for camera in ["cam1", "cam2"] {
                let file = folder.path().join(format!("{name}/view_{view:02}/{camera}/000.png"));
                let image = read_grey(&file, None, None).unwrap();
                let image = BoardImage::new([image.width, image.height], image.levels()).unwrap();
                let Ok(detections) = detect(&board, &image) else { continue };
                found += detections.len();
                let points = &truth["views"][view][format!("{camera}_px")];
                for d in detections {
                    let apart = [0, 1].map(|k| points[d.feature][k].as_f64().unwrap() - d.pixel[k]);
                    let most = 0.04 + 4.0 * d.sd_px;
                    assert!(apart[0].hypot(apart[1]) < most, "{name} {view} {camera} {d:?}: {apart:?}");
                    sum = [sum[0] + apart[0], sum[1] + apart[1]];
                }
            }
        }
        assert!(found > 100, "{name}: {found}");
        let mean = sum.map(|sum| sum / found as f64);
        assert!(mean[0].hypot(mean[1]) < 0.005, "{name}: {mean:?}");
    }
}

#[test]
fn images_are_the_same_for_any_number_of_threads_and_each_setting_changes_them() {
    let folder = tempfile::tempdir().unwrap();
    let usual = || CalibrationSetOptions { views: 1, noise: NoiseLevel::Normal, ..options("chessboard:7x6:square=7") };
    let images = |name: &str, options: CalibrationSetOptions| written(options, &folder.path().join(name)).1;
    let first = images("first", usual());
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert!(one_thread.install(|| images("one", usual())) == first);
    let differs = |name: &str, options| assert!(images(name, options) != first, "{name}");
    differs("defocus", CalibrationSetOptions { defocus_px: 3.0, ..usual() });
    differs("beat", CalibrationSetOptions { beat: 0.05, ..usual() });
    differs("motion", CalibrationSetOptions { motion_mm: 0.5, ..usual() });
    differs("gamma", CalibrationSetOptions { gamma: 2.0, ..usual() });
    differs("ambient", CalibrationSetOptions { ambient: 0.2, ..usual() });
}

#[test]
fn fringes_have_the_phase_of_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let options = CalibrationSetOptions { views: 1, ..options("chessboard:7x6:square=7") };
    let set = CalibrationSet::new(options.clone()).unwrap();
    let (truth, images) = written(options, &folder.path().join("set"));
    let view = &truth["views"][0];
    let (mut compared, mut sum) = (0, 0.0);
    for (seen, lit) in view["cam1_px"].as_array().unwrap().iter().zip(view["projector_px"].as_array().unwrap()) {
        let (Some(u), Some(column)) = (seen[0].as_f64(), lit[0].as_f64()) else { continue };
        let v = seen[1].as_f64().unwrap();
        let (mut sin, mut cos) = (0.0, 0.0);
        for (i, pattern) in set.patterns.images.iter().enumerate() {
            let fringeflow_patterns::Pattern::Fringes { direction, shift_rad, .. } = pattern else { continue };
            if *direction != fringeflow_patterns::Direction::Columns {
                continue;
            }
            let (x, y) = (u.floor() as usize, v.floor() as usize);
            let (a, b) = (u - u.floor(), v - v.floor());
            let at = |x: usize, y: usize| f64::from(images[i][y * 320 + x]);
            let grey = (1.0 - b) * ((1.0 - a) * at(x, y) + a * at(x + 1, y))
                + b * ((1.0 - a) * at(x, y + 1) + a * at(x + 1, y + 1));
            sin -= grey * shift_rad.sin();
            cos += grey * shift_rad.cos();
        }
        let turns = sin.atan2(cos) / TAU - set.rig.columns.phase_turns(column);
        // Within a pixel the light of a corner comes from its bright quarters, which shifts the phase to any side.
        let apart = turns - turns.round();
        assert!(apart.abs() < 0.1, "{turns} at {u}, {v}");
        sum += apart;
        compared += 1;
    }
    assert!(compared > 20, "{compared}");
    let mean = sum / f64::from(compared);
    assert!(mean.abs() < 0.01, "{mean}");
}

#[test]
fn what_cannot_be_seen_is_refused() {
    let huge = CalibrationSet::new(options("chessboard:9x6:square=60")).err().unwrap().to_string();
    assert!(huge.contains("view 0") && huge.contains("size of the measurement volume"), "{huge}");
    let bend = CalibrationSetOptions { bend_mm: f64::NAN, ..options("chessboard:7x6:square=7") };
    assert!(CalibrationSet::new(bend).err().unwrap().to_string().contains("bend of the board is NaN mm"));
}
