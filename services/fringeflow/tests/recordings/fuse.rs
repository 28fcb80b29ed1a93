//! `fuse`: models and poses from recordings, and refused input.

use super::commands::assert_exit;
use super::*;

/// Returns the path of a recording of the repository.
fn repository_recording(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recordings").join(name)
}

#[test]
fn a_sweep_becomes_one_model_with_a_pose_for_every_cloud() {
    let folder = tempfile::tempdir().unwrap();
    let [model, poses] = ["tooth.ply", "poses.csv"].map(|name| folder.path().join(name));
    let tooth = repository_recording("tooth.mcap");
    let summary = json(&run_ok(&[&"fuse", &tooth, &"-o", &model, &"--trajectory", &poses, &"--json"]));
    let clouds = summary["clouds"].as_u64().unwrap();
    assert!(clouds >= 6 && summary["merged"] == clouds, "{summary}");
    assert_eq!(summary["lost"], serde_json::json!({}));
    // The sweep goes 0.15 mm to each side, so its path as seen from C1 is a few millimetres at most.
    assert!((0.1..5.0).contains(&summary["path_mm"].as_f64().unwrap()), "{summary}");
    let sd_mm = summary["pose_sd_mm"][1].as_f64().unwrap();
    assert!(sd_mm > 1e-4 && sd_mm < 0.5, "{summary}");

    let text = std::fs::read_to_string(&poses).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len() as u64, clouds + 1);
    assert!(lines[0].starts_with("pair,time_s,state,x_mm,") && lines[1].contains(",first,0.000000,"), "{text}");
    let fields = lines[0].split(',').count();
    assert!(lines.iter().all(|line| line.split(',').count() == fields), "{text}");

    let bytes = std::fs::read(&model).unwrap();
    let header = String::from_utf8_lossy(&bytes[..600]).into_owned();
    assert!(header.contains(&format!("element vertex {}\n", summary["surfels"])), "{header}");
    assert!(header.contains("comment unit mm\n") && header.contains("comment frame cam1 "), "{header}");

    let again = folder.path().join("again.ply");
    run_ok(&[&"fuse", &tooth, &"-o", &again, &"--threads", &"1"]);
    assert!(bytes == std::fs::read(&again).unwrap(), "one thread gives another model");
    let every_pair =
        json(&run_ok(&[&"fuse", &tooth, &"-o", &again, &"--every", &"1", &"--frames", &"0..10", &"--json"]));
    assert_eq!(every_pair["clouds"], 5);
}

#[test]
fn lost_clouds_are_counted_by_reason_and_give_exit_code_3() {
    let folder = tempfile::tempdir().unwrap();
    let [model, poses] = ["prism.ply", "poses.csv"].map(|name| folder.path().join(name));
    // The surface of a prism hardly determines its position along its axis.
    let prism = repository_recording("faults.mcap");
    let output = fringeflow(&[&"fuse", &prism, &"-o", &model, &"--trajectory", &poses, &"--json"]);
    let says = ["clouds are not in the model; the first begins with image pair 28: the pose still moves by"];
    assert_exit(&output, 3, &says);
    let summary = json(&output);
    let text = std::fs::read_to_string(&poses).unwrap();
    let mut all_lost = 0;
    for (reason, lost) in summary["lost"].as_object().unwrap() {
        let lost = lost.as_u64().unwrap();
        assert_eq!(text.matches(&format!(",{reason},")).count() as u64, lost, "{reason}");
        all_lost += lost;
    }
    assert!(summary["lost"]["degenerate"].as_u64().unwrap() > 0);
    assert_eq!(summary["merged"].as_u64().unwrap() + all_lost, summary["clouds"].as_u64().unwrap());
    assert!(model.exists());
}

#[test]
fn fuse_refuses_unusable_input_and_output_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("model.ply");
    assert_exit(&fringeflow(&[&"fuse", &dataset(), &"-o", &model]), 2, &["plane", "give a recording"]);
    let tooth = repository_recording("tooth.mcap");
    let cloud = folder.path().join("model.pcd");
    assert_exit(&fringeflow(&[&"fuse", &tooth, &"-o", &cloud]), 2, &["model.pcd", "use .ply"]);
    let nowhere = folder.path().join("nowhere/model.ply");
    assert_exit(&fringeflow(&[&"fuse", &tooth, &"-o", &nowhere]), 1, &["nowhere", "does not exist"]);
    let poses = folder.path().join("poses.txt");
    let trajectory = fringeflow(&[&"fuse", &tooth, &"-o", &model, &"--trajectory", &poses]);
    assert_exit(&trajectory, 2, &["poses.txt", "use .csv"]);
    let frames = fringeflow(&[&"fuse", &tooth, &"-o", &model, &"--frames", &"4..4000"]);
    assert_exit(&frames, 2, &["--frames 4..4000", "image pairs 0.."]);
    let few = fringeflow(&[&"fuse", &tooth, &"-o", &model, &"--frames", &"4..7"]);
    assert_exit(&few, 2, &["3 image pairs", "complete window of 6"]);
    let none = fringeflow(&[&"fuse", &tooth, &"-o", &model, &"--every", &"0"]);
    assert_eq!(none.status.code(), Some(2));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
