//! Check, export and summary of a recording.

use fringeflow::cloud::RECORD_BYTES;
use fringeflow_dataset::Dataset;

use super::*;

#[test]
fn non_finite_numbers_and_gaps_are_found() {
    let folder = Folder::new();
    let recorder = start_recording(&folder, "cloud.mcap");
    let mut records = vec![0; RECORD_BYTES];
    records[0..4].copy_from_slice(&f32::NAN.to_le_bytes());
    recorder.push(&Recordable::Cloud { header: &cloud(1), records: &records });
    let check = finished(recorder).check(|| ()).unwrap();
    assert_eq!(check.fault_count, 1);
    assert!(check.faults[0].contains("point 0 has a number that is not finite"), "{:?}", check.faults);

    let recorder = start_recording(&folder, "gaps.mcap");
    for sequence in [3, 4, 7, 7] {
        let header = frame(1, sequence);
        recorder.push(&Recordable::Frame { header: &header, image: &frame_bytes(&header) });
    }
    recorder.push(&Recordable::Pattern(&pattern()));
    recorder.push(&Recordable::Pattern(&PatternEvent { sequence: 35, step: 4, ..pattern() }));
    let check = finished(recorder).check(|| ()).unwrap();
    assert_eq!(
        (check.losses.missing_images, check.repeated_images, check.losses.missing_patterns),
        ([2, 0], [1, 0], 3)
    );
    assert_eq!(check.fault_count, 1);
    assert!(check.faults[0].contains("step is 4"), "{:?}", check.faults);
}

#[test]
fn an_exported_import_is_the_same_folder() {
    let folder = Folder::new();
    let recording = Recording::open(&imported(&folder)).unwrap();
    let target = folder.path("exported");
    export_images(&recording, &recording.pairs().unwrap(), &target, || ()).unwrap();
    let names = ["meta.json", "calibration.yml", "truth.npz", "cam1/phase_00.png", "cam2/phase_03.png"];
    for name in names {
        let [a, b] = [&dataset().folder, &target].map(|folder| std::fs::read(folder.join(name)).unwrap());
        assert!(a == b, "{name}");
    }
    let again = folder.path("again.mcap");
    import(&Dataset::open(&target, None).unwrap(), &again, &import_options(), || ()).unwrap();
    assert!(std::fs::read(again).unwrap() == std::fs::read(recording.path()).unwrap());
}

#[test]
fn a_summary_names_topics_rates_marks_and_losses() {
    let folder = Folder::new();
    let recorder = start_recording(&folder, "a.mcap");
    for sequence in 0..5 {
        let header = FrameHeader { received_ns: sequence * 20_000_000, ..frame(2, sequence) };
        recorder.push(&Recordable::Frame { header: &header, image: &frame_bytes(&header) });
    }
    recorder.push(&Recordable::Mark { time_ns: 50_000_000, text: "left side" });
    recorder.push(&Recordable::Report(&report()));
    let summary = finished(recorder).summary().unwrap();
    let frames = summary.topics.iter().find(|topic| topic.topic == "/cam2/frame").unwrap();
    assert_eq!(frames.messages, 5);
    assert!((frames.rate_hz.unwrap() - 50.0).abs() < 1e-9);
    assert_eq!(summary.marks, [Remark { time_s: 0.05, text: "left side".to_owned() }]);
    assert_eq!(summary.stages[0].dropped, [("overrun", 2), ("unpaired", 7)].into());
    assert!((summary.duration_s - 0.08).abs() < 1e-9 && summary.lost.lost == Some(0));
}

#[test]
fn numbers_at_their_limits_are_counted_without_overflow() {
    let folder = Folder::new();
    let recorder = start_recording(&folder, "a.mcap");
    for session in 0..2 {
        for sequence in [0, u64::MAX] {
            let header = FrameHeader { session, exposure_start_ns: sequence, received_ns: sequence, ..frame(1, 0) };
            let header = FrameHeader { sequence, ..header };
            recorder.push(&Recordable::Frame { header: &header, image: &frame_bytes(&header) });
            recorder.push(&Recordable::Pattern(&PatternEvent { session, sequence, ..pattern() }));
        }
    }
    let recording = finished(recorder);
    let check = recording.check(|| ()).unwrap();
    assert_eq!((check.losses.missing_images[0], check.losses.missing_patterns), (u64::MAX, u64::MAX));
    assert!(recording.pairs().unwrap().is_empty());
    assert!(recording.summary().unwrap().duration_s > 1e9);
}
