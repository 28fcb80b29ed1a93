//! How time grows with pixels and with the length of segments.

use std::hint::black_box;
use std::sync::Arc;

use super::bench::{Bench, Measured, STEPS};
use super::clock::{Spent, contender, interleave};
use super::cloud::images_to_cloud;
use super::line::{Report, Time, Wanted};
use super::scenes::{Geometry, Workers};

/// Four times the pixels, and segments of twice the length.
const FOUR_TIMES_THE_PIXELS: f64 = 4.8;
const TWICE_THE_LENGTH: f64 = 1.15;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let easy = bench.easy();
    let quarter = Measured::new(Geometry::Easy, bench.size_px.map(|side| side / 2));
    let deep = Measured::new(Geometry::DeepVolume, bench.size_px);
    report.note(format!(
        "segments: {:.0} px with {:.1} periods in the mean, of the deeper volume {:.0} px with {:.1}",
        mean_length_px(&easy),
        easy.scene.rig.mean_periods(),
        mean_length_px(&deep),
        deep.scene.rig.mean_periods()
    ));
    let new = |m: &Measured| Workers::with_table(&m.scene, Arc::clone(&m.table), STEPS);
    let (mut whole, mut part) = (new(&easy), new(&quarter));
    let mut contenders = [images_to_cloud(&mut whole, &easy), images_to_cloud(&mut part, &quarter)];
    let spent = interleave(bench.repetitions, &mut contenders);
    drop(contenders);
    let name = "four times the pixels";
    report.ratio(name, &spent[0], &spent[1], Time::Cpu, Wanted::AtMost(FOUR_TIMES_THE_PIXELS));

    let mut long = new(&deep);
    let pixels = [searched_pixels(&mut long, &deep), searched_pixels(&mut whole, &easy)];
    let contenders = &mut [contender(|| long.search()), contender(|| black_box(&mut whole).search())];
    let spent: Vec<Vec<Spent>> = interleave(bench.repetitions, contenders);
    let name = "match time a pixel, segments twice as long";
    let sides = [(spent[0].as_slice(), pixels[0]), (spent[1].as_slice(), pixels[1])];
    report.scaled_ratio(name, sides, Time::Cpu, Wanted::AtMost(TWICE_THE_LENGTH));
}

/// Decodes the window; the pixels of C1 with a phase and a segment.
fn searched_pixels(workers: &mut Workers, measured: &Measured) -> f64 {
    workers.decode(0, &measured.images.levels());
    let valid = &workers.maps.cam1.valid;
    (0..valid.len()).filter(|&pixel| valid[pixel] && measured.table.has_segment(pixel)).count() as f64
}

fn mean_length_px(measured: &Measured) -> f64 {
    let [width, height] = measured.table.size_px();
    let limits = (0..width * height).map(|pixel| measured.table.limits_px(pixel));
    let lengths: Vec<f32> = limits.map(|[begin_px, end_px]| end_px - begin_px).filter(|&length| length > 0.0).collect();
    lengths.iter().map(|&length| f64::from(length)).sum::<f64>() / lengths.len().max(1) as f64
}
