//! The example driver in Python, against channels opened from Rust.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use fringeflow_message::{
    Command as ScanCommand, ControlRequest, ControlResponse, PATTERN_FRINGES, PatternEvent, ScanState, Text,
};
use fringeflow_transport::{
    ChannelSizes, ControlServer, Instance, KeptChannels, Node, PROJECTOR_PATTERN, Publisher, SCAN_STATE, Subscriber,
};

const TIMEOUT: Duration = Duration::from_secs(60);
const SIZES: ChannelSizes = ChannelSizes {
    frame_bytes: 64,
    window: 4,
    map_blocks: 1,
    correspondence_blocks: 1,
    cloud_bytes: 64,
    model_points: 0,
    prior_bytes: 0,
};

/// The part of a supervisor that a driver sees.
struct Supervisor {
    config_file: PathBuf,
    _channels: KeptChannels,
    states: Publisher<(), ScanState>,
    events: Subscriber<(), PatternEvent>,
    control: ControlServer,
    state: ScanState,
    requests: Vec<(ScanCommand, String)>,
}

impl Supervisor {
    fn new(folder: &Path) -> Self {
        let instance = Instance::in_folder(folder, "driver").unwrap();
        let node = Node::open(&instance, "supervisor").unwrap();
        let config_file = folder.join("driver.iceoryx2.toml");
        std::fs::write(&config_file, instance.external_config().unwrap()).unwrap();
        Self {
            config_file,
            _channels: KeptChannels::open(&node, &SIZES).unwrap(),
            states: Publisher::open(&node, SCAN_STATE, &SIZES).unwrap(),
            events: Subscriber::open(&node, PROJECTOR_PATTERN, &SIZES).unwrap(),
            control: ControlServer::open(&node).unwrap(),
            state: ScanState::default(),
            requests: Vec::new(),
        }
    }

    fn driver(&self, arguments: &[&str]) -> Child {
        let root = &Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let python = Command::new(root.join("scripts/python.sh")).output().unwrap();
        assert!(python.status.success(), "{}", String::from_utf8_lossy(&python.stderr));
        let mut command = Command::new(String::from_utf8(python.stdout).unwrap().trim());
        command.arg(root.join("examples/projector-driver/python/driver.py"));
        command.arg("--config-file").arg(&self.config_file).args(arguments);
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Answers requests and publishes the state.
    fn serve(&mut self) {
        let (state, requests) = (&mut self.state, &mut self.requests);
        let answer = |request: &ControlRequest| {
            let command = ScanCommand::from_code(request.command).unwrap();
            requests.push((command, request.text.to_text()));
            state.revision += 1;
            match command {
                ScanCommand::Start => state.scanning = 1,
                ScanCommand::Stop => state.scanning = 0,
                ScanCommand::Mark => {
                    let text = Text::new("nothing is recorded");
                    return ControlResponse { refused: 1, text, state: *state, ..ControlResponse::default() };
                }
                _ => (),
            }
            ControlResponse { state: *state, ..ControlResponse::default() }
        };
        if self.control.answer(answer).unwrap() > 0 {
            self.states.send_message(&self.state).unwrap();
        }
        self.states.ensure_connected().unwrap();
    }

    /// Serves until the driver ends. Returns its exit code, its output, and the events that it sent.
    fn serve_until_end(&mut self, mut driver: Child) -> (i32, String, Vec<PatternEvent>) {
        let (start, mut events) = (Instant::now(), Vec::new());
        loop {
            let ended = driver.try_wait().unwrap().is_some();
            self.serve();
            while let Some(event) = self.events.receive().unwrap() {
                events.push(*event);
            }
            if ended {
                break;
            }
            if start.elapsed() > TIMEOUT {
                driver.kill().unwrap();
                panic!("the driver hangs after {} events", events.len());
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        let output = driver.wait_with_output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        (output.status.code().unwrap(), text, events)
    }
}

#[test]
fn it_starts_the_scan_announces_its_patterns_and_stops_the_scan() {
    let folder = tempfile::tempdir_in("/tmp").unwrap();
    let mut supervisor = Supervisor::new(folder.path());
    let arguments = "--steps 5 --period-px 24 --rate-hz 200 --patterns 43 --start --stop --record scan.mcap";
    let driver = supervisor.driver(&arguments.split(' ').collect::<Vec<_>>());
    let (code, text, events) = supervisor.serve_until_end(driver);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("43 patterns announced"), "{text}");
    let requests: Vec<_> = supervisor.requests.iter().map(|(command, text)| (*command, text.as_str())).collect();
    assert_eq!(requests, [(ScanCommand::RecordStart, "scan.mcap"), (ScanCommand::Start, ""), (ScanCommand::Stop, "")]);
    assert_eq!(events.len(), 43);
    for (k, event) in (0_u64..).zip(&events) {
        assert_eq!((event.sequence, event.session), (k, events[0].session));
        assert_eq!((u64::from(event.step), event.steps, event.kind), (k % 5, 5, PATTERN_FRINGES));
        assert_eq!((event.period_px, event.duration_ns, event.reserved), (24.0, 5_000_000, 0));
        let due_ns = events[0].exposure_start_ns + k * 5_000_000;
        assert!(event.exposure_start_ns.abs_diff(due_ns) <= 1, "event {k}");
    }
}

#[test]
fn without_channels_it_asks_to_start_the_instance() {
    let folder = tempfile::tempdir_in("/tmp").unwrap();
    let mut supervisor = Supervisor::new(folder.path());
    let nobody = Instance::in_folder(folder.path(), "nobody").unwrap();
    std::fs::create_dir(nobody.root()).unwrap();
    std::fs::write(&supervisor.config_file, nobody.external_config().unwrap()).unwrap();
    let driver = supervisor.driver(&[]);
    let (code, text, _) = supervisor.serve_until_end(driver);
    assert_eq!(code, 1, "{text}");
    assert!(text.contains("start the instance first"), "{text}");
}

#[test]
fn it_prints_why_a_request_was_refused() {
    let folder = tempfile::tempdir_in("/tmp").unwrap();
    let mut supervisor = Supervisor::new(folder.path());
    let driver = supervisor.driver(&["--mark", "edge"]);
    let (code, text, events) = supervisor.serve_until_end(driver);
    assert_eq!((code, events.len()), (1, 0), "{text}");
    assert!(text.contains("refused: nothing is recorded"), "{text}");
    assert_eq!(supervisor.requests, [(ScanCommand::Mark, "edge".to_owned())]);
}
