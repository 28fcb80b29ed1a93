//! `fringeflow verify` by the command line: what is known of a simulated scanner is what the field check finds.

// A test fails if its preparation fails.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};

use fringeflow::calibration::{Unit, read_calibration, write_calibration};
use fringeflow::geometry::{Pose, Rig};
use serde_json::Value;
use tempfile::TempDir;

fn run(folder: &Path, arguments: &str) -> Output {
    let command = &mut Command::new(env!("CARGO_BIN_EXE_fringeflow"));
    command.current_dir(folder).args(arguments.split_whitespace()).output().unwrap()
}

fn results(folder: &Path, arguments: &str) -> Value {
    let output = run(folder, &format!("verify {arguments} --json"));
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// A folder with the dataset `set`.
fn simulated(options: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let all = format!("simulate -o set --no-gray --steps 4 --supersampling 1 --sd 0 {options}");
    let output = run(folder.path(), &all);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    folder
}

/// The worst value of a figure, millimetres.
fn worst(results: &Value, symbol: &str) -> f64 {
    let figures = results["figures"].as_array().unwrap();
    let figure = figures.iter().find(|figure| figure["symbol"] == symbol).unwrap();
    figure["worst_mm"].as_f64().unwrap()
}

fn causes(results: &Value) -> Vec<&str> {
    results["causes"].as_array().unwrap().iter().filter_map(|cause| cause["cause"].as_str()).collect()
}

/// Writes the calibration again with another rig.
fn recalibrate(folder: &Path, change: impl Fn(Rig) -> Rig) {
    let path = folder.join("set/calibration.yml");
    let rig = read_calibration(&path, Unit::Millimetre).unwrap();
    write_calibration(&path, &change(rig), Unit::Millimetre).unwrap();
}

fn longer(pose: Pose, factor: f64) -> Pose {
    Pose::from_parts((pose.translation.vector * factor).into(), pose.rotation)
}

#[test]
fn an_exact_scanner_has_hardly_any_error_and_a_longer_base_is_told_as_scale() {
    let folder = simulated("--object ball-bar --noise none");
    let exact = results(folder.path(), "set --artefact ball-bar:20,60");
    assert!(worst(&exact, "SD").abs() < 0.003 && worst(&exact, "PS").abs() < 0.012, "{exact}");
    assert!(worst(&exact, "PF") < 0.02 && worst(&exact, "noise") < 0.003, "{exact}");
    assert_eq!(exact["points"]["far"], 0);
    assert!(!causes(&exact).contains(&"scale"), "{exact}");
    recalibrate(folder.path(), |rig| Rig {
        cam2_from_cam1: longer(rig.cam2_from_cam1, 1.001),
        projector_from_cam1: longer(rig.projector_from_cam1, 1.001),
        ..rig
    });
    let long = results(folder.path(), "set --artefact ball-bar:20,60");
    assert!((worst(&long, "SD") - worst(&exact, "SD") - 0.06).abs() < 0.001, "{long}");
    assert!((worst(&long, "noise") / worst(&exact, "noise") - 1.0).abs() < 0.1, "{long}");
    let told = long["causes"][0]["text"].as_str().unwrap();
    assert!(causes(&long)[0] == "scale" && (told.starts_with("+0.09") || told.starts_with("+0.10")), "{long}");
}

#[test]
fn noise_shows_in_precision_and_a_wrong_lens_in_flatness() {
    let sets =
        ["low", "normal", "high"].map(|noise| simulated(&format!("--object plane --board none --noise {noise}")));
    let flat = sets.each_ref().map(|folder| results(folder.path(), "set --artefact plane"));
    let noise = flat.each_ref().map(|results| worst(results, "noise"));
    assert!(noise[0] < 0.7 * noise[1] && noise[1] < 0.7 * noise[2], "{noise:?}");
    for results in &flat {
        // The form stays below a fifth of the noise of a point.
        assert!(worst(results, "form") < 0.2 * worst(results, "noise"), "{results}");
        assert!(causes(results).is_empty(), "{results}");
    }
    let folder = &sets[1];
    recalibrate(folder.path(), |mut rig| {
        let mut distortion = *rig.cam2.distortion();
        distortion.radial[0] += 0.05;
        let size = [rig.cam2.width_px(), rig.cam2.height_px()];
        rig.cam2 = fringeflow::geometry::Camera::new(rig.cam2.focal_px(), rig.cam2.principal_px(), distortion, size);
        rig
    });
    let bent = results(folder.path(), "set --artefact plane");
    assert_eq!(causes(&bent), ["bend"], "{bent}");
    assert!(worst(&bent, "F") > 1.3 * worst(&flat[1], "F") && worst(&bent, "form") > 5.0 * worst(&flat[1], "form"));
    assert!((worst(&bent, "noise") / noise[1] - 1.0).abs() < 0.1, "{bent}");
}

#[test]
fn limits_decide_the_exit_code_and_the_page_tells_it() {
    let folder = simulated("--object sphere");
    let file = |pf_mm: f64| {
        let text = format!("kind = \"sphere\"\nname = \"<b>\"\ndiameters_mm = [20.0]\n[limits]\npf_mm = {pf_mm}\n");
        std::fs::write(folder.path().join("ball.toml"), text).unwrap();
        run(folder.path(), "verify set --artefact ball.toml --report page.html")
    };
    for (pf_mm, code, told) in [(0.5, 0, "within all limits"), (0.001, 1, "outside the limits")] {
        let output = file(pf_mm);
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.code() == Some(code) && text.contains(told), "{text}");
        let page = std::fs::read_to_string(folder.path().join("page.html")).unwrap();
        assert!(page.contains(told) && page.contains("&lt;b&gt;") && page.contains("<svg"), "{told}");
        assert!(!page.contains("<script") && !page.contains("NaN"));
    }
    // A cloud that was written to a file has the same figures, except what rounding to single precision changes.
    assert!(run(folder.path(), "reconstruct set -o cloud.ply").status.success());
    let [direct, file] =
        ["set", "cloud.ply"].map(|input| results(folder.path(), &format!("{input} --artefact sphere:20")));
    assert!((worst(&direct, "PS") - worst(&file, "PS")).abs() < 1e-4, "{direct} {file}");
}

#[test]
fn where_no_artefact_is_no_figure_is_printed() {
    let folder = simulated("--object elephant --size 320x256");
    for artefact in ["plane", "sphere:20", "ball-bar:20,60"] {
        let output = run(folder.path(), &format!("verify set --artefact {artefact} --report page.html"));
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(1) && error.contains("measured in none"), "{artefact}: {error}");
        assert!(output.stdout.is_empty() && !folder.path().join("page.html").exists());
    }
    let refused = run(folder.path(), "verify set --artefact cube:20");
    assert_eq!(refused.status.code(), Some(2));
}
