//! From 2 × 4 images to a cloud by the three workers: relative to block matching of one rectified pair, and in points
//! per second.

use std::cell::RefCell;
use std::hint::black_box;
use std::rc::Rc;
use std::sync::Arc;

use super::bench::{Bench, PreparedScene, STEPS};
use super::clock::{Contender, Spent, contender, interleave, median};
use super::line::{Report, Target, Time};
use super::scenes::{Workers, ambiguous_share};

/// Peers, and the promised speed-up in easy and hard geometry; `None` without a promise.
const PEERS: [(&str, &str, f64, Option<f64>); 3] = [
    ("SGBM", "StereoSGBM, 128 disparities", 8.0, Some(5.0)),
    ("SGBM_3WAY", "SGBM_3WAY", 6.0, None),
    ("BM", "StereoBM", 2.5, None),
];
/// Targets: million points per CPU second, easy and hard; time of the hard scene (15 % ambiguous pixels) relative to
/// the easy one (2 %).
const POINTS_TARGETS: [f64; 2] = [40.0, 25.0];
const HARD_TO_EASY_TARGET: f64 = 1.6;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let scenes = [bench.easy(), bench.hard()];
    let mut workers = scenes.each_ref().map(|s| Workers::with_table(&s.scene, Arc::clone(&s.table), STEPS));
    let [easy, hard] = &mut workers;
    let mut contenders = [images_to_cloud(easy, &scenes[0]), images_to_cloud(hard, &scenes[1])];
    let spent = interleave(bench.repetitions, &mut contenders);
    drop(contenders);
    let name = "hard ÷ easy, total";
    report.ratio(name, &spent[1], &spent[0], Time::Cpu, Target::AtMost(HARD_TO_EASY_TARGET));
    for (index, geometry) in ["easy", "hard"].into_iter().enumerate() {
        report_points_per_second(report, geometry, POINTS_TARGETS[index], &workers[index], &spent[index]);
    }
    compare_with_peers(bench, report, &scenes, &mut workers);
}

fn report_points_per_second(report: &mut Report, name: &str, target: f64, workers: &Workers, spent: &[Spent]) {
    let (points, matches) = (workers.points.points.len() as f64, &workers.found.matches);
    let millions: Vec<f64> = spent.iter().map(|spent| points * 1e-6 / (spent.cpu_ns * 1e-9)).collect();
    let rate = median(millions.iter().copied());
    let values = [format!("{:.2} M", points * 1e-6), String::new()];
    report.measurement(
        &format!("million points a CPU second, {name}"),
        values,
        rate,
        &millions,
        Target::AtLeast(target),
    );
    report.note(format!(
        "{name}: {:.1} % of the pixels with candidates have several; {:.1} % of all pixels have a point",
        100.0 * ambiguous_share(matches),
        100.0 * points / matches.outcomes.len() as f64
    ));
}

fn compare_with_peers(
    bench: &mut Bench,
    report: &mut Report,
    scenes: &[Rc<PreparedScene>; 2],
    workers: &mut [Workers; 2],
) {
    let repetitions = bench.repetitions.min(9);
    let name = |peer: &str, geometry: &str| format!("images → cloud against {peer}, {geometry}");
    let peers = match bench.peers() {
        Ok(peers) => RefCell::new(peers),
        Err(why) => {
            for (_, peer, _, hard) in PEERS {
                report.skipped(&name(peer, "easy"), &why);
                hard.iter().for_each(|_| report.skipped(&name(peer, "hard"), &why));
            }
            return;
        }
    };
    let [easy, hard] = workers;
    let mut contenders = vec![images_to_cloud(easy, &scenes[0]), images_to_cloud(hard, &scenes[1])];
    for (peer, ..) in PEERS {
        let peers = &peers;
        contenders.push(Box::new(move || peers.borrow_mut().run(peer)));
    }
    let spent = interleave(repetitions, &mut contenders);
    for ((_, peer, easy, hard), taken) in PEERS.into_iter().zip(&spent[2..]) {
        report.ratio(&name(peer, "easy"), taken, &spent[0], Time::Cpu, Target::AtLeast(easy));
        if let Some(hard) = hard {
            report.ratio(&name(peer, "hard"), taken, &spent[1], Time::Cpu, Target::AtLeast(hard));
        }
    }
}

/// A contender that runs one window through all workers.
pub(crate) fn images_to_cloud<'a>(workers: &'a mut Workers, measured: &'a PreparedScene) -> Contender<'a> {
    let levels = measured.images.levels();
    contender(move || _ = black_box(workers.cloud(0, &levels)))
}
