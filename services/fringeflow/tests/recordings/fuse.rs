//! `fuse`: what it makes of recordings, and what it says of those it cannot use.

use super::commands::assert_ended;
use super::*;

/// A recording of the repository.
fn recorded(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recordings").join(name)
}

#[test]
fn a_sweep_becomes_one_model_with_a_pose_for_every_cloud() {
    let folder = tempfile::tempdir().unwrap();
    let [model, poses] = ["tooth.ply", "poses.csv"].map(|name| folder.path().join(name));
    let tooth = recorded("tooth.mcap");
    let said = json(&done(&[&"fuse", &tooth, &"-o", &model, &"--trajectory", &poses, &"--json"]));
    let clouds = said["clouds"].as_u64().unwrap();
    assert!(clouds >= 6 && said["merged"] == clouds, "{said}");
    assert_eq!(said["lost"], serde_json::json!({}));
    // The sweep is 0.15 mm to each side: its way seen from C1 is no more than a few millimetres.
    assert!((0.1..5.0).contains(&said["path_mm"].as_f64().unwrap()), "{said}");
    let sd_mm = said["pose_sd_mm"][1].as_f64().unwrap();
    assert!(sd_mm > 1e-4 && sd_mm < 0.5, "{said}");

    let text = std::fs::read_to_string(&poses).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len() as u64, clouds + 1);
    assert!(lines[0].starts_with("pair,time_s,state,x_mm,") && lines[1].contains(",first,0.000000,"), "{text}");
    let fields = lines[0].split(',').count();
    assert!(lines.iter().all(|line| line.split(',').count() == fields), "{text}");

    let bytes = std::fs::read(&model).unwrap();
    let header = String::from_utf8_lossy(&bytes[..600]).into_owned();
    assert!(header.contains(&format!("element vertex {}\n", said["surfels"])), "{header}");
    assert!(header.contains("comment unit mm\n") && header.contains("comment frame cam1 "), "{header}");

    let again = folder.path().join("again.ply");
    done(&[&"fuse", &tooth, &"-o", &again, &"--threads", &"1"]);
    assert!(bytes == std::fs::read(&again).unwrap(), "one thread makes another model");
    let more = json(&done(&[&"fuse", &tooth, &"-o", &again, &"--every", &"1", &"--frames", &"0..10", &"--json"]));
    assert_eq!(more["clouds"], 5);
}

#[test]
fn clouds_that_are_lost_are_counted_by_reason_and_told_by_the_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let [model, poses] = ["prism.ply", "poses.csv"].map(|name| folder.path().join(name));
    // A prism can be shifted along itself.
    let output = fringeflow(&[&"fuse", &recorded("faults.mcap"), &"-o", &model, &"--trajectory", &poses, &"--json"]);
    assert_ended(&output, 3, &["clouds are not in the model", "is not determined by the surface"]);
    let said = json(&output);
    let lost = said["lost"]["degenerate"].as_u64().unwrap();
    assert_eq!(said["merged"].as_u64().unwrap() + lost, said["clouds"].as_u64().unwrap());
    let text = std::fs::read_to_string(&poses).unwrap();
    assert_eq!(text.matches(",degenerate,").count() as u64, lost);
    assert!(model.exists());
}

#[test]
fn what_cannot_be_fused_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("model.ply");
    assert_ended(&fringeflow(&[&"fuse", &dataset(), &"-o", &model]), 2, &["plane", "give a recording"]);
    let tooth = recorded("tooth.mcap");
    let cloud = folder.path().join("model.pcd");
    assert_ended(&fringeflow(&[&"fuse", &tooth, &"-o", &cloud]), 2, &["model.pcd", "use .ply"]);
    let nowhere = folder.path().join("nowhere/model.ply");
    assert_ended(&fringeflow(&[&"fuse", &tooth, &"-o", &nowhere]), 1, &["nowhere", "does not exist"]);
    let poses = folder.path().join("poses.txt");
    let trajectory = fringeflow(&[&"fuse", &tooth, &"-o", &model, &"--trajectory", &poses]);
    assert_ended(&trajectory, 2, &["poses.txt", "use .csv"]);
    let frames = fringeflow(&[&"fuse", &tooth, &"-o", &model, &"--frames", &"4..4000"]);
    assert_ended(&frames, 2, &["--frames 4..4000", "image pairs 0.."]);
    let few = fringeflow(&[&"fuse", &tooth, &"-o", &model, &"--frames", &"4..7"]);
    assert_ended(&few, 2, &["3 image pairs", "complete window of 6"]);
    let none = fringeflow(&[&"fuse", &tooth, &"-o", &model, &"--every", &"0"]);
    assert_eq!(none.status.code(), Some(2));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
