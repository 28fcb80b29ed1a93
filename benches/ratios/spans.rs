//! A window with the spans of its stages while no subscriber asks for them, relative to a window without spans.

use std::hint::black_box;
use std::sync::Arc;

use fringeflow_message::{Stage, Window};
use fringeflow_runtime::{WindowSpan, log};

use super::bench::{Bench, STEPS};
use super::clock::{contender, interleave, measure as measure_time};
use super::line::{Report, Target, Time};
use super::scenes::Workers;

/// Target: largest time of a window with spans that are off. They cost nothing that can be measured.
const TARGET: f64 = 1.02;
/// Spans for the time of one.
const SPANS: u64 = 1_000_000;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    // The log of a service, at its usual level.
    log::start("bench", None);
    let easy = bench.easy();
    let images = easy.images.levels();
    let new_workers = || Workers::with_table(&easy.scene, Arc::clone(&easy.table), STEPS);
    let (mut with_spans, mut without) = (new_workers(), new_workers());
    let mut window = 0;
    let mut contenders = [
        contender(|| {
            window += 1;
            begin(Stage::Phase, window).work(|| with_spans.decode(0, &images));
            begin(Stage::Correspondence, window).work(|| with_spans.search());
            begin(Stage::Cloud, window).work(|| _ = black_box(with_spans.triangulate()));
        }),
        contender(|| _ = black_box(without.cloud(0, &images))),
    ];
    let spent = interleave(bench.repetitions, &mut contenders);
    report.ratio("window with spans that are off ÷ without", &spent[0], &spent[1], Time::Cpu, Target::AtMost(TARGET));
    let count = if bench.is_measured { SPANS } else { 1 };
    let spans =
        measure_time(|| (0..count).for_each(|window| begin(Stage::Cloud, window).work(|| _ = black_box(window))));
    report.note(format!("a span that is off takes {:.1} ns", spans.cpu_ns / count as f64));
}

/// The span of a window, as the services begin it.
fn begin(stage: Stage, window: u64) -> WindowSpan {
    let span = WindowSpan::new(stage, window);
    span.identify(black_box(&Window::default()));
    span
}
