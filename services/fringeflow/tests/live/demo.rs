//! `fringeflow demo`: it needs no input, and uses the configuration that an earlier demo wrote to its folder.

use crate::support::{Bench, FinishedRun};

#[test]
fn the_demo_uses_the_configuration_in_its_folder() {
    let bench = Bench::new();
    let folder = bench.path("demo");
    let nowhere = bench.path("nowhere/report.html");
    bench.assert_refused_with(1, &[&"demo", &"--output", &folder, &"--report", &nowhere], &["report.html"]);
    // With its own configuration the demo would render for a long time.
    let file = folder.join("demo.toml");
    let changes = [
        ("size_px = [640, 512]", "size_px = [96, 80]"),
        ("period_px = 16.0", "period_px = 48.0"),
        ("poses = 192", "poses = 8"),
        ("min_free_mb = 1024", "min_free_mb = 0"),
        ("name = \"demo\"", "name = \"t\""),
        ("enabled = true", "enabled = false"),
    ];
    let text = changes.iter().fold(std::fs::read_to_string(&file).unwrap(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    std::fs::write(&file, &text).unwrap();
    let demo = bench.command(&[&"demo", &"--output", &folder, &"--seconds", &"2", &"--json"]).output().unwrap();
    let [summary, log] = [demo.stdout, demo.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    let run = FinishedRun::new(demo.status.code(), &summary, log);
    run.assert_balanced();
    assert!(run.stage("camera1").taken > 0, "{run:?}");
    assert!(folder.join("demo.images").exists());
    let report = run.summary["report"].as_str().unwrap();
    assert_eq!(std::path::Path::new(report).parent().unwrap().canonicalize().unwrap(), folder);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), text);
    bench.assert_nothing_left();
}
