//! Settings: controls and rates are read back and reported. Unsupported settings are refused, with the supported ones.

use crate::guest::capture::Capture;
use crate::guest::driver::v4l2_ctl;
use crate::guest::vivid;
use crate::support::Bench;

/// What vivid declares, set as in [`vivid::scanner`].
const STAMPS: &str = "time stamps of the start of the exposure, as the driver declares";

#[test]
#[ignore = "runs in the virtual machine"]
fn controls_are_set_before_the_first_image() {
    let _vivid = vivid::load();
    let bench =
        Bench::from_configuration(&vivid::scanner("brightness = 77\nhorizontal_flip = true\nmenu = \"Menu Item 4\""));
    let checked = bench.json(&[0], &[&"run", &"--config", &bench.configuration(), &"--check", &"--json"]);
    let camera = checked["points"].as_array().unwrap().iter().find(|point| point["what"] == "camera 1").unwrap();
    for part in
        ["/dev/video0", "320x180 GREY", "50 images a second", "brightness = 77", "menu = 4 (Menu Item 4)", STAMPS]
    {
        assert!(camera["found"].as_str().unwrap().contains(part), "{part:?} is missing in {camera}");
    }
    // The test picture of the driver has no fringes.
    let images = checked["points"].as_array().unwrap().iter().find(|point| point["what"] == "images").unwrap();
    assert!(images["found"].as_str().unwrap().starts_with("warning: "), "{images}");
    v4l2_ctl(vivid::DEVICE, &["--set-ctrl", "brightness=1,horizontal_flip=0,menu=1"]);
    let mut capture = Capture::start(&bench);
    capture.wait_for_images(1);
    let set = v4l2_ctl(vivid::DEVICE, &["--get-ctrl", "brightness,horizontal_flip,menu"]);
    capture.stop();
    let values: Vec<&str> =
        set.lines().map(|line| line.split(": ").nth(1).unwrap().split(' ').next().unwrap()).collect();
    assert_eq!(values, ["77", "1", "4"], "{set}");
}

#[test]
#[ignore = "runs in the virtual machine"]
fn unsupported_settings_are_refused() {
    let _vivid = vivid::load();
    let assert_refused = |scanner: &str, expected: &[&str]| {
        let bench = Bench::from_configuration(scanner);
        bench.assert_refused(&[&"run", &"--config", &bench.configuration()], expected);
        bench.assert_nothing_left();
    };
    assert_refused(
        &vivid::scanner("brightness = 300"),
        &["camera 1", "brightness = 300", "from 0 to 255, default 128"],
    );
    assert_refused(&vivid::scanner("brightnes = 3"), &["brightnes", "no such control", "brightness"]);
    let units = vivid::scanner("").replace(
        "[cameras.cam1.controls]",
        "extension_units = [{ unit = 3, selector = 2, bytes = \"01 00\" }]\n[cameras.cam1.controls]",
    );
    let says = ["camera 1", "extension unit 3, selector 2", "the driver is vivid", "uvcvideo"];
    assert_refused(&units, &says);
    assert_refused(&vivid::scanner("read_only_integer_32_bits = 3"), &["read_only_integer_32_bits", "is read-only"]);
    let format = vivid::scanner("").replace("\n[cameras.cam1]", "\nformat = \"Y14\"\n[cameras.cam1]");
    assert_refused(&format, &["Y14", "GREY", "Y16"]);
    let signal = vivid::scanner("").replace("1280x720@50", "1281x720@50");
    assert_refused(&signal, &["1281x720@50", "1280x720@50"]);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn cameras_are_listed_with_their_formats_and_controls() {
    let _vivid = vivid::load();
    let bench = Bench::new();
    let listed = bench.json(&[0], &[&"cameras", &"--json"]);
    let cameras = listed["cameras"].as_array().unwrap();
    let places: Vec<&str> = cameras.iter().map(|camera| camera["bus_info"].as_str().unwrap()).collect();
    assert_eq!(places, ["platform:vivid-000", "platform:vivid-001"]);
    let text = bench.execute(&[0], &[&"cameras", &"bus:platform:vivid-001"]);
    for part in ["/dev/video1", "vivid", "GREY", "Y10", "Y16", "NV12", "brightness", "0 to 255", "time stamps of the"] {
        assert!(text.contains(part), "{part:?} is missing in {text}");
    }
}
