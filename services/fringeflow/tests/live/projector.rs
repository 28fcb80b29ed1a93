//! External projector drivers.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use fringeflow_message::{DropReason, PATTERN_FRINGES, PatternEvent, Stage};
use fringeflow_runtime::clock::now_ns;
use fringeflow_transport::{ChannelSizes, Node, PROJECTOR_PATTERN, Publisher};

use crate::support::{Bench, NAME};

const EXTERNAL: (&str, &str) = ("driver = \"virtual\"", "driver = \"external\"");
const PERIOD_NS: u64 = 40_000_000;
/// Offset of a wrong exposure time. No exposure starts that late.
const HOUR_NS: u64 = 3_600_000_000_000;

#[test]
fn the_python_example_driver_drives_a_scan() {
    let bench = Bench::with_changes(&[EXTERNAL]);
    let live = bench.start(&[]);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let python = Command::new(root.join("scripts/python.sh")).output().unwrap();
    assert!(python.status.success(), "{}", String::from_utf8_lossy(&python.stderr));
    let mut driver = Command::new(String::from_utf8(python.stdout).unwrap().trim());
    driver.arg(root.join("examples/projector-driver/python/driver.py")).arg(NAME);
    driver.args("--steps 4 --period-px 48 --rate-hz 25 --patterns 60 --stop".split(' '));
    driver.env("FRINGEFLOW_RUNTIME_DIR", bench.runtime_dir()).stdin(Stdio::null());
    let output = driver.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stdout), "60 patterns announced\n");
    live.wait_until("all events have arrived", || bench.counts(Stage::Pattern).taken == 60);
    let run = live.quit();
    run.assert_undisturbed();
    assert_eq!(run.stage("pattern").taken, 60);
    assert!(run.stage("cloud").passed > 0, "{run:?}");
    bench.assert_nothing_left();
}

/// A driver in this process.
struct Driver {
    events: Publisher<(), PatternEvent>,
    start_ns: u64,
    sequence: u64,
}

impl Driver {
    fn new(bench: &Bench) -> Self {
        let node = Node::open(&bench.instance(), "driver").unwrap();
        let events = Publisher::open(&node, PROJECTOR_PATTERN, &ChannelSizes::default()).unwrap();
        Self { events, start_ns: now_ns(), sequence: 0 }
    }

    /// Waits until the next exposure starts, and announces its pattern. `change` can falsify the event.
    fn show(&mut self, change: impl FnOnce(&mut PatternEvent)) {
        let exposure_start_ns = self.start_ns + self.sequence * PERIOD_NS;
        std::thread::sleep(Duration::from_nanos(exposure_start_ns.saturating_sub(now_ns())));
        let mut event = PatternEvent {
            session: self.start_ns,
            sequence: self.sequence,
            exposure_start_ns,
            duration_ns: PERIOD_NS,
            period_px: 48.0,
            step: (self.sequence % 4) as u32,
            steps: 4,
            kind: PATTERN_FRINGES,
            reserved: 0,
        };
        change(&mut event);
        self.events.send_message(&event).unwrap();
        self.sequence += 1;
    }
}

#[test]
fn impossible_pattern_events_are_counted_and_make_no_cloud() {
    let bench = Bench::with_changes(&[EXTERNAL]);
    let live = bench.start(&[]);
    let mut driver = Driver::new(&bench);
    let impossible: [fn(&mut PatternEvent); 8] = [
        |event| event.step = 4,
        |event| event.step = u32::MAX,
        |event| (event.steps, event.step) = (0, 0),
        |event| event.period_px = 16.0,
        |event| event.period_px = f64::NAN,
        |event| event.kind = 7,
        |event| event.exposure_start_ns = 0,
        |event| event.exposure_start_ns += HOUR_NS,
    ];
    for change in impossible {
        (0..5).for_each(|_| driver.show(change));
    }
    live.wait_until("the impossible events have arrived", || bench.counts(Stage::Pattern).taken == 40);
    assert_eq!(bench.counts(Stage::Windowing).passed, 0);
    // The last events were an hour ahead. The driver is trusted again once its events are in order.
    let sent = driver.sequence;
    (0..40).for_each(|_| driver.show(|_| ()));
    live.wait_until("the correct events have arrived", || bench.counts(Stage::Pattern).taken == sent + 40);
    live.wait_until("there are clouds", || bench.counts(Stage::Cloud).passed > 0);
    drop(driver);
    let run = live.quit();
    run.assert_balanced();
    assert_eq!((run.code, &run.summary["restarts"]), (Some(3), &0.into()), "{run:?}");
    let pattern = run.stage("pattern");
    assert_eq!(pattern.dropped(DropReason::PatternConflict), 25, "{run:?}");
    assert_eq!(pattern.dropped(DropReason::NoPattern), 5, "{run:?}");
    assert!(pattern.dropped(DropReason::BadTime) >= 5, "{run:?}");
    // The cameras cannot expose at the wrong times.
    assert_eq!(run.stage("camera1").dropped(DropReason::BadTime), 10, "{run:?}");
    bench.assert_nothing_left();
}
