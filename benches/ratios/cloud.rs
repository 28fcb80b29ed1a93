//! 2 × 4 images to a cloud, by the three workers, against block matching of one rectified pair; and points a second.

use std::hint::black_box;
use std::sync::Arc;

use fringeflow::correspondence::ResolutionMethod;

use super::bench::{Bench, Measured, STEPS};
use super::clock::{Contender, Spent, contender, interleave, median};
use super::line::{Report, Time, Wanted};
use super::scenes::{Workers, ambiguous_share};

/// Peers; how many times faster in easy and in hard geometry, where that is promised.
const PEERS: [(&str, &str, f64, Option<f64>); 3] = [
    ("SGBM", "StereoSGBM, 128 disparities", 25.0, Some(12.0)),
    ("SGBM_3WAY", "SGBM_3WAY", 18.0, None),
    ("BM", "StereoBM", 7.0, None),
];
/// Points a CPU second, easy and hard, and the total of 15 % ambiguous pixels in that of 2 %.
const POINTS: [f64; 2] = [140e6, 70e6];
const HARD_IN_EASY: f64 = 1.6;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let scenes = [bench.easy(), bench.hard()];
    for method in ResolutionMethod::ALL {
        let mut workers = scenes.each_ref().map(|s| Workers::with_table(&s.scene, Arc::clone(&s.table), STEPS, method));
        let mut ours: Vec<Vec<Spent>> = {
            let mut contenders: Vec<Contender<'_>> =
                workers.iter_mut().zip(&scenes).map(|(workers, scene)| images_to_cloud(workers, scene)).collect();
            interleave(bench.repetitions, &mut contenders)
        };
        of_geometries(report, method, &ours);
        let points = workers.each_ref().map(|workers| workers.points.points.len());
        let pixels = (bench.size_px[0] * bench.size_px[1]) as f64;
        for (place, name) in ["easy", "hard"].into_iter().enumerate() {
            let rates: Vec<f64> = ours[place].iter().map(|s| points[place] as f64 / (s.cpu_ns * 1e-9)).collect();
            let rate = median(rates.iter().copied());
            let values = [format!("{} M", points[place] / 1_000_000), String::new()];
            let [rate, rates] = [vec![rate * 1e-6], rates.iter().map(|r| r * 1e-6).collect()];
            let wanted = Wanted::AtLeast(POINTS[place] * 1e-6);
            report.figure(
                &format!("million points a CPU second, {name}, {}", method.name()),
                values,
                rate[0],
                &rates,
                wanted,
            );
            report.note(format!(
                "{name}, {}: {:.1} % of the pixels with candidates have several; {:.1} % of all pixels have a point",
                method.name(),
                100.0 * ambiguous_share(&workers[place].found.matches),
                100.0 * points[place] as f64 / pixels
            ));
        }
        against_peers(bench, report, method, &scenes, &mut workers);
        ours.clear();
    }
}

/// Both geometries against each other.
fn of_geometries(report: &mut Report, method: ResolutionMethod, ours: &[Vec<Spent>]) {
    let name = format!("hard (15 % ambiguous) ÷ easy (2 %), {}", method.name());
    report.ratio(&name, &ours[1], &ours[0], Time::Cpu, Wanted::AtMost(HARD_IN_EASY));
}

fn against_peers(
    bench: &mut Bench,
    report: &mut Report,
    method: ResolutionMethod,
    scenes: &[std::rc::Rc<Measured>; 2],
    workers: &mut [Workers; 2],
) {
    let repetitions = bench.repetitions.min(9);
    for (peer, name, easy, hard) in PEERS {
        let factors = [("easy", Some(easy)), ("hard", hard)];
        for (place, (geometry, factor)) in factors.into_iter().enumerate() {
            let Some(factor) = factor else { continue };
            let name = format!("images → cloud against {name}, {geometry}, {}", method.name());
            match bench.peers() {
                Err(why) => report.skipped(&name, &why),
                Ok(peers) => {
                    let ours = images_to_cloud(&mut workers[place], &scenes[place]);
                    let spent = interleave(repetitions, &mut [ours, peers.contender(peer)]);
                    report.ratio(&name, &spent[1], &spent[0], Time::Cpu, Wanted::AtLeast(factor));
                }
            }
        }
    }
}

/// One window through all workers.
pub(crate) fn images_to_cloud<'a>(workers: &'a mut Workers, measured: &'a Measured) -> Contender<'a> {
    let levels = measured.images.levels();
    contender(move || _ = black_box(workers.cloud(0, &levels)))
}
