//! Tracking during the scan: poses, the displayed state, and the count of every cloud.

use std::time::Duration;

use fringeflow_message::{DropReason, PriorHeader, Stage, TrackingState};
use fringeflow_recording::{Content, Recording, Topic};
use fringeflow_runtime::clock::now_ns;
use fringeflow_transport::{ChannelSizes, Node, Publisher, TRACKING_PRIOR};

use crate::support::{Bench, NAME};

/// Enables tracking.
const TRACKED: &str = "[tracking]\nenabled = true\nmerge_every = 2\nshown_every_s = 0.1\n[monitor]";

/// Enables tracking of an object with relief, in images with enough pixels to show it.
pub(crate) const TRACKED_BODY: [(&str, &str); 5] = [
    ("[monitor]", TRACKED),
    ("object = \"plane\"", "object = \"nose\""),
    ("size_px = [96, 80]", "size_px = [160, 128]"),
    ("period_px = 48.0", "period_px = 32.0"),
    ("poses = 8", "poses = 60"),
];

fn tracked_bench() -> Bench {
    Bench::with_changes(&TRACKED_BODY)
}

#[test]
fn poses_are_recorded_counted_and_replayed_bit_for_bit() {
    let bench = tracked_bench();
    let recording = bench.path("scan.mcap");
    let run = bench.run(&[&"--seconds", &"4", &"--record", &recording]);
    run.assert_undisturbed();
    bench.assert_nothing_left();
    let stage = run.stage("tracking");
    assert!(stage.passed > 3, "{run:?}");
    assert_eq!(stage.taken, run.stage("cloud").passed);
    // A cloud without a pose counts as dropped, but is reported too.
    let sent = stage.passed + stage.dropped(DropReason::NotTracked);
    let lost = run.stage("recorder").dropped(DropReason::Overrun);

    let opened = Recording::open(&recording).unwrap();
    let (mut first_cloud, mut poses, mut reports) = (None, 0, 0);
    for message in opened.messages_of(Topic::Pose) {
        let Content::Pose(report) = message.unwrap().content else { panic!("no pose") };
        reports += 1;
        assert_eq!(*first_cloud.get_or_insert(report.first_cloud), report.first_cloud, "there is one model");
        if report.has_pose() {
            poses += 1;
            let is_first = report.state() == Some(TrackingState::First);
            assert_eq!(report.cloud == report.first_cloud, is_first, "{report:?}");
            // The first pose defines the frame, so it alone has no uncertainty.
            assert_eq!(report.sd_m > 0.0 && report.sd_rad > 0.0, !is_first, "{report:?}");
            // The sweep goes a millimetre to each side.
            assert!(report.position_m.iter().all(|x| x.abs() < 0.005), "{report:?}");
        } else {
            assert_eq!((report.rotation, report.position_m), ([0.0; 4], [0.0; 3]), "{report:?}");
        }
    }
    assert!(reports <= sent && reports + lost >= sent, "{reports} of {sent} reports: {run:?}");
    // One message with the transforms of the rig, and one for every pose.
    assert_eq!(opened.count(Topic::Transforms) as u64, 1 + poses);

    let codes: &[i32] = if lost > 0 { &[0, 3] } else { &[0] };
    for threads in ["1", "2"] {
        let verified = bench.json(codes, &[&"--threads", &threads, &"replay", &recording, &"--verify", &"--json"]);
        assert_eq!((&verified["different"], &verified["prior_missing"]), (&0.into(), &0.into()), "{verified}");
        let verified = &verified["poses"];
        assert_eq!((&verified["poses"], &verified["different"]), (&reports.into(), &0.into()), "{verified}");
        assert!(lost > 0 || verified["same"] == reports, "{verified}");
    }
    // Some windows were processed with a prior from the tracking.
    let with_prior = opened.cloud_headers().filter(|header| header.window.prior_number().is_some()).count();
    let priors = opened.count(Topic::Prior);
    assert!(with_prior > 0 && priors > 0, "{with_prior} clouds, {priors} priors");
    // A replay that waits for every stage tracks every cloud.
    let replayed = bench.replay(&[&"replay", &recording, &"--rate", &"max", &"--verify"]);
    replayed.assert_balanced();
    assert_eq!(replayed.stage("tracking").dropped(DropReason::Thinned), 0, "{replayed:?}");
    assert_eq!(replayed.stage("tracking").taken, replayed.stage("cloud").passed);
    let compared = &replayed.summary["compared"];
    assert_eq!((&compared["different"], &compared["missing"]), (&0.into(), &0.into()), "{replayed:?}");
}

/// Returns inverse depths for images of 160 × 128 pixels, 0.3 m everywhere.
fn inverse_depths() -> Vec<u8> {
    std::iter::repeat_n(7282_u16.to_le_bytes(), 10 * 8).flatten().collect()
}

#[test]
fn wrong_priors_from_an_external_program_are_refused_or_do_no_harm() {
    let external = TRACKED.replace("[monitor]", "prior = \"external\"\n[monitor]");
    let mut changes = TRACKED_BODY;
    changes[0].1 = &external;
    let bench = Bench::with_changes(&changes);
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    let node = Node::open(&bench.instance(), "priors").unwrap();
    let sizes = ChannelSizes { prior_bytes: inverse_depths().len(), ..ChannelSizes::default() };
    let mut priors = Publisher::open(&node, TRACKING_PRIOR, &sizes).unwrap();
    let wrong: [fn(&mut PriorHeader, &mut Vec<u8>); 9] = [
        |_, _| (),
        |prior, _| prior.velocity_m_s = [f64::NAN; 3],
        |prior, _| prior.velocity_m_s = [60.0, -60.0, 60.0],
        |prior, _| prior.rate_rad_s = [1e300; 3],
        |_, relief| relief.truncate(17),
        |prior, _| prior.width_px = u32::MAX,
        |prior, _| prior.drift = [1e30; _],
        |prior, _| prior.drift = [f32::NAN; _],
        // An hour ahead, so that it applies to no window.
        |prior, _| prior.published_ns += 3_600_000_000_000,
    ];
    let mut number = 0;
    live.wait_until("enough clouds are made", || {
        for wrong in wrong {
            let time_ns = now_ns();
            let mut header = PriorHeader {
                published: number,
                centre_ns: time_ns,
                published_ns: time_ns,
                width_px: 160,
                height_px: 128,
                ..PriorHeader::default()
            };
            let mut relief = inverse_depths();
            wrong(&mut header, &mut relief);
            // Every prior is sent twice, the second time with another velocity. Every tenth number is missing.
            priors.send(&header, &relief).unwrap();
            priors.send(&PriorHeader { velocity_m_s: [0.1; 3], ..header }, &relief).unwrap();
            number += if number % 10 == 8 { 2 } else { 1 };
            std::thread::sleep(Duration::from_millis(20));
        }
        bench.counts(Stage::Cloud).passed > 30
    });
    drop(priors);
    let run = live.quit();
    run.assert_balanced();
    assert_eq!(&run.summary["restarts"], &0, "{run:?}");
    let opened = Recording::open(&recording).unwrap();
    let with_prior = opened.cloud_headers().filter(|header| header.window.prior_number().is_some()).count();
    assert!(with_prior > 10, "{with_prior} clouds have a prior");
    let verified = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    assert_eq!((&verified["different"], &verified["prior_missing"]), (&0.into(), &0.into()), "{verified}");
}

#[test]
fn a_lost_scanner_is_reported_and_publishes_no_pose() {
    // A plane does not determine the motion along itself.
    let bench = Bench::with_changes(&[("[monitor]", TRACKED)]);
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    let mut tracking = serde_json::Value::Null;
    let mut wait_for_state = |state: &str| {
        live.wait_until(&format!("the tracking is {state}"), || {
            tracking = bench.json(&[0], &[&"status", &NAME, &"--json"])["tracking"].take();
            tracking["state"] == state
        });
        tracking.clone()
    };
    let lost = wait_for_state("lost");
    assert_eq!((&lost["reason"], &lost["model_clouds"]), (&"degenerate".into(), &1.into()), "{lost}");
    assert!(bench.execute(&[0], &[&"status", &NAME]).contains("tracking: lost (degenerate)"));
    bench.execute(&[0], &[&"control", &NAME, &"stop"]);
    wait_for_state("no_cloud");
    let run = live.quit();
    run.assert_undisturbed();
    let stage = run.stage("tracking");
    assert!(stage.passed == 1 && stage.dropped(DropReason::NotTracked) > 0, "{run:?}");
    let opened = Recording::open(&recording).unwrap();
    assert!(opened.count(Topic::Pose) > 1 && opened.count(Topic::Transforms) <= 2);
    bench.assert_nothing_left();
}
