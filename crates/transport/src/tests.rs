//! Tests of ports between nodes and between processes. For a child process, the test binary starts itself.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use bytemuck::Zeroable;
use tempfile::TempDir;

use fringeflow_message::{
    Block, Command as ControlCommand, ControlRequest, ControlResponse, FrameHeader, MapsHeader, PatternEvent,
    ScanState, Text,
};

use super::*;

const TEST_TIMEOUT: Duration = Duration::from_secs(60);
const STEP: Duration = Duration::from_millis(20);

const SIZES: ChannelSizes = ChannelSizes {
    frame_bytes: 4096,
    window: 4,
    map_blocks: 8,
    correspondence_blocks: 8,
    cloud_bytes: 1000,
    model_points: 1,
    prior_bytes: 1,
};

/// An instance in a temporary folder.
struct TestInstance {
    folder: TempDir,
    instance: Instance,
}

impl Drop for TestInstance {
    fn drop(&mut self) {
        // iceoryx2 keeps files for the next node; in a running scanner, InstanceLock removes them.
        for file in shared_memory::files(self.instance.prefix()).unwrap_or_default() {
            let _ = fs::remove_file(file);
        }
    }
}

impl TestInstance {
    fn new() -> Self {
        let folder = tempfile::tempdir_in("/tmp").unwrap();
        let instance = Instance::in_folder(folder.path(), "test").unwrap();
        Self { folder, instance }
    }

    fn node(&self) -> Node {
        Node::open(&self.instance, "test").unwrap()
    }

    /// Both ports of the channel of camera 1, on one node.
    fn cam1_ports(&self) -> (Publisher<FrameHeader, [u8]>, Subscriber<FrameHeader, [u8]>) {
        let node = self.node();
        let subscriber = Subscriber::open(&node, CAM1_FRAME, &SIZES).unwrap();
        (Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap(), subscriber)
    }
}

fn frame(number: u64) -> FrameHeader {
    FrameHeader { published: number, width_px: 64, height_px: 64, ..FrameHeader::default() }
}

fn receive_numbers<P: Payload + ?Sized>(subscriber: &mut Subscriber<FrameHeader, P>) -> Vec<u64> {
    std::iter::from_fn(|| subscriber.receive().unwrap()).map(|message| message.header().published).collect()
}

#[test]
fn header_and_payload_arrive_as_sent() {
    let test = TestInstance::new();
    let (here, there) = (test.node(), test.node());
    let mut frames_out = Publisher::open(&here, CAM1_FRAME, &SIZES).unwrap();
    let mut maps_out = Publisher::open(&here, PHASE_MAPS, &SIZES).unwrap();
    let mut patterns_out = Publisher::open(&here, PROJECTOR_PATTERN, &SIZES).unwrap();
    let mut frames = Subscriber::open(&there, CAM1_FRAME, &SIZES).unwrap();
    let mut maps = Subscriber::open(&there, PHASE_MAPS, &SIZES).unwrap();
    let mut patterns = Subscriber::open(&there, PROJECTOR_PATTERN, &SIZES).unwrap();

    let image: Vec<u8> = (0..4096).map(|i| (i % 251) as u8).collect();
    frames_out.send(&frame(7), &image).unwrap();
    maps_out
        .send_filled(&MapsHeader { published: 8, ..MapsHeader::default() }, 3, |blocks| {
            blocks.fill(Block::zeroed());
            blocks[1].0[5] = 9;
        })
        .unwrap();
    patterns_out.send_message(&PatternEvent { sequence: 10, ..PatternEvent::default() }).unwrap();

    let received = frames.receive().unwrap().unwrap();
    assert_eq!((received.header(), received.payload()), (&frame(7), &image[..]));
    let mut blocks = [Block::zeroed(); 3];
    blocks[1].0[5] = 9;
    let received = maps.receive().unwrap().unwrap();
    assert_eq!((received.header().published, received.payload()), (8, &blocks[..]));
    assert_eq!(patterns.receive().unwrap().unwrap().sequence, 10);
    assert!(patterns.receive().unwrap().is_none());
}

#[test]
fn a_full_buffer_drops_its_oldest_message() {
    let test = TestInstance::new();
    let (mut publisher, mut subscriber) = test.cam1_ports();
    (0..100).for_each(|number| publisher.send(&frame(number), &[0; 16]).unwrap());
    assert_eq!(receive_numbers(&mut subscriber), (84..100).collect::<Vec<_>>());
}

#[test]
fn three_windows_and_four_can_be_held_and_do_not_change() {
    let test = TestInstance::new();
    let (mut publisher, mut subscriber) = test.cam1_ports();
    let mut held = Vec::new();
    for number in 0..16 {
        publisher.send(&frame(number), &[number as u8; 4096]).unwrap();
        held.push(subscriber.receive().unwrap().unwrap());
    }
    for number in 16..200 {
        publisher.send(&frame(number), &[number as u8; 4096]).unwrap();
    }
    for (number, message) in held.iter().enumerate() {
        assert_eq!(message.header().published, number as u64);
        assert!(message.payload().iter().all(|&byte| usize::from(byte) == number), "message {number} changed");
    }
    assert!(subscriber.receive().is_err(), "more than three windows and four can be held");
    held.pop();
    assert_eq!(subscriber.receive().unwrap().unwrap().header().published, 184);
}

#[test]
fn a_new_subscriber_receives_the_state() {
    let test = TestInstance::new();
    let node = test.node();
    let mut publisher = Publisher::open(&node, SCAN_STATE, &SIZES).unwrap();
    publisher.send_message(&ScanState { revision: 1, ..ScanState::default() }).unwrap();
    publisher.send_message(&ScanState { revision: 2, ..ScanState::default() }).unwrap();
    let mut subscriber = Subscriber::open(&node, SCAN_STATE, &SIZES).unwrap();
    // The publisher sends its history when it next checks its subscribers.
    publisher.ensure_connected().unwrap();
    assert_eq!(subscriber.receive().unwrap().unwrap().revision, 2);
    assert!(subscriber.receive().unwrap().is_none());
}

#[test]
fn a_payload_that_does_not_fit_is_refused_and_the_next_one_passes() {
    let test = TestInstance::new();
    let (mut publisher, mut subscriber) = test.cam1_ports();
    let error = publisher.send(&frame(0), &[0; 4097]).unwrap_err();
    assert!(matches!(error, TransportError::TooLong { len: 4097, limit: 4096, .. }), "{error}");
    publisher.send(&frame(1), &[0; 4096]).unwrap();
    assert_eq!(receive_numbers(&mut subscriber), [1]);
}

#[test]
fn a_second_publisher_is_refused_while_the_first_lives() {
    let test = TestInstance::new();
    let node = test.node();
    let first = Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let error = Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap_err();
    let expected = "channel cam1/frame of instance test already has the maximum of 1 publisher(s); stop one of them";
    assert_eq!(error.to_string(), expected);
    drop(first);
    Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap();
}

#[test]
fn waiting_ends_with_a_message_of_any_port() {
    let test = TestInstance::new();
    let node = test.node();
    let mut first = Subscriber::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let mut second = Subscriber::open(&node, CAM2_FRAME, &SIZES).unwrap();
    let mut publisher = Publisher::open(&node, CAM2_FRAME, &SIZES).unwrap();
    let sender = std::thread::spawn(move || {
        std::thread::sleep(STEP);
        publisher.send(&frame(3), &[1]).unwrap();
        publisher
    });
    let start = Instant::now();
    let received = loop {
        wait_for(&[&first, &second], TEST_TIMEOUT).unwrap();
        assert!(first.receive().unwrap().is_none());
        let received = receive_numbers(&mut second);
        if !received.is_empty() {
            break received;
        }
    };
    assert_eq!(received, [3]);
    assert!(start.elapsed() < TEST_TIMEOUT, "the message did not end the wait");
    sender.join().unwrap();
}

#[test]
fn a_request_is_answered_and_without_a_server_refused() {
    let test = TestInstance::new();
    let ask =
        ControlRequest { command: ControlCommand::Mark as u32, text: Text::new("here"), ..ControlRequest::default() };
    let absent = request(&test.instance, &ask, TEST_TIMEOUT).unwrap_err();
    assert_eq!(absent.to_string(), "no instance test is running here");

    let node = test.node();
    let mut server = ControlServer::open(&node).unwrap();
    let instance = test.instance.clone();
    let client = std::thread::spawn(move || request(&instance, &ask, TEST_TIMEOUT).unwrap());
    let echo = |request: &ControlRequest| ControlResponse { refused: 1, text: request.text, ..Default::default() };
    while server.answer(echo).unwrap() == 0 {
        wait_for(&[&server], TEST_TIMEOUT).unwrap();
    }
    let response = client.join().unwrap();
    assert_eq!((response.refused, response.text.to_text().as_str()), (1, "here"));

    let silent = request(&test.instance, &ask, STEP).unwrap_err();
    assert!(matches!(silent, TransportError::NoAnswer { .. }), "{silent}");
    drop(server);
    drop(node);
    let gone = request(&test.instance, &ask, TEST_TIMEOUT).unwrap_err();
    assert!(matches!(gone, TransportError::NotRunning { .. }), "{gone}");
}

#[test]
fn messages_flow_again_after_the_files_of_the_instance_were_removed() {
    let test = TestInstance::new();
    let (here, there) = (test.node(), test.node());
    let mut channels = KeptChannels::open(&here, &SIZES).unwrap();
    let mut publisher = Publisher::open(&here, CAM1_FRAME, &SIZES).unwrap();
    let mut server = ControlServer::open(&here).unwrap();
    let mut subscriber = Subscriber::open(&there, CAM1_FRAME, &SIZES).unwrap();
    publisher.send(&frame(1), &[1; 4096]).unwrap();
    let held = subscriber.receive().unwrap().unwrap();

    fs::remove_dir_all(test.instance.root()).unwrap();
    assert!(publisher.ensure_connected().unwrap());
    assert!(channels.ensure_connected().unwrap());
    assert!(server.ensure_connected().unwrap());
    assert!(subscriber.ensure_connected(0).unwrap());
    for number in 2..40 {
        publisher.send(&frame(number), &[number as u8; 4096]).unwrap();
    }
    assert_eq!(receive_numbers(&mut subscriber), (24..40).collect::<Vec<_>>());
    assert_eq!(held.header().published, 1);
    assert_eq!(held.payload(), [1; 4096]);

    let again = (publisher.ensure_connected(), channels.ensure_connected(), subscriber.ensure_connected(0));
    assert!(matches!(again, (Ok(false), Ok(false), Ok(false))), "{again:?}");
    assert_eq!(test.instance.participants().unwrap(), [Participant { name: "test".into(), pid: std::process::id() }]);
}

#[test]
fn ports_find_each_other_when_only_the_description_of_the_channel_was_removed() {
    let test = TestInstance::new();
    let (mut publisher, mut subscriber) = test.cam1_ports();
    fs::remove_dir_all(test.instance.root().join("services")).unwrap();
    assert!(subscriber.ensure_connected(0).unwrap());
    assert!(publisher.ensure_connected().unwrap());
    publisher.send(&frame(1), &[1]).unwrap();
    assert_eq!(receive_numbers(&mut subscriber), [1]);
}

#[test]
fn messages_flow_again_after_shared_memory_was_removed() {
    let test = TestInstance::new();
    let node = test.node();
    let mut channels = KeptChannels::open(&node, &SIZES).unwrap();
    let mut publisher = Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let mut subscriber = Subscriber::open(&node, CAM1_FRAME, &SIZES).unwrap();
    publisher.send(&frame(1), &[1; 4096]).unwrap();
    let held = subscriber.receive().unwrap().unwrap();
    for file in shared_memory::files(test.instance.prefix()).unwrap() {
        fs::remove_file(file).unwrap();
    }
    let start = Instant::now();
    let mut number = 2;
    // The services loop in the same way. A port may need several rounds, until the last user of the old channel has
    // closed it.
    while receive_numbers(&mut subscriber).is_empty() {
        assert!(start.elapsed() < TEST_TIMEOUT);
        let _ = (publisher.ensure_connected(), channels.ensure_connected(), subscriber.ensure_connected(0));
        let _ = publisher.send(&frame(number), &[number as u8; 4096]);
        number += 1;
    }
    assert_eq!(held.payload(), [1; 4096]);
}

#[test]
fn a_stopped_subscriber_does_not_hold_up_the_publisher() {
    use rustix::process::{Pid, Signal, kill_process};
    let test = TestInstance::new();
    let node = test.node();
    let mut publisher = Publisher::open(&node, CAM2_FRAME, &SIZES).unwrap();
    let mut child = ChildProcess::start(&test);
    let pid = Pid::from_child(&child.process);
    kill_process(pid, Signal::STOP).unwrap();
    for number in 0..20_000 {
        publisher.send(&frame(number), &[0; 64]).unwrap();
    }
    kill_process(pid, Signal::CONT).unwrap();
    let last: Vec<_> = (19_984..20_000).collect();
    assert_eq!(child.send(1).trim(), format!("received {last:?}"));
    child.kill();
}

#[test]
fn the_longest_path_has_room_for_sockets() {
    let test = TestInstance::new();
    let limit = 107 - 1 - 11 - 39 - ".event".len();
    let folder = test.folder.path().join("folder");
    let used = folder.as_os_str().len() + 1;
    let instance = Instance::in_folder(&folder, &"n".repeat(limit - used)).unwrap();
    let _lock = InstanceLock::take(&instance).unwrap();
    let node = Node::open(&instance, "test").unwrap();
    let mut subscriber = Subscriber::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let mut publisher = Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap();
    publisher.send(&frame(1), &[1]).unwrap();
    wait_for(&[&subscriber], TEST_TIMEOUT).unwrap();
    assert_eq!(receive_numbers(&mut subscriber), [1]);
}

#[test]
fn other_programs_are_given_the_folder_and_the_prefix() {
    let test = TestInstance::new();
    let config: toml::Table = toml::from_str(&test.instance.external_config().unwrap()).unwrap();
    let global = config["global"].as_table().unwrap();
    assert_eq!(global["root-path"].as_str(), test.instance.root().to_str());
    assert_eq!(global["prefix"].as_str(), Some(test.instance.prefix()));
}

#[test]
fn a_silent_subscriber_opens_again_but_keeps_held_messages() {
    let test = TestInstance::new();
    let (mut publisher, mut subscriber) = test.cam1_ports();
    publisher.send(&frame(1), &[1; 4096]).unwrap();
    let held = subscriber.receive().unwrap().unwrap();
    let second_ns = 1_000_000_000;
    assert!(!subscriber.ensure_connected(second_ns).unwrap());
    assert!(!subscriber.ensure_connected(5 * second_ns).unwrap(), "a message is held");
    drop(held);
    assert!(subscriber.ensure_connected(20 * second_ns).unwrap());
    publisher.send(&frame(2), &[2; 4096]).unwrap();
    assert_eq!(receive_numbers(&mut subscriber), [2]);
}

#[test]
fn waiting_messages_are_no_silence() {
    let test = TestInstance::new();
    let (mut publisher, mut subscriber) = test.cam1_ports();
    assert!(!subscriber.ensure_connected(0).unwrap());
    publisher.send(&frame(1), &[1]).unwrap();
    assert!(!subscriber.ensure_connected(3_600_000_000_000).unwrap());
    assert_eq!(receive_numbers(&mut subscriber), [1]);
}

#[test]
fn the_lock_is_exclusive_and_leaves_nothing_behind() {
    let test = TestInstance::new();
    let lock = InstanceLock::take(&test.instance).unwrap();
    let refused = InstanceLock::take(&test.instance).unwrap_err().to_string();
    let pid = std::process::id();
    assert_eq!(refused, format!("instance test is already running (pid {pid}); stop it or choose another name"));

    let started = || Instance::list_started_in(test.folder.path()).unwrap();
    assert!(started().iter().map(|started| &started.instance).eq([&test.instance]));
    let node = test.node();
    let publisher = Publisher::open(&node, CLOUD, &SIZES).unwrap();
    let subscriber = Subscriber::open(&node, CLOUD, &SIZES).unwrap();
    assert!(!shared_memory::files(test.instance.prefix()).unwrap().is_empty());
    drop((publisher, subscriber, node));
    drop(lock);
    assert_eq!(shared_memory::files(test.instance.prefix()).unwrap(), Vec::<std::path::PathBuf>::new());
    assert_eq!(fs::read_dir(test.folder.path()).unwrap().count(), 0);
    assert_eq!(started(), []);
    InstanceLock::take(&test.instance).unwrap();
}

#[test]
fn a_lock_does_not_remove_files_that_a_driver_uses() {
    let test = TestInstance::new();
    let lock = InstanceLock::take(&test.instance).unwrap();
    let node = test.node();
    let mut subscriber = Subscriber::open(&node, CAM1_FRAME, &SIZES).unwrap();
    drop(lock);
    let _lock = InstanceLock::take(&test.instance).unwrap();
    let mut publisher = Publisher::open(&test.node(), CAM1_FRAME, &SIZES).unwrap();
    publisher.send(&frame(1), &[1]).unwrap();
    assert_eq!(receive_numbers(&mut subscriber), [1]);
}

#[test]
fn names_that_cannot_be_folders_and_sockets_are_refused() {
    for name in ["", "a/b", "..", "a b", "ä", &"a".repeat(33)] {
        assert!(matches!(Instance::new(name), Err(TransportError::Name { .. })), "{name:?}");
    }
    let long = Path::new("/tmp").join("x".repeat(60));
    assert!(matches!(Instance::in_folder(&long, "a"), Err(TransportError::PathTooLong { bytes: 67, .. })));
}

#[test]
fn folders_of_others_are_refused() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let test = TestInstance::new();
    fs::create_dir(test.instance.root()).unwrap();
    fs::set_permissions(test.instance.root(), fs::Permissions::from_mode(0o775)).unwrap();
    let open = Node::open(&test.instance, "test").unwrap_err().to_string();
    assert!(open.contains("is writable by others (mode 0775); remove it"), "{open}");

    fs::remove_dir(test.instance.root()).unwrap();
    symlink("/tmp", test.instance.root()).unwrap();
    let link = Node::open(&test.instance, "test").unwrap_err().to_string();
    assert!(link.contains("is not a folder"), "{link}");
}

#[test]
fn a_folder_of_ours_becomes_private() {
    use std::os::unix::fs::PermissionsExt;
    let test = TestInstance::new();
    fs::create_dir(test.instance.root()).unwrap();
    // As iceoryx2 creates it for a tool that attaches while a supervisor cleans up.
    fs::set_permissions(test.instance.root(), fs::Permissions::from_mode(0o750)).unwrap();
    let _lock = InstanceLock::take(&test.instance).unwrap();
    assert_eq!(fs::metadata(test.instance.root()).unwrap().permissions().mode() & 0o777, 0o700);
}

#[test]
fn instances_of_one_name_in_two_folders_do_not_exchange_messages() {
    let (one, other) = (TestInstance::new(), TestInstance::new());
    let mut publisher = Publisher::open(&one.node(), CAM1_FRAME, &SIZES).unwrap();
    let mut subscriber = Subscriber::open(&other.node(), CAM1_FRAME, &SIZES).unwrap();
    publisher.send(&frame(1), &[1]).unwrap();
    assert!(subscriber.receive().unwrap().is_none());
    assert_ne!(one.instance.prefix(), other.instance.prefix());
}

#[test]
fn the_required_bytes_are_allocated() {
    let test = TestInstance::new();
    let sizes = ChannelSizes {
        frame_bytes: 327_680,
        window: 4,
        map_blocks: 81_920,
        correspondence_blocks: 174_080,
        cloud_bytes: 12_124_160,
        model_points: 50_000,
        prior_bytes: 2560,
    };
    let node = test.node();
    let ports = (
        Publisher::open(&node, CAM1_FRAME, &sizes).unwrap(),
        Publisher::open(&node, CAM2_FRAME, &sizes).unwrap(),
        Publisher::open(&node, PROJECTOR_PATTERN, &sizes).unwrap(),
        Publisher::open(&node, SCAN_STATE, &sizes).unwrap(),
    );
    let _subscribers = [0; 4].map(|_| Subscriber::open(&node, CAM1_FRAME, &sizes).unwrap());
    let files = shared_memory::files(test.instance.prefix()).unwrap();
    let allocated: u64 =
        files.iter().map(|file| std::os::unix::fs::MetadataExt::blocks(&fs::metadata(file).unwrap())).sum();
    let ids = [ChannelId::Cam1Frame, ChannelId::Cam2Frame, ChannelId::ProjectorPattern, ChannelId::ScanState];
    let required: u64 = ids.iter().map(|id| shared_memory::publisher_bytes(&id.limits(&sizes))).sum();
    let ratio = (512 * allocated) as f64 / required as f64;
    assert!((0.98..1.0).contains(&ratio), "allocated {} of {required} bytes", 512 * allocated);
    drop(ports);
}

/// Writes a line for the parent process.
fn print_line(line: &str) {
    writeln!(std::io::stdout(), "{line}").unwrap();
}

/// Main function of the child process; the tests start it with the folder of their instance.
#[test]
#[ignore = "the child process of other tests"]
fn child() {
    let Some(folder) = std::env::var_os("FRINGEFLOW_TEST_CHILD") else { return };
    let node = Node::open(&Instance::in_folder(Path::new(&folder), "test").unwrap(), "child").unwrap();
    let mut publisher = Publisher::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let mut subscriber = Subscriber::open(&node, CAM2_FRAME, &SIZES).unwrap();
    print_line("open");
    for line in std::io::stdin().lines() {
        let number = line.unwrap().parse().unwrap();
        publisher.ensure_connected().unwrap();
        subscriber.ensure_connected(0).unwrap();
        publisher.send(&frame(number), &[number as u8; 4096]).unwrap();
        print_line(&format!("received {:?}", receive_numbers(&mut subscriber)));
    }
}

struct ChildProcess {
    process: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
}

impl ChildProcess {
    fn start(test: &TestInstance) -> Self {
        let mut process = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "tests::child", "--ignored", "--nocapture"])
            .env("FRINGEFLOW_TEST_CHILD", test.folder.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let (to, from) = (process.stdin.take().unwrap(), BufReader::new(process.stdout.take().unwrap()));
        let mut child = Self { process, to, from };
        child.line_with("open");
        child
    }

    /// Reads lines until one contains `text`: the test harness prints lines as well.
    fn line_with(&mut self, text: &str) -> String {
        loop {
            let mut line = String::new();
            assert!(self.from.read_line(&mut line).unwrap() > 0, "the child ended before it wrote {text:?}");
            if line.contains(text) {
                return line;
            }
        }
    }

    fn send(&mut self, number: u64) -> String {
        writeln!(self.to, "{number}").unwrap();
        self.line_with("received")
    }

    fn kill(mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

/// Removes the resources of a dead process. Repeats, because other tests clean up in this process too, one at a time.
fn clean(instance: &Instance, ports: usize) {
    let start = Instant::now();
    let mut cleaned = 0;
    while cleaned < ports {
        cleaned += instance.clean_dead().unwrap();
        assert!(start.elapsed() < TEST_TIMEOUT, "cleaned {cleaned} of {ports}");
        std::thread::sleep(STEP);
    }
    assert_eq!(cleaned, ports);
}

#[test]
fn killed_processes_are_replaced_and_leave_nothing() {
    let test = TestInstance::new();
    let lock = InstanceLock::take(&test.instance).unwrap();
    let node = test.node();
    let mut subscriber = Subscriber::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let mut publisher = Publisher::open(&node, CAM2_FRAME, &SIZES).unwrap();
    let kills: u64 = std::env::var("FRINGEFLOW_TEST_KILLS").map_or(5, |kills| kills.parse().unwrap());
    let mut left = Vec::new();
    for round in 0..kills {
        let mut child = ChildProcess::start(&test);
        publisher.send(&frame(round), &[0; 4096]).unwrap();
        assert_eq!(child.send(round).trim(), format!("received [{round}]"));
        let received = subscriber.receive().unwrap().unwrap();
        assert_eq!(received.header().published, round);
        child.kill();
        assert_eq!(received.payload(), [round as u8; 4096], "a message of a dead process stays");
        drop(received);
        clean(&test.instance, 2);
        left.push(shared_memory::files(test.instance.prefix()).unwrap().len());
    }
    assert_eq!(left.first(), left.last(), "shared memory grows: {left:?}");
    assert_eq!(test.instance.participants().unwrap().len(), 1);
    drop((subscriber, publisher, lock));
    assert_eq!(shared_memory::files(test.instance.prefix()).unwrap().len(), 0);
}

#[test]
fn two_processes_find_each_other_after_the_files_of_the_instance_were_removed() {
    let test = TestInstance::new();
    let node = test.node();
    let mut subscriber = Subscriber::open(&node, CAM1_FRAME, &SIZES).unwrap();
    let mut publisher = Publisher::open(&node, CAM2_FRAME, &SIZES).unwrap();
    let mut child = ChildProcess::start(&test);
    for round in 0..3 {
        fs::remove_dir_all(test.instance.root()).unwrap();
        let (start, mut received) = (Instant::now(), false);
        while !received || receive_numbers(&mut subscriber).is_empty() {
            assert!(start.elapsed() < TEST_TIMEOUT, "round {round}: the child received: {received}");
            subscriber.ensure_connected(0).unwrap();
            publisher.ensure_connected().unwrap();
            publisher.send(&frame(7), &[7]).unwrap();
            received |= child.send(1).contains('7');
        }
    }
    child.kill();
}

#[test]
fn a_killed_publisher_is_replaced_without_waiting_for_the_supervisor() {
    let test = TestInstance::new();
    let mut subscriber = Subscriber::open(&test.node(), CAM1_FRAME, &SIZES).unwrap();
    for round in 0..2 {
        let mut child = ChildProcess::start(&test);
        child.send(round);
        assert_eq!(receive_numbers(&mut subscriber), [round]);
        child.kill();
    }
}
