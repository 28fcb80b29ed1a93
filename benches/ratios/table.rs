//! The segment table: building it, relative to the maps that rectify a stereo pair; loading it, relative to copying its
//! bytes.

use std::hint::black_box;

use fringeflow::correspondence::{Fingerprint, SegmentTable};

use super::bench::Bench;
use super::clock::{contender, interleave};
use super::line::{Report, Target, Time};
use super::scenes::bench_folder;

/// Targets: building, relative to two calls of `initUndistortRectifyMap`; loading, relative to a copy of the file's
/// bytes.
const BUILD_TARGET: f64 = 20.0;
const LOAD_TARGET: f64 = 2.0;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let easy = bench.easy();
    let (repetitions, rig) = (bench.repetitions, &easy.scene.rig);
    let build = "segment table: build ÷ two initUndistortRectifyMap";
    match bench.peers() {
        Err(why) => report.skipped(build, &why),
        Ok(peers) => {
            let ours = contender(|| {
                _ = black_box(SegmentTable::build(&rig.calibrated, &rig.volume, &rig.columns).unwrap());
            });
            let spent = interleave(repetitions.min(5), &mut [ours, peers.contender("undistort_maps")]);
            report.ratio(build, &spent[0], &spent[1], Time::Cpu, Target::AtMost(BUILD_TARGET));
        }
    }
    let file = bench_folder().join("easy.segments");
    easy.table.save(&file).unwrap();
    let (source, mut copy) = (std::fs::read(&file).unwrap(), std::fs::read(&file).unwrap());
    let fingerprint = Fingerprint::new(&rig.calibrated, &rig.volume, &rig.columns);
    let mut contenders = [
        contender(|| drop(black_box(SegmentTable::load(&file, fingerprint).unwrap()))),
        contender(|| black_box(&mut copy).copy_from_slice(black_box(&source))),
    ];
    let spent = interleave(repetitions, &mut contenders);
    report.ratio(
        "segment table: load ÷ memcpy of its file",
        &spent[0],
        &spent[1],
        Time::Wall,
        Target::AtMost(LOAD_TARGET),
    );
    let (bytes, pixels) = (source.len() as f64, (bench.size_px[0] * bench.size_px[1]) as f64);
    report.note(format!("segment table: {:.1} MB, {:.1} bytes per pixel", bytes * 1e-6, bytes / pixels));
}
