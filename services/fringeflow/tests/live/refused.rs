//! `run` refuses to start: it says why, and leaves nothing behind.

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};

use crate::support::Bench;

#[test]
fn run_refuses_the_name_of_a_running_instance() {
    let bench = Bench::new();
    let live = bench.start(&[]);
    let pid = format!("(pid {})", live.pid());
    bench.assert_refused(&[&"run", &"--config", &bench.configuration()], &["instance t is already running", &pid]);
    live.wait_for_clouds(5);
    live.quit().assert_undisturbed();
    bench.assert_nothing_left();
}

#[test]
fn run_refuses_runtime_folders_that_others_could_tamper_with() {
    let run = |bench: &Bench, says: &[&str]| bench.assert_refused(&[&"run", &"--config", &bench.configuration()], says);
    let bench = Bench::new();
    fs::create_dir(bench.path("elsewhere")).unwrap();
    symlink(bench.path("elsewhere"), bench.runtime_dir()).unwrap();
    run(&bench, &["/r is not a folder", "FRINGEFLOW_RUNTIME_DIR"]);
    fs::remove_file(bench.runtime_dir()).unwrap();
    fs::create_dir(bench.runtime_dir()).unwrap();
    fs::set_permissions(bench.runtime_dir(), fs::Permissions::from_mode(0o777)).unwrap();
    run(&bench, &["/r is writable by others (mode 0777)"]);
    fs::set_permissions(bench.runtime_dir(), fs::Permissions::from_mode(0o700)).unwrap();
    symlink(bench.path("elsewhere"), bench.runtime_dir().join("t")).unwrap();
    run(&bench, &["/r/t is not a folder"]);
    assert_eq!(fs::read_dir(bench.path("elsewhere")).unwrap().count(), 0);
    fs::remove_file(bench.runtime_dir().join("t")).unwrap();
    bench.assert_nothing_left();
}

#[test]
fn run_refuses_invalid_configurations_and_names_the_key() {
    for (from, to, says) in [
        ("rate_hz = 25.0", "rate_hz = 0.0", "cameras.rate_hz is 0"),
        ("rate_hz = 25.0", "rate = 25.0", "unknown field `rate`"),
        ("steps = 4", "steps = 2", "pattern.steps is 2"),
        ("period_px = 48.0", "period_px = nan", "pattern.period_px is NaN"),
        ("driver = \"virtual\"", "driver = \"real\"", "projector.driver is \"real\""),
        ("object = \"plane\"", "object = \"plain\"", "virtual_scanner.object"),
        ("size_px = [96, 80]", "size_px = [0, 80]", "image size is 0 px"),
        ("poses = 8", "poses = 10", "the sweep has 10 poses"),
        ("lost = 0.0", "lost = 1.5", "virtual_scanner.faults: the share of lost images is 1.5; "),
        ("when_busy = \"skip\"", "when_busy = \"sleep\"", "window.when_busy is \"sleep\""),
        ("name = \"t\"", "name = \"t", "TOML"),
        (
            "[window]",
            "[processors.phase]\ncpus = []\n[window]",
            "in [processors.phase]: key cpus is []; it must list at least",
        ),
        (
            "[window]",
            "[processors.phase]\ncpus = [0, 1023]\n[window]",
            "in [processors.phase]: key cpus is [0, 1023], but this process may use CPUs",
        ),
    ] {
        let bench = Bench::with_changes(&[(from, to)]);
        bench.assert_refused(&[&"run", &"--config", &bench.configuration()], &["scanner.toml", says]);
        bench.assert_nothing_left();
    }
    let bench = Bench::with_changes(&[("name = \"t\"", "name = \"../t\"")]);
    bench.assert_refused(&[&"run", &"--config", &bench.configuration()], &["instance name \"../t\"", "letters"]);
    bench.assert_nothing_left();
}

#[test]
fn run_refuses_missing_input_files_and_existing_output_files() {
    let bench = Bench::new();
    bench.assert_refused(&[&"run", &"--config", &bench.path("other.toml")], &["other.toml", "cannot be read"]);
    bench.assert_refused(&[&"run", &"--config", &bench.configuration(), &"--seconds", &"0"], &["--seconds 0"]);
    let taken = bench.path("taken.mcap");
    fs::write(&taken, "mine").unwrap();
    let run: [&dyn AsRef<std::ffi::OsStr>; 5] = [&"run", &"--config", &bench.configuration(), &"--record", &taken];
    bench.assert_refused(&run, &["taken.mcap", "already exists"]);
    assert_eq!(fs::read(&taken).unwrap(), b"mine");
    bench.assert_nothing_left();

    let external = [("source = \"virtual\"", "source = \"external\"")];
    let bench = Bench::with_changes(&external);
    bench.assert_refused(&[&"run", &"--config", &bench.configuration()], &["scanner.toml", "has no rig", "[rig]"]);
    let rig = ("[cameras]\n", "[rig]\ncalibration = \"rigs/mine.yml\"\nunit = \"mm\"\n[cameras]\n");
    let volume = "[measurement_volume]\nunit = \"mm\"\nbox = { R_v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], T_v = [0, 0, 300], min = [0, 0, 0], max = [9, 9, 9] }\n[cameras]\n";
    let bench = Bench::with_changes(&[external[0], rig]);
    bench.assert_refused(&[&"run", &"--config", &bench.configuration()], &["scanner.toml", "[measurement_volume]"]);
    let bench = Bench::with_changes(&[external[0], rig, ("[cameras]\n", volume)]);
    bench.assert_refused(&[&"run", &"--config", &bench.configuration()], &["rigs/mine.yml"]);
    bench.assert_nothing_left();
}
