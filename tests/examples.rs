//! Every example does what its documentation says.

#![expect(clippy::unwrap_used, clippy::panic, reason = "an example that cannot be run fails the test")]

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use tempfile::TempDir;

use fringeflow::cloud::{CloudPoint, RECORD_BYTES, write_records};
use fringeflow_lab::simulation::{Board, NoiseLevel, Object, RigOptions, Simulation, SimulationOptions};
use fringeflow_message::CloudHeader;
use fringeflow_recording::{Recording, Topic};
use fringeflow_transport::{CLOUD, ChannelSizes, Instance, Node, Publisher};

/// The program of an example; `cargo test` builds it beside the tests.
fn example(name: &str) -> Command {
    let test = std::env::current_exe().unwrap();
    Command::new(test.ancestors().nth(2).unwrap().join("examples").join(name))
}

fn run(name: &str, arguments: &[&dyn AsRef<OsStr>]) -> Output {
    let output = example(name).args(arguments.iter().map(AsRef::as_ref)).output();
    output.unwrap_or_else(|e| panic!("example {name}: {e}; `cargo build -p fringeflow-examples --examples` builds it"))
}

fn printed(output: &Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// A dataset of a simulated plane, with the folder that holds it.
fn dataset() -> (TempDir, PathBuf) {
    let options = SimulationOptions {
        board: Board::None,
        rig: RigOptions { size_px: [96, 80], period_px: 64.0, ..RigOptions::usual(0.025) },
        steps: 4,
        gray: false,
        noise: NoiseLevel::Low,
        supersampling: 1,
        ..SimulationOptions::usual(Object::Plane)
    };
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("plane");
    Simulation::new(options).unwrap().write(&set, || ()).unwrap();
    (folder, set)
}

/// The number before a word in the output.
fn number_before(text: &str, word: &str) -> u64 {
    let before = &text[..text.find(word).unwrap_or_else(|| panic!("no {word:?} in {text}"))];
    before.split_whitespace().next_back().unwrap().parse().unwrap()
}

#[test]
fn reconstruct_dataset_writes_as_many_points_as_it_prints() {
    let (folder, set) = dataset();
    let cloud = folder.path().join("cloud.ply");
    let text = printed(&run("reconstruct_dataset", &[&set, &cloud]));
    let points = number_before(&text, "points in");
    assert!(points > 1000, "{text}");
    let ply = std::fs::read(cloud).unwrap();
    let header = String::from_utf8_lossy(&ply[..400]).into_owned();
    assert!(header.contains(&format!("element vertex {points}")), "{header}");
}

/// The text of a file of the repository.
fn text_of(file: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(file)).unwrap()
}

/// The block of a language in a section of the README.
fn readme_block(section: &str, language: &str) -> String {
    let readme = text_of("README.md");
    let section = readme.split_once(&format!("\n### {section}\n")).unwrap().1;
    section.split_once(&format!("\n```{language}\n")).unwrap().1.split_once("\n```").unwrap().0.to_owned()
}

#[test]
fn the_readme_quotes_an_example_that_runs() {
    let program = text_of("examples/reconstruct_dataset.rs");
    let quoted = program.split_once("next empty line.\n").unwrap().1.split_once("\n\n").unwrap().0;
    let quoted: Vec<&str> = quoted.lines().map(|line| line.trim_start()).collect();
    let readme = readme_block("Rust developer", "rust");
    assert_eq!(readme.lines().map(str::trim_start).collect::<Vec<_>>(), quoted);
}

#[test]
fn the_dependencies_in_the_readme_are_packages_of_this_repository() {
    let repository = text_of("Cargo.toml");
    let repository = repository.lines().find_map(|line| line.strip_prefix("repository = ")).unwrap().to_owned();
    let packages = ["Cargo.toml", "crates/dataset/Cargo.toml"].map(text_of);
    let block = readme_block("Rust developer", "toml");
    let dependencies: Vec<&str> = block.lines().skip(1).collect();
    assert_eq!(dependencies.len(), packages.len());
    for (dependency, package) in dependencies.into_iter().zip(packages) {
        let (name, source) = dependency.split_once(" = ").unwrap();
        assert!(package.contains(&format!("\nname = \"{name}\"\n")), "{name}");
        assert_eq!(source, format!("{{ git = {repository} }}"));
    }
}

#[test]
fn custom_stage_counts_every_correspondence() {
    let (folder, set) = dataset();
    let cloud = |limit: &str| {
        let target = folder.path().join(format!("{limit}.ply"));
        let text = printed(&run("custom_stage", &[&set, &target, &limit]));
        [" correspondences passed", " dropped", " points in"].map(|word| number_before(&text, word))
    };
    let [all, none_dropped, all_points] = cloud("0");
    assert!(all > 1000 && none_dropped == 0 && all_points <= all);
    let [passed, dropped, points] = cloud("0.9999");
    assert_eq!(passed + dropped, all);
    assert!(dropped > 0 && points <= passed);
}

#[test]
fn replay_recording_reproduces_every_cloud() {
    let recording = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/cycle.mcap");
    let text = printed(&run("replay_recording", &[&recording]));
    let clouds = Recording::open(&recording).unwrap().count(Topic::Cloud);
    assert!(clouds > 0 && text.contains(&format!("{clouds} of {clouds} clouds are the same to the byte")), "{text}");
}

#[test]
fn subscribe_clouds_receives_the_clouds_of_an_instance() {
    let folder = tempfile::Builder::new().prefix("ff").tempdir_in("/tmp").unwrap();
    let instance = Instance::in_folder(folder.path(), "examples").unwrap();
    let node = Node::open(&instance, "publisher").unwrap();
    let sizes = ChannelSizes { cloud_bytes: RECORD_BYTES, ..ChannelSizes::default() };
    let mut clouds = Publisher::open(&node, CLOUD, &sizes).unwrap();
    let point = CloudPoint { position_m: [0.0, 0.0, 0.25], ..CloudPoint::default() };
    let mut record = Vec::new();
    write_records(&mut record, &[point]).unwrap();

    let mut child = example("subscribe_clouds")
        .args(["examples", "3"])
        .env("FRINGEFLOW_RUNTIME_DIR", folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut published = 0;
    while child.try_wait().unwrap().is_none() {
        clouds.send(&CloudHeader { published, points: 1, ..CloudHeader::default() }, &record).unwrap();
        published += 1;
        std::thread::sleep(Duration::from_millis(50));
    }
    let text = printed(&child.wait_with_output().unwrap());
    assert!(text.contains("1 points, nearest 250.0 mm") && text.contains("3 clouds received, 0 lost"), "{text}");
}
