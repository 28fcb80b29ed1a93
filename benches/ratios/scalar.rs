//! The paper's method in the library's scalar reference, relative to ours.

use std::sync::Arc;

use fringeflow::correspondence::{MatchSettings, ResolutionMethod};

use super::bench::{Bench, STEPS};
use super::clock::interleave;
use super::cloud::images_to_cloud;
use super::line::{Report, Target, Time};
use super::scenes::Workers;

/// Targets: least time of the scalar reference relative to ours; largest share of the pixels accepted by both that may
/// have different orders, percent.
const TIME_TARGET: f64 = 1.0;
const MAX_DIFFERENT_PERCENT: f64 = 0.1;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let easy = bench.easy();
    let workers_with = |method| {
        let settings = MatchSettings { method, ..MatchSettings::default() };
        Workers::with_settings(&easy.scene, Arc::clone(&easy.table), STEPS, settings)
    };
    let (mut ours, mut reference) = (workers_with(ResolutionMethod::Moments), workers_with(ResolutionMethod::Paper));
    let mut contenders = [images_to_cloud(&mut ours, &easy), images_to_cloud(&mut reference, &easy)];
    let spent = interleave(bench.repetitions.min(5), &mut contenders);
    drop(contenders);
    let name = "images → cloud against the paper's method in scalar code, easy";
    report.ratio(name, &spent[1], &spent[0], Time::Cpu, Target::AtLeast(TIME_TARGET));
    let (ours, reference) = (&ours.found.matches, &reference.found.matches);
    let pairs =
        (0..ours.outcomes.len()).filter_map(|pixel| Some((ours.candidate(pixel)?, reference.candidate(pixel)?)));
    let (both, different) =
        pairs.fold((0, 0), |(both, different), (a, b)| (both + 1, different + usize::from(a.order != b.order)));
    let percent = 100.0 * different as f64 / f64::from(both.max(1));
    let name = "pixels that both accept, with another order, %, easy";
    report.measurement(
        name,
        [format!("{different}"), format!("{both}")],
        percent,
        &[],
        Target::AtMost(MAX_DIFFERENT_PERCENT),
    );
}
