//! Datasets with images as cameras send them: every command gives what it gives for grey images.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::{json, run_ok};

/// Simulates a plane and returns the folder. The fringes are wide enough for so few pixels.
fn simulate(folder: &Path, options: &[&str]) -> PathBuf {
    let set = folder.join(options.join("_"));
    let mut arguments =
        "simulate --object plane --board none --size 96x80 --period 48 --steps 4 --sd 0 --supersampling 1 \
                         --noise low --no-gray -o"
            .split_whitespace()
            .map(PathBuf::from)
            .collect::<Vec<_>>();
    arguments.push(set.clone());
    arguments.extend(options.iter().map(PathBuf::from));
    run_ok(&arguments.iter().map(|argument| argument as &dyn AsRef<OsStr>).collect::<Vec<_>>());
    set
}

fn cloud(set: &Path) -> Vec<u8> {
    let path = set.with_extension("ply");
    run_ok(&[&"reconstruct", &set, &"-o", &path]);
    std::fs::read(path).unwrap()
}

/// Imports the dataset, exports it again, and checks that both give the same cloud.
fn check_recording(set: &Path, expected: &[u8]) {
    let recording = set.with_extension("mcap");
    run_ok(&[&"import", &set, &"-o", &recording]);
    let from_recording = set.with_extension("recorded.ply");
    run_ok(&[&"reconstruct", &recording, &"-o", &from_recording]);
    assert!(std::fs::read(from_recording).unwrap() == expected, "{}", set.display());
    let exported = set.with_extension("exported");
    run_ok(&[&"export", &recording, &"--images", &"-o", &exported]);
    assert!(cloud(&exported) == expected, "{}", set.display());
}

#[test]
fn formats_with_the_same_values_give_the_same_cloud() {
    let folder = tempfile::tempdir().unwrap();
    let layouts = [vec![], vec!["--stereo-layout", "side-by-side"], vec!["--stereo-layout", "top-bottom"]];
    for (grey, formats) in [
        ("GREY", &["YUYV", "VYUY", "NV12", "YU12", "Y8I"][..]),
        ("Y10", &["Y10P", "Y10B", "Mono10p"]),
        ("Y12", &["Y12P", "Mono12p", "Y012", "Y12I"]),
        ("Y16", &["Y16_BE", "Y16I"]),
    ] {
        let expected = cloud(&simulate(folder.path(), &["--format", grey]));
        assert!(expected.len() > 50_000, "{grey}: {} bytes", expected.len());
        for (number, format) in formats.iter().enumerate() {
            let layout = if format.ends_with('I') { &layouts[0] } else { &layouts[number % 3] };
            let options = [&["--format", format], &layout[..]].concat();
            let set = simulate(folder.path(), &options);
            let found = cloud(&set);
            assert!(found == expected, "{options:?}");
            check_recording(&set, &found);
        }
    }
}

#[test]
fn colours_and_mosaics_are_measured_as_completely_as_grey_images() {
    let folder = tempfile::tempdir().unwrap();
    let completeness = |set: &Path| {
        let evaluation = json(&run_ok(&[&"evaluate", &set, &"--json"]));
        evaluation["com_percent"].as_f64().unwrap()
    };
    let grey = completeness(&simulate(folder.path(), &["--format", "GREY"]));
    // A grey level of several pixels blurs borders, of which so small an image has many.
    for (options, most_lost) in [
        (&["--format", "RGB3"][..], 0.5),
        (&["--format", "XR24", "--stereo-layout", "top-bottom"], 0.5),
        (&["--format", "RGGB", "--bayer", "weighted"], 3.0),
        (&["--format", "BA10", "--bayer", "green"], 3.0),
        (&["--format", "pBCC", "--bayer", "raw", "--stereo-layout", "side-by-side"], 0.5),
        (&["--format", "BayerGR12p"], 0.5),
    ] {
        let set = simulate(folder.path(), options);
        let found = completeness(&set);
        assert!(found > grey - most_lost, "{options:?}: {found} %, grey images {grey} %");
        check_recording(&set, &cloud(&set));
    }
}
