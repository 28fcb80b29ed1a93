//! Settings: listed, set and read back by `fringeflow`, and refused with what the camera takes instead.

use crate::support::Bench;

#[test]
#[ignore = "runs in the virtual machine"]
fn cameras_are_listed_with_all_that_they_take() {
    let _vivid = super::load();
    let bench = Bench::of(&super::scanner(""));
    let listed = bench.json(&[0], &[&"cameras", &"--json", &super::DEVICE]);
    let camera = if listed.is_array() { &listed[0] } else { &listed };
    let text = camera.to_string();
    assert!(camera["driver"] == "vivid" && camera["bus_info"] == "platform:vivid-000", "{text}");
    let brightness = camera["controls"].as_array().unwrap().iter().find(|control| control["name"] == "brightness");
    let brightness = brightness.unwrap_or_else(|| panic!("no brightness in {text}"));
    assert_eq!([&brightness["minimum"], &brightness["maximum"], &brightness["value"]], [0, 255, 128], "{brightness}");
    for format in ["GREY", "Y10", "Y12", "Y16", "YUYV", "NV12"] {
        assert!(text.contains(&format!("\"{format}\"")), "{format} is not in {text}");
    }
}

#[test]
#[ignore = "runs in the virtual machine"]
fn settings_are_read_back() {
    let _vivid = super::load();
    let bench = Bench::of(&super::scanner("brightness = 100\nhorizontal_flip = true\ntest_pattern = \"100% White\""));
    let report = bench.done(&[0], &[&"run", &"--config", &bench.configuration(), &"--check"]);
    for part in ["camera 1", "camera 2", "brightness 100", "horizontal_flip", "100% White", "50"] {
        assert!(report.contains(part), "{part:?} is missing in: {report}");
    }
}

#[test]
#[ignore = "runs in the virtual machine"]
fn what_a_camera_does_not_take_is_refused_with_what_it_does() {
    let _vivid = super::load();
    for (setting, says) in [
        ("brightness = 999", ["brightness", "999", "0", "255"]),
        ("brightnes = 1", ["brightnes", "brightness", "camera 1", "vivid"]),
        ("test_pattern = \"Stripes\"", ["test_pattern", "Stripes", "100% White", "camera 1"]),
    ] {
        let bench = Bench::of(&super::scanner(setting));
        let report = bench.done(&[2], &[&"run", &"--config", &bench.configuration(), &"--check"]);
        let wrong = report.lines().find(|line| line.starts_with("WRONG")).unwrap_or_default();
        for part in &says[..3] {
            assert!(wrong.contains(part), "{part:?} is missing in: {wrong}");
        }
        bench.refused(&[&"run", &"--config", &bench.configuration()], &says[..3]);
        bench.assert_nothing_left();
    }
}
