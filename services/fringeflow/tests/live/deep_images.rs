//! Cameras of more than 8 bits, live, recorded, replayed and offline.

use std::fs;
use std::path::Path;

use crate::support::Bench;

const FORMAT: (&str, &str) = ("rate_hz = 25.0", "rate_hz = 25.0\nformat = \"Y12\"");

#[test]
fn images_of_twelve_bits_come_again_to_the_byte() {
    let bench = Bench::with(&[FORMAT]);
    let recording = bench.path("scan.mcap");
    let ended = bench.run(&[&"--seconds", &"2", &"--record", &recording]);
    ended.assert_undisturbed();
    bench.assert_nothing_left();
    assert!(ended.stage("cloud").passed > 0, "{ended:?}");
    let info = bench.json(&[0], &[&"info", &recording, &"--json"]);
    assert_eq!(info["pixel_format"], "Y12");
    assert_eq!(bench.json(&[0, 3], &[&"check", &recording, &"--json"])["fault_count"], 0);
    let offline = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    assert_eq!((&offline["different"], &offline["no_cloud"]), (&0.into(), &0.into()));
    assert!(offline["same"].as_u64().unwrap() > 0);
    let live = bench.replay(&[&"replay", &recording, &"--rate", &"max", &"--verify"]);
    live.assert_balanced();
    let compared = &live.summary["compared"];
    assert_eq!((&compared["different"], &compared["missing"]), (&0.into(), &0.into()), "{live:?}");
    assert_eq!(compared["same"], offline["same"], "{live:?}");
    bench.assert_nothing_left();
}

#[test]
fn a_folder_of_twelve_bits_goes_through_recording_and_channels() {
    let bench = Bench::new();
    let [dataset, imported, replayed, exported] =
        ["plane", "imported.mcap", "replayed.mcap", "exported"].map(|name| bench.path(name));
    let options = "--object plane --board none --size 96x80 --steps 4 --period 48 --noise low --sd 0 --no-gray \
                   --supersampling 1 --format Y12";
    let mut simulate = bench.command(&[&"simulate", &"-o", &dataset]);
    assert!(simulate.args(options.split_whitespace()).output().unwrap().status.success());
    bench.done(&[0], &[&"import", &dataset, &"-o", &imported]);
    bench.replay(&[&"replay", &imported, &"--rate", &"max", &"--record", &replayed]).assert_undisturbed();
    bench.done(&[0], &[&"export", &replayed, &"--images", &"-o", &exported]);
    let bytes = |folder: &Path, name: &str| fs::read(folder.join(name)).unwrap();
    for name in ["meta.json", "cam1/phase_00.png", "cam2/phase_03.png"] {
        assert!(bytes(&dataset, name) == bytes(&exported, name), "{name}");
    }
    let clouds = [&dataset, &exported, &imported, &replayed].map(|input| {
        let cloud = bench.path("cloud.ply");
        bench.done(&[0], &[&"reconstruct", input, &"-o", &cloud]);
        fs::read(cloud).unwrap()
    });
    assert!(clouds[0].len() > 10_000 && clouds.iter().all(|cloud| *cloud == clouds[0]));
    let over_channels = bench.path("channels.ply");
    bench.done(&[0], &[&"export", &replayed, &"-o", &over_channels]);
    assert!(fs::read(over_channels).unwrap() == clouds[0]);
}
