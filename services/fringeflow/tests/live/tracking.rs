//! A scanner that is tracked while it scans: poses, the state that is shown, and the account of every cloud.

use std::time::Duration;

use fringeflow_message::{DropReason, PriorHeader, Stage, TrackingState};
use fringeflow_recording::{Content, Recording, Topic};
use fringeflow_runtime::clock::now_ns;
use fringeflow_transport::{ChannelSizes, Node, Publisher, TRACKING_PRIOR};

use crate::support::{Bench, NAME};

/// Tracking, of an object that takes this table.
const TRACKED: &str = "[tracking]\nenabled = true\nmerge_every = 2\nshown_every_s = 0.1\n[monitor]";

/// Of a body with relief, in images that show it.
pub(crate) const TRACKED_BODY: [(&str, &str); 5] = [
    ("[monitor]", TRACKED),
    ("object = \"plane\"", "object = \"nose\""),
    ("size_px = [96, 80]", "size_px = [160, 128]"),
    ("period_px = 48.0", "period_px = 32.0"),
    ("poses = 8", "poses = 60"),
];

fn bench() -> Bench {
    Bench::with(&TRACKED_BODY)
}

#[test]
fn poses_are_recorded_add_up_and_come_again_to_the_bit() {
    let bench = bench();
    let recording = bench.path("scan.mcap");
    let ended = bench.run(&[&"--seconds", &"4", &"--record", &recording]);
    ended.assert_undisturbed();
    bench.assert_nothing_left();
    let stage = ended.stage("tracking");
    assert!(stage.passed > 3, "{ended:?}");
    assert_eq!(stage.taken, ended.stage("cloud").passed);
    let told = stage.passed + stage.dropped(DropReason::NotTracked);
    let lost = ended.stage("recorder").dropped(DropReason::Overrun);

    let opened = Recording::open(&recording).unwrap();
    let (mut first, mut poses, mut reports) = (None, 0, 0);
    for message in opened.messages_of(Topic::Pose) {
        let Content::Pose(report) = message.unwrap().content else { panic!("no pose") };
        reports += 1;
        assert_eq!(*first.get_or_insert(report.first_cloud), report.first_cloud, "one model");
        if report.has_pose() {
            poses += 1;
            let begins = report.state() == Some(TrackingState::First);
            assert_eq!(report.cloud == report.first_cloud, begins, "{report:?}");
            // The first is where it is; nobody else knows that to nothing.
            assert_eq!(report.sd_m > 0.0 && report.sd_rad > 0.0, !begins, "{report:?}");
            // The sweep leads a millimetre to each side.
            assert!(report.position_m.iter().all(|x| x.abs() < 0.005), "{report:?}");
        } else {
            assert_eq!((report.rotation, report.position_m), ([0.0; 4], [0.0; 3]), "{report:?}");
        }
    }
    assert!(reports <= told && reports + lost >= told, "{reports} of {told} reports: {ended:?}");
    // The transforms of the rig, and one for every pose.
    assert_eq!(opened.count(Topic::Transforms) as u64, 1 + poses);

    let codes: &[i32] = if lost > 0 { &[0, 3] } else { &[0] };
    for threads in ["1", "2"] {
        let verified = bench.json(codes, &[&"--threads", &threads, &"replay", &recording, &"--verify", &"--json"]);
        assert_eq!((&verified["different"], &verified["prior_missing"]), (&0.into(), &0.into()), "{verified}");
        let verified = &verified["poses"];
        assert_eq!((&verified["poses"], &verified["different"]), (&reports.into(), &0.into()), "{verified}");
        assert!(lost > 0 || verified["same"] == reports, "{verified}");
    }
    // Windows behind the second cloud were told what the tracking knew.
    let told = opened.cloud_headers().filter(|header| header.window.prior_number().is_some()).count();
    assert!(told > 0 && opened.count(Topic::Prior) > 0, "{told} clouds, {} priors", opened.count(Topic::Prior));
    // A replay that waits for every stage tracks every cloud.
    let replayed = bench.replay(&[&"replay", &recording, &"--rate", &"max", &"--verify"]);
    replayed.assert_balanced();
    assert_eq!(replayed.stage("tracking").dropped(DropReason::Thinned), 0, "{replayed:?}");
    assert_eq!(replayed.stage("tracking").taken, replayed.stage("cloud").passed);
    let compared = &replayed.summary["compared"];
    assert_eq!((&compared["different"], &compared["missing"]), (&0.into(), &0.into()), "{replayed:?}");
}

/// Inverse depths of 160 × 128 pixels, 0.3 m everywhere.
fn relief() -> Vec<u8> {
    std::iter::repeat_n(7282_u16.to_le_bytes(), 10 * 8).flatten().collect()
}

#[test]
fn priors_of_a_program_that_errs_are_refused_or_do_no_harm() {
    let external = TRACKED.replace("[monitor]", "prior = \"external\"\n[monitor]");
    let mut changes = TRACKED_BODY;
    changes[0].1 = &external;
    let bench = Bench::with(&changes);
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    let node = Node::open(&bench.instance(), "priors").unwrap();
    let sizes = ChannelSizes { prior_bytes: relief().len(), ..ChannelSizes::default() };
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
        // An hour ahead: settled for no window.
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
            let mut relief = relief();
            wrong(&mut header, &mut relief);
            // Each comes twice, the second time with something else, and every tenth number is lost.
            priors.send(&header, &relief).unwrap();
            priors.send(&PriorHeader { velocity_m_s: [0.1; 3], ..header }, &relief).unwrap();
            number += if number % 10 == 8 { 2 } else { 1 };
            std::thread::sleep(Duration::from_millis(20));
        }
        bench.counts(Stage::Cloud).passed > 30
    });
    drop(priors);
    let ended = live.quit();
    ended.assert_balanced();
    assert_eq!(&ended.summary["restarts"], &0, "{ended:?}");
    let opened = Recording::open(&recording).unwrap();
    let told = opened.cloud_headers().filter(|header| header.window.prior_number().is_some()).count();
    assert!(told > 10, "{told} clouds were told something");
    let verified = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    assert_eq!((&verified["different"], &verified["prior_missing"]), (&0.into(), &0.into()), "{verified}");
}

#[test]
fn a_scanner_that_is_lost_says_so_and_puts_out_no_pose() {
    // Along a plane nothing tells how far it was moved.
    let bench = Bench::with(&[("[monitor]", TRACKED)]);
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    let mut tracking = serde_json::Value::Null;
    let mut becomes = |state: &str| {
        live.wait_until(state, || {
            tracking = bench.json(&[0], &[&"status", &NAME, &"--json"])["tracking"].take();
            tracking["state"] == state
        });
        tracking.clone()
    };
    let lost = becomes("lost");
    assert_eq!((&lost["reason"], &lost["model_clouds"]), (&"degenerate".into(), &1.into()), "{lost}");
    assert!(bench.done(&[0], &[&"status", &NAME]).contains("tracking: lost (degenerate)"));
    bench.done(&[0], &[&"control", &NAME, &"stop"]);
    becomes("no_cloud");
    let ended = live.quit();
    ended.assert_undisturbed();
    let stage = ended.stage("tracking");
    assert!(stage.passed == 1 && stage.dropped(DropReason::NotTracked) > 0, "{ended:?}");
    let opened = Recording::open(&recording).unwrap();
    assert!(opened.count(Topic::Pose) > 1 && opened.count(Topic::Transforms) <= 2);
    bench.assert_nothing_left();
}
