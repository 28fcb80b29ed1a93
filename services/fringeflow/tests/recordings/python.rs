//! The Python package `mcap` reads a recording by its embedded schemas.

use sha2::{Digest as _, Sha256};

use fringeflow::cloud::{RECORD_BYTES, read_records};
use fringeflow_dataset::{CALIBRATION_FILE, CameraId, Dataset, META_FILE, TRUTH_FILE};
use fringeflow_message::{CloudHeader, DropReason, Stage, StageReport, Window};
use fringeflow_recording::{DEFAULT_QUEUE_BYTES, Opening, Origin, Recordable, Recorder};

use super::*;

/// Runs the Python script on a recording. Returns what the script read.
fn read_in_python(recording: &Path) -> Value {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let prepared = Command::new(root.join("scripts/python.sh")).output().unwrap();
    assert!(prepared.status.success(), "{}", String::from_utf8_lossy(&prepared.stderr));
    let python = String::from_utf8(prepared.stdout).unwrap();
    let script = root.join("tests/python/read_recording.py");
    let output = Command::new(python.trim()).arg(script).arg(recording).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    json(&output)
}

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the values of all messages of a topic.
fn values<'a>(read: &'a Value, topic: &str) -> Vec<&'a Value> {
    read["topics"][topic].as_array().unwrap().iter().map(|entry| &entry[2]).collect()
}

#[test]
fn python_reads_the_images_steps_and_attachments_of_an_imported_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let read = read_in_python(&import_dataset(&folder));
    let [width, height] = SIZE_PX;
    let images = Dataset::open(dataset(), None).unwrap().phase_images(CameraId::Cam2, &[0, 1, 2, 3]).unwrap();
    for (value, image) in values(&read, "/cam2/frame").into_iter().zip(&images) {
        assert_eq!(*value, serde_json::json!([width, height, width, "mono8", sha256(&image.pixels)]));
    }
    let steps: Vec<_> = values(&read, "/projector/pattern").iter().map(|value| value[1].as_u64().unwrap()).collect();
    assert_eq!(steps, [0, 1, 2, 3]);
    assert_eq!(*values(&read, "/cam1/header")[3], serde_json::json!([3, 1_060_000_000, 1]));
    assert_eq!(read["topics"]["/cam1/frame"][3][0], 1_080_000_000);
    assert_eq!(*values(&read, "/tf")[0], serde_json::json!(["cam2", "projector", "volume"]));
    // Four frames and headers per camera, four patterns, the transforms and two calibrations.
    assert_eq!(read["counted"], 4 * 4 + 4 + 3);
    for name in [CALIBRATION_FILE, META_FILE, TRUTH_FILE] {
        assert_eq!(read["attachments"][name], sha256(&std::fs::read(dataset().join(name)).unwrap()), "{name}");
    }
    assert_eq!(read["metadata"]["fringeflow"]["format"], "2");
    assert_eq!(read["metadata"]["fringeflow.recorder"]["written"], "12");
}

#[test]
fn python_reads_the_fields_of_clouds_reports_and_marks() {
    let folder = tempfile::tempdir().unwrap();
    let setup = Dataset::open(dataset(), None).unwrap().setup;
    let origin = Origin::here();
    let opening = Opening { setup: &setup, configuration: "", origin: &origin, min_free_bytes: 0 };
    let recorder = Recorder::create(&folder.path().join("live.mcap"), &opening, DEFAULT_QUEUE_BYTES).unwrap();
    // These bytes are finite numbers in every field.
    let records: Vec<u8> = (0..5 * RECORD_BYTES).map(|i| (i % 100) as u8).collect();
    let mut window = Window { images: 4, ..Window::default() };
    window.cam1_sequence[..4].copy_from_slice(&[8, 9, 6, 7]);
    let header = CloudHeader { points: 5, window, delta_sd_rad: 0.03125, published_ns: 77, ..CloudHeader::default() };
    recorder.push(&Recordable::Cloud { header: &header, records: &records });
    let mut report = StageReport { stage: Stage::Phase as u32, ..StageReport::default() };
    report.counts.taken = 12;
    report.counts.drop_many(DropReason::NextStageBusy, 3);
    recorder.push(&Recordable::Report(&report));
    recorder.push(&Recordable::Mark { time_ns: 9, text: "chin" });
    let read = read_in_python(&recorder.finish().unwrap().file);

    let points = read_records(&records).unwrap();
    let sum = |field: fn(&fringeflow::cloud::CloudPoint) -> f64| points.iter().map(field).sum::<f64>();
    let cloud = values(&read, "/cloud")[0];
    assert_eq!(cloud[0], 5);
    let sums = [
        (0, sum(|p| p.position_m[0].into())),
        (2, sum(|p| p.position_m[2].into())),
        (3, sum(|p| p.intensity.into())),
        (5, sum(|p| p.cam1_px[1].into())),
        (8, sum(|p| p.order.into())),
        (9, sum(|p| p.delta_rad.into())),
        (12, sum(|p| p.sigma_m.into())),
        (13, sum(|p| p.confidence.into())),
    ];
    for (field, expected) in sums {
        let read = cloud[1][field].as_f64().unwrap();
        assert!((read - expected).abs() <= 1e-9 * expected.abs(), "field {field}: {read} {expected}");
    }
    assert_eq!(*values(&read, "/cloud/header")[0], serde_json::json!([5, [8, 9, 6, 7], 0.03125]));
    assert_eq!(*values(&read, "/report/stage")[0], serde_json::json!(["phase", 12, { "next_stage_busy": 3 }]));
    assert_eq!(*values(&read, "/log")[0], serde_json::json!(["mark", "chin"]));
    // Python sees the time of the wall clock.
    assert_eq!(read["topics"]["/log"][0][0], 9 + origin.started_unix_ns - origin.started_ns);
}
