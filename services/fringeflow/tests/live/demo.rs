//! `fringeflow demo`: it needs nothing, and follows the configuration that it leaves.

use crate::support::{Bench, Ended};

#[test]
fn the_demo_follows_the_configuration_in_its_folder() {
    let bench = Bench::new();
    let folder = bench.path("demo");
    let nowhere = bench.path("nowhere/report.html");
    bench.refused_with(1, &[&"demo", &"--output", &folder, &"--report", &nowhere], &["report.html"]);
    // As it is, the demo renders for long.
    let file = folder.join("demo.toml");
    let changes = [
        ("size_px = [640, 512]", "size_px = [96, 80]"),
        ("period_px = 16.0", "period_px = 48.0"),
        ("poses = 240", "poses = 8"),
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
    let ended = Ended::new(demo.status.code(), &summary, log);
    ended.assert_balanced();
    assert!(ended.stage("camera1").taken > 0, "{ended:?}");
    assert!(folder.join("demo.images").exists());
    let report = ended.summary["report"].as_str().unwrap();
    assert_eq!(std::path::Path::new(report).parent().unwrap().canonicalize().unwrap(), folder);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), text);
    bench.assert_nothing_left();
}
