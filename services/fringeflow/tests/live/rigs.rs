//! The examples in `configs/rigs/` do what their comments say, before anything is built: the virtual scanner takes the
//! images of each rig, live and for a dataset with truth.

use std::fs;
use std::path::{Path, PathBuf};

use fringeflow::calibration::{Unit, read_calibration};

use crate::support::{Bench, NAME};

/// Part of the images that is scanned live, in the middle of them: width and height, pixels.
const PART_PX: [usize; 2] = [320, 256];

/// The examples, by name.
fn examples() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/rigs");
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = files.filter(|file| file.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    assert_eq!(files.len(), 5, "{files:?}");
    files
}

#[test]
fn every_example_rig_finds_the_object_in_a_simulated_dataset() {
    for example in examples() {
        let bench = Bench::from_configuration("");
        let set = bench.path("set");
        bench.execute(&[0], &[&"simulate", &"--config", &example, &"-o", &set]);
        let found = bench.json(&[0], &[&"evaluate", &set, &"--json"]);
        let [com, fpc] = ["com_percent", "fpc_percent"].map(|figure| found[figure].as_f64().unwrap());
        assert!(com > 99.0 && fpc < 0.1, "{}: com {com} %, fpc {fpc} %", example.display());
    }
}

#[test]
fn every_example_rig_scans_live_without_its_devices() {
    examples().iter().for_each(|example| scan(example));
}

/// Runs an example with a part of its images, so that any machine has the memory: its other keys stay, but for the name of
/// the bench and the rate.
fn scan(example: &Path) {
    let text = fs::read_to_string(example).unwrap();
    let calibration = example.with_extension("yml");
    let size_px = match read_calibration(&calibration, Unit::Millimetre) {
        Ok(rig) => [rig.cam1.width_px(), rig.cam1.height_px()],
        // The built-in rig.
        Err(_) => [640, 512],
    };
    let [x, y] = [0, 1].map(|axis| (size_px[axis] - PART_PX[axis]) / 2);
    let part = format!("rate_hz = 10.0\nregion_px = [{x}, {y}, {}, {}]", PART_PX[0], PART_PX[1]);
    let line = |key: &str| text.lines().find(|line| line.starts_with(key)).unwrap();
    let text = text.replace(line("name = "), &format!("name = \"{NAME}\"")).replace(line("rate_hz = "), &part);
    // The scanner of `virtual.toml` moves along a long sweep, whose images take minutes to render. The others rest.
    let short = "\n[virtual_scanner.sweep]\nposes = 4\ntravel_mm = [0, 0, 0]\nturn_deg = [0, 0, 0]\n";
    let sweep = if text.contains("source = \"virtual\"") { short } else { "" };
    let bench = Bench::from_configuration(&format!("{text}{sweep}"));
    if calibration.exists() {
        fs::copy(&calibration, bench.path(calibration.file_name().unwrap().to_str().unwrap())).unwrap();
    }
    let recording = bench.path("scan.mcap");
    let run = bench.run(&[&"--virtual", &"--seconds", &"3", &"--record", &recording, &"--no-report"]);
    run.assert_undisturbed();
    assert_eq!(run.summary["virtual_images"], true);
    assert!(run.log.contains("the images are virtual"), "{}", run.log);
    assert!(run.stage("cloud").passed > 0, "{}: {run:?}", example.display());
    assert_eq!(bench.json(&[0], &[&"info", &recording, &"--json"])["virtual_images"], true);
    let points = bench.json(&[0], &[&"reconstruct", &recording, &"-o", &bench.path("cloud.ply"), &"--json"]);
    let points = points["points"].as_u64().unwrap();
    // The object fills a part of the image.
    assert!(points > 2000, "{}: {points} points", example.display());
    bench.assert_nothing_left();
}
