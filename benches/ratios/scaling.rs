//! Growth of time with the number of pixels, with length and fringe orders of segments, and with a board behind the
//! volume.

use std::hint::black_box;
use std::sync::Arc;

use super::bench::{Bench, PreparedScene, STEPS};
use super::clock::{Spent, contender, interleave};
use super::cloud::images_to_cloud;
use super::line::{Report, Target, Time};
use super::scenes::{Geometry, Workers};

/// Targets: largest ratio of times with four times the pixels, and with segments of twice the length.
const FOUR_TIMES_THE_PIXELS: f64 = 4.8;
const TWICE_THE_LENGTH: f64 = 1.15;
/// Targets: largest ratio of times with four times as many orders, and with a board behind the volume.
const FOUR_TIMES_THE_ORDERS: f64 = 1.3;
const BOARD_BEHIND: f64 = 1.0;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let easy = bench.easy();
    let quarter = PreparedScene::new(Geometry::Easy, bench.size_px.map(|side| side / 2));
    let deep = PreparedScene::new(Geometry::DeepVolume, bench.size_px);
    report.note(format!(
        "segments: mean {:.0} px with {:.1} periods; in the deeper volume {:.0} px with {:.1}",
        mean_length_px(&easy),
        easy.scene.rig.mean_periods(),
        mean_length_px(&deep),
        deep.scene.rig.mean_periods()
    ));
    let new_workers = |m: &PreparedScene| Workers::with_table(&m.scene, Arc::clone(&m.table), STEPS);
    let (mut whole, mut part) = (new_workers(&easy), new_workers(&quarter));
    let mut contenders = [images_to_cloud(&mut whole, &easy), images_to_cloud(&mut part, &quarter)];
    let spent = interleave(bench.repetitions, &mut contenders);
    drop(contenders);
    let name = "four times the pixels";
    report.ratio(name, &spent[0], &spent[1], Time::Cpu, Target::AtMost(FOUR_TIMES_THE_PIXELS));

    let mut long = new_workers(&deep);
    let pixels = [decode_and_count_pixels(&mut long, &deep), decode_and_count_pixels(&mut whole, &easy)];
    let contenders = &mut [contender(|| long.search()), contender(|| black_box(&mut whole).search())];
    let spent: Vec<Vec<Spent>> = interleave(bench.repetitions, contenders);
    let name = "match time a pixel, segments twice as long";
    let sides = [(spent[0].as_slice(), pixels[0]), (spent[1].as_slice(), pixels[1])];
    report.scaled_ratio(name, sides, Time::Cpu, Target::AtMost(TWICE_THE_LENGTH));
    measure_orders_and_boards(bench, report, &easy);
}

/// Measures the cost of more fringe orders per segment, and of a board behind the volume.
fn measure_orders_and_boards(bench: &Bench, report: &mut Report, easy: &PreparedScene) {
    let prepare = |geometry: Geometry| PreparedScene::new(geometry, bench.size_px);
    let many = prepare(Geometry::ManyOrders);
    let periods = [&many, easy].map(|measured| measured.scene.rig.mean_periods());
    let name = format!("match time with {:.0} orders on a segment ÷ with {:.0}", periods[0], periods[1]);
    compare_match_times(bench, report, &name, [&many, easy], FOUR_TIMES_THE_ORDERS);
    drop(many);
    let (behind, none) = (prepare(Geometry::BoardBehind), prepare(Geometry::NoBoard));
    compare_match_times(
        bench,
        report,
        "match time with a board behind the volume ÷ without",
        [&behind, &none],
        BOARD_BEHIND,
    );
}

/// Measures the matching time of one scene, relative to that of another.
fn compare_match_times(bench: &Bench, report: &mut Report, name: &str, scenes: [&PreparedScene; 2], at_most: f64) {
    let mut workers = scenes.map(|m| Workers::with_table(&m.scene, Arc::clone(&m.table), STEPS));
    for (workers, measured) in workers.iter_mut().zip(scenes) {
        workers.decode(0, &measured.images.levels());
    }
    let [over, under] = &mut workers;
    let spent = interleave(bench.repetitions, &mut [contender(|| over.search()), contender(|| under.search())]);
    report.ratio(name, &spent[0], &spent[1], Time::Cpu, Target::AtMost(at_most));
}

/// Decodes the window. Returns the number of pixels of C1 with a phase and a segment.
fn decode_and_count_pixels(workers: &mut Workers, measured: &PreparedScene) -> f64 {
    workers.decode(0, &measured.images.levels());
    let valid = &workers.maps.cam1.valid;
    (0..valid.len()).filter(|&pixel| valid[pixel] && measured.table.has_segment(pixel)).count() as f64
}

/// Mean length of the segments.
fn mean_length_px(measured: &PreparedScene) -> f64 {
    let [width, height] = measured.table.size_px();
    let limits = (0..width * height).map(|pixel| measured.table.limits_px(pixel));
    let lengths: Vec<f32> = limits.map(|[begin_px, end_px]| end_px - begin_px).filter(|&length| length > 0.0).collect();
    lengths.iter().map(|&length| f64::from(length)).sum::<f64>() / lengths.len().max(1) as f64
}
