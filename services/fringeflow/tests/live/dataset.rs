//! A dataset folder becomes a cloud by import and replay over the channels.

use std::fs;

use crate::support::Bench;

#[test]
fn a_dataset_replayed_over_the_channels_gives_the_same_cloud_as_reconstruct() {
    let bench = Bench::new();
    let [dataset, imported, replayed] = ["plane", "imported.mcap", "replayed.mcap"].map(|name| bench.path(name));
    let options = "--object plane --board none --size 96x80 --steps 4 --period 48 --noise low --sd 0 --no-gray \
                   --supersampling 1";
    let mut simulate = bench.command(&[&"simulate", &"-o", &dataset]);
    assert!(simulate.args(options.split_whitespace()).output().unwrap().status.success());
    bench.execute(&[0], &[&"import", &dataset, &"-o", &imported]);
    let replay = bench.replay(&[&"replay", &imported, &"--rate", &"max", &"--record", &replayed]);
    replay.assert_undisturbed();
    assert_eq!((replay.stage("windowing").taken, replay.stage("cloud").passed), (4, 1), "{replay:?}");
    bench.assert_refused(&[&"replay", &imported, &"--rate", &"max", &"--verify"], &["imported.mcap", "has no clouds"]);
    bench.assert_nothing_left();
    let [direct, over_channels] = ["direct.ply", "channels.ply"].map(|name| bench.path(name));
    bench.execute(&[0], &[&"reconstruct", &dataset, &"-o", &direct]);
    bench.execute(&[0], &[&"export", &replayed, &"-o", &over_channels]);
    let bytes = fs::read(direct).unwrap();
    assert!(bytes.len() > 10_000 && bytes == fs::read(over_channels).unwrap());
}
