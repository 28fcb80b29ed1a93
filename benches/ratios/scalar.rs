//! The paper's method as the library's scalar reference has it, against the semi-global resolution.

use std::sync::Arc;

use fringeflow::correspondence::{MatchSettings, ResolutionMethod};

use super::bench::{Bench, STEPS};
use super::clock::interleave;
use super::cloud::images_to_cloud;
use super::line::{Report, Time, Wanted};
use super::scenes::Workers;

/// How many times as long the scalar reference may take for what it decides pixel by pixel; and how many of the pixels that both
/// accept may have another order, percent.
const WANTED: f64 = 1.0;
const DIFFERENT_PERCENT: f64 = 0.1;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let easy = bench.easy();
    let of = |method| {
        let settings = MatchSettings { method, ..MatchSettings::default() };
        Workers::with_settings(&easy.scene, Arc::clone(&easy.table), STEPS, settings)
    };
    let (mut ours, mut reference) = (of(ResolutionMethod::SemiGlobal), of(ResolutionMethod::Paper));
    let mut contenders = [images_to_cloud(&mut ours, &easy), images_to_cloud(&mut reference, &easy)];
    let spent = interleave(bench.repetitions.min(5), &mut contenders);
    drop(contenders);
    let name = "images → cloud against the paper's method in scalar code, easy";
    report.ratio(name, &spent[1], &spent[0], Time::Cpu, Wanted::AtLeast(WANTED));
    let (ours, reference) = (&ours.found.matches, &reference.found.matches);
    let pairs =
        (0..ours.outcomes.len()).filter_map(|pixel| Some((ours.candidate(pixel)?, reference.candidate(pixel)?)));
    let (both, other) = pairs.fold((0, 0), |(both, other), (a, b)| (both + 1, other + usize::from(a.order != b.order)));
    let percent = 100.0 * other as f64 / f64::from(both.max(1));
    let name = "pixels that both accept, with another order, %, easy";
    report.figure(name, [format!("{other}"), format!("{both}")], percent, &[], Wanted::AtMost(DIFFERENT_PERCENT));
}
