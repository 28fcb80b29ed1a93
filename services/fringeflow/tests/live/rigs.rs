//! The examples in `configs/rigs/`: each is run by the virtual scanner, which takes the images of its rig.

use std::path::{Path, PathBuf};

use toml::{Table, Value};

use fringeflow::calibration::{Unit, read_calibration, write_calibration};
use fringeflow::geometry::Readout;

use crate::support::{Bench, NAME};

/// Part of the images that is simulated, in the middle of them: width and height, pixels.
const PART_PX: [usize; 2] = [320, 256];

/// The examples, by name.
fn examples() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/rigs");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = files.filter(|file| file.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    files
}

#[test]
fn every_example_rig_scans_its_measurement_volume() {
    let examples = examples();
    assert_eq!(examples.len(), 5, "{examples:?}");
    for example in examples {
        scan(&example);
    }
}

/// Runs an example, and checks its account and its clouds.
fn scan(example: &Path) {
    let bench = Bench::from_configuration("");
    let table: Table = std::fs::read_to_string(example).unwrap().parse().unwrap();
    let simulated = simulated(table, example, &bench);
    std::fs::write(bench.configuration(), simulated.to_string()).unwrap();
    let recording = bench.path("scan.mcap");
    let run = bench.run(&[&"--seconds", &"3", &"--record", &recording]);
    run.assert_undisturbed();
    let points = bench.json(&[0], &[&"reconstruct", &recording, &"-o", &bench.path("cloud.ply"), &"--json"]);
    let points = points["points"].as_u64().unwrap();
    // The object fills a part of the image.
    assert!(points > 2000, "{}: {points} points", example.display());
    assert!(run.stage("cloud").passed > 0, "{}: {run:?}", example.display());
    bench.assert_nothing_left();
}

/// The configuration with the virtual scanner in place of cameras and projector, and a part of the images.
fn simulated(mut table: Table, example: &Path, bench: &Bench) -> Table {
    let instance = table["instance"].as_table_mut().unwrap();
    instance.insert("name".to_owned(), NAME.into());
    let mut cameras = Table::new();
    cameras.insert("source".to_owned(), "virtual".into());
    cameras.insert("rate_hz".to_owned(), 25.0.into());
    table.insert("cameras".to_owned(), cameras.into());
    table["projector"].as_table_mut().unwrap().insert("driver".to_owned(), "virtual".into());
    table.remove("processors");
    table.insert("monitor".to_owned(), Table::from_iter([("enabled".to_owned(), Value::from(false))]).into());
    let recorder = [("folder".to_owned(), Value::from("recordings")), ("min_free_mb".to_owned(), Value::from(0))];
    table.insert("recorder".to_owned(), Table::from_iter(recorder).into());
    let mut scanner: Table = "object = \"tooth\"\nboard = \"none\"\ncache = \"images\"\n[sweep]\nposes = 4\n\
                              travel_mm = [0, 0, 0]\nturn_deg = [0, 0, 0]\n"
        .parse()
        .unwrap();
    match table.get_mut("rig").and_then(Value::as_table_mut) {
        Some(rig) => {
            let file = example.with_file_name(rig["calibration"].as_str().unwrap());
            rig.insert("calibration".to_owned(), part_of(&file, bench).to_str().unwrap().into());
        }
        None => {
            let size = PART_PX.map(|side| Value::from(side as i64)).to_vec();
            scanner.insert("size_px".to_owned(), size.into());
        }
    }
    table.insert("virtual_scanner".to_owned(), scanner.into());
    table
}

/// Writes the calibration of a part of the images.
fn part_of(calibration: &Path, bench: &Bench) -> PathBuf {
    let rig = read_calibration(calibration, Unit::Millimetre).unwrap();
    let size_px = [rig.cam1.width_px(), rig.cam1.height_px()];
    let [x, y] = [0, 1].map(|axis| (size_px[axis] - PART_PX[axis]) / 2);
    let readout = Readout::new(size_px, Some([x, y, PART_PX[0], PART_PX[1]]), 1).unwrap();
    let path = bench.path("part.yml");
    write_calibration(&path, &readout.rig(&rig), Unit::Millimetre).unwrap();
    path
}
