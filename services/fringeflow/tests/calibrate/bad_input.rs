//! Inputs that are no calibration set. Each ends with one line that names file, field and remedy, and nothing is written.

use std::path::Path;

use crate::{BOARD, copied, fringeflow, intact, path};

/// An input that cannot be used.
struct Bad {
    name: &'static str,
    /// Damages a set of three views.
    damage: fn(&Path),
    /// Options in the place of `--board BOARD`; SET stands for the folder.
    options: &'static [&'static str],
    says: &'static [&'static str],
}

const fn damaged(name: &'static str, damage: fn(&Path), says: &'static [&'static str]) -> Bad {
    Bad { name, damage, options: &["SET", "--board", BOARD], says }
}

const fn given(name: &'static str, options: &'static [&'static str], says: &'static [&'static str]) -> Bad {
    Bad { name, damage: |_| {}, options, says }
}

const BAD: &[Bad] = &[
    damaged("no folder", remove_all, &["set", "is not a folder"]),
    damaged("empty folder", empty, &["has no images of both cameras", "cam1"]),
    damaged("no patterns", |f| remove(f, "patterns.toml"), &["has a folder for each pose, but no patterns.toml"]),
    damaged("patterns that are no TOML", |f| write(f, "patterns.toml", "images = ["), &["patterns.toml"]),
    damaged(
        "patterns with an unknown key",
        |f| edit(f, "projector_px", "projektor_px"),
        &["patterns.toml", "projektor_px"],
    ),
    damaged(
        "patterns of no size",
        |f| edit(f, "projector_px = [", "projector_px = [0, "),
        &["patterns.toml", "projector_px"],
    ),
    damaged(
        "no fringes along the rows",
        |f| edit(f, "direction = \"rows\"", "direction = \"columns\""),
        &["patterns.toml"],
    ),
    damaged("no Gray code", |f| edit(f, "kind = \"gray\"", "kind = \"grey\""), &["patterns.toml", "grey"]),
    damaged("an image too few", |f| remove(f, "view_01/cam2/004.png"), &["view_01/cam2", "33 images", "34"]),
    damaged("an image too many", |f| copy(f, "view_01/cam2/004.png", "view_01/cam2/099.png"), &["35 images"]),
    damaged("an empty image", |f| write(f, "view_01/cam1/003.png", ""), &["003.png", "empty"]),
    damaged("a cut image", |f| cut(f, "view_01/cam1/003.png"), &["003.png", "not an intact image"]),
    damaged("a text as image", |f| write(f, "view_01/cam1/003.png", "hello"), &["003.png"]),
    damaged("an image of another size", |f| image(f, "view_01/cam1/003.png", 100, 80, 90), &["view_01", "sizes"]),
    damaged("black images of camera 2", |f| fill(f, "cam2", 0), &["camera 2 shows no board", "no contrast"]),
    damaged("white images of camera 1", |f| fill(f, "cam1", 255), &["camera 1 shows no board", "no contrast"]),
    damaged("two views", |f| remove_folder(f, "view_02"), &["2 poses", "at least 3"]),
    damaged(
        "one camera",
        |f| (0..3).for_each(|v| remove_folder(f, &format!("view_{v:02}/cam2"))),
        &["no images of both"],
    ),
    given(
        "a board of another size",
        &["SET", "--board", "charuco:7x5:square=11:marker=8:dictionary=4x4_100"],
        &["board"],
    ),
    given("other markers", &["SET", "--board", "charuco:10x8:square=11:marker=8:dictionary=6x6_250"], &["dictionary"]),
    given("no board", &["SET", "--board", "waffle:3x3"], &["--board waffle:3x3", "chessboard"]),
    given("a board without squares", &["SET", "--board", "chessboard:9x6"], &["square"]),
    given("a board file that is missing", &["SET", "--board", "missing.toml"], &["missing.toml"]),
    given("rulers that are no lengths", &["SET", "--board", BOARD, "--rulers", "abc"], &["--rulers", "millimetres"]),
    given("rulers far off", &["SET", "--board", BOARD, "--rulers", "11,8"], &["110 mm across", "outer marks"]),
    given("a comparison that is missing", &["SET", "--board", BOARD, "--compare", "none.yml"], &["none.yml"]),
    given(
        "a comparison that is no calibration",
        &["SET", "--board", BOARD, "--compare", "SET/truth.json"],
        &["truth.json"],
    ),
    given("no board at all", &["SET"], &["--board"]),
    given("scans that are missing", &["--refine", "none.mcap"], &["none.mcap"]),
    given("a scene without cameras", &["--refine", "SET"], &["--from"]),
    given(
        "a scene in folders of poses",
        &["--refine", "SET", "--from", "SET/exact.yml"],
        &["no images of both cameras"],
    ),
    given("a board with --refine", &["--refine", "SET", "--board", BOARD], &["--board"]),
];

#[test]
fn every_bad_input_is_named_and_nothing_is_written() {
    for Bad { name, damage, options, says } in BAD {
        let folder = tempfile::tempdir().unwrap();
        let set = folder.path().join("set");
        for part in ["view_00", "view_01", "view_02"] {
            copied(&intact().join(part), &set.join(part));
        }
        for part in ["patterns.toml", "exact.yml", "truth.json"] {
            std::fs::copy(intact().join(part), set.join(part)).unwrap();
        }
        damage(&set);
        let file = folder.path().join("calibration.yml");
        std::fs::write(&file, "the file of before").unwrap();
        let options: Vec<String> = options.iter().map(|option| option.replace("SET", path(&set))).collect();
        let options: Vec<&str> = options.iter().map(String::as_str).collect();
        let output = fringeflow(&[&["calibrate"], &options[..], &["-o", path(&file)]].concat());
        let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.status.code(), Some(2), "{name}: {text}");
        for words in *says {
            assert!(text.contains(words), "{name}: {words}: {text}");
        }
        assert!(!text.contains("panicked"), "{name}: {text}");
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "the file of before", "{name}");
    }
}

#[test]
fn outputs_that_cannot_be_written_are_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    for target in [folder.path().join("none/calibration.yml"), folder.path().to_owned()] {
        let output = fringeflow(&["calibrate", path(intact()), "--board", BOARD, "-o", path(&target)]);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(output.stdout.is_empty());
    }
}

fn remove_all(folder: &Path) {
    std::fs::remove_dir_all(folder).unwrap();
}

fn empty(folder: &Path) {
    remove_all(folder);
    std::fs::create_dir(folder).unwrap();
}

fn remove(folder: &Path, name: &str) {
    std::fs::remove_file(folder.join(name)).unwrap();
}

fn remove_folder(folder: &Path, name: &str) {
    std::fs::remove_dir_all(folder.join(name)).unwrap();
}

fn copy(folder: &Path, from: &str, to: &str) {
    std::fs::copy(folder.join(from), folder.join(to)).unwrap();
}

fn write(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).unwrap();
}

fn edit(folder: &Path, from: &str, to: &str) {
    let file = folder.join("patterns.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains(from), "{from}");
    std::fs::write(file, text.replace(from, to)).unwrap();
}

fn cut(folder: &Path, name: &str) {
    let bytes = std::fs::read(folder.join(name)).unwrap();
    std::fs::write(folder.join(name), &bytes[..bytes.len() / 2]).unwrap();
}

/// Replaces an image by an even one.
fn image(folder: &Path, name: &str, width: u32, height: u32, grey: u8) {
    let mut encoder = png::Encoder::new(std::fs::File::create(folder.join(name)).unwrap(), width, height);
    encoder.set_color(png::ColorType::Grayscale);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&vec![grey; (width * height) as usize]).unwrap();
}

fn fill(folder: &Path, camera: &str, grey: u8) {
    for view in 0..3 {
        for number in 0..34 {
            image(folder, &format!("view_{view:02}/{camera}/{number:03}.png"), 320, 256, grey);
        }
    }
}
