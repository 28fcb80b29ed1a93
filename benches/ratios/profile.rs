//! CPU time of a window by stage, measured by calling the stages one by one.

use std::hint::black_box;
use std::sync::Arc;

use serde_json::json;

use fringeflow::correspondence::{DeltaHistogram, EpipolarImage, ResolutionSettings, measure_delta};
use fringeflow::phase::{
    MotionFit, MotionScratch, PhaseMap, SequenceCheck, SequenceScratch, Validity, decode, decode_moving_into,
};

use super::bench::{Bench, PreparedScene, STEPS};
use super::clock::{Contender, contender, interleave, median};
use super::line::Report;
use super::scenes::{Workers, shifts, shifts_rad};
use super::sliding::{window, window_images};

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let mut columns: Vec<(String, Vec<(&'static str, f64)>)> = Vec::new();
    for (name, measured) in [("easy", bench.easy()), ("hard", bench.hard())] {
        columns.push((name.to_owned(), profile_window(&measured, bench.repetitions.min(7))));
    }
    report.note(format_table(&columns));
    let moving = profile_moving_window(&bench.easy(), bench.repetitions.min(5));
    report.note(format_table(&[("a window of six images".to_owned(), moving.clone())]));
    let object = |stages: &[(&str, f64)]| json!(stages.iter().copied().collect::<std::collections::BTreeMap<_, _>>());
    let mut data: serde_json::Map<String, serde_json::Value> =
        columns.iter().map(|(name, stages)| (name.clone(), object(stages))).collect();
    data.insert("moving".to_owned(), object(&moving));
    report.data("profile_ms", data.into());
}

/// CPU milliseconds of each stage, for a window of four images. Steps that cannot be called separately are the rest.
fn profile_window(measured: &PreparedScene, repetitions: usize) -> Vec<(&'static str, f64)> {
    let (table, [width, height], validity) = (&measured.table, measured.scene.size_px, Validity::default());
    let levels = measured.images.levels();
    let mut workers = Workers::with_table(&measured.scene, Arc::clone(table), STEPS);
    _ = workers.cloud(0, &levels);
    let [cam1, cam2] = [workers.maps.cam1.clone(), workers.maps.cam2.clone()];
    let image = EpipolarImage::resample(&cam2, table).unwrap();
    let histogram = DeltaHistogram::from_all_candidates(&cam1, &image, table, 0);
    let min_votes = ResolutionSettings::default().min_votes;
    let shifts = shifts(STEPS);
    let (cam1, cam2, image) = (&cam1, &cam2, &image);
    let (mut searching, mut triangulating) = (Workers::with_table(&measured.scene, Arc::clone(table), STEPS), workers);
    searching.decode(0, &levels);
    let stages: Vec<(&'static str, Contender<'_>)> = vec![
        ("decoding C1", contender(|| drop(black_box(decode(&levels[0], width, height, &shifts, &validity))))),
        ("decoding C2", contender(|| drop(black_box(decode(&levels[1], width, height, &shifts, &validity))))),
        ("matching", contender(move || searching.search())),
        ("triangulation", contender(move || _ = black_box(triangulating.triangulate()))),
        ("resampling", contender(|| drop(black_box(EpipolarImage::resample(cam2, table))))),
        ("histogram of δ", contender(|| _ = black_box(DeltaHistogram::from_all_candidates(cam1, image, table, 0)))),
        ("statistics of δ", contender(|| _ = black_box(measure_delta(cam1, image, table, &histogram, min_votes)))),
    ];
    let (names, mut contenders): (Vec<_>, Vec<_>) = stages.into_iter().unzip();
    let spent = interleave(repetitions, &mut contenders);
    let ms = |place: usize| median(spent[place].iter().map(|s| s.cpu_ns * 1e-6));
    let mut stages_ms: Vec<(&'static str, f64)> = names.iter().enumerate().map(|(i, name)| (*name, ms(i))).collect();
    // The stages from index 4 on are parts of the matching. Replace the matching by its rest.
    let parts: f64 = stages_ms[4..].iter().map(|(_, ms)| ms).sum();
    let matching = stages_ms.remove(2).1;
    stages_ms.push(("rest of the matching", matching - parts));
    stages_ms.push(("all", stages_ms.iter().map(|(_, ms)| ms).sum()));
    stages_ms
}

/// CPU milliseconds of the stages that a window of a moving scanner has instead of plain decoding.
fn profile_moving_window(measured: &PreparedScene, repetitions: usize) -> Vec<(&'static str, f64)> {
    let (images, [width, height]) = (measured.scene.moving_images(STEPS), measured.scene.size_px);
    let (window, validity, cycle) = (window(&images, 0), Validity::default(), shifts_rad(STEPS));
    let all: Vec<f64> = cycle.iter().copied().cycle().take(window_images()).collect();
    let fit = MotionFit::new(&all).unwrap();
    let check = SequenceCheck::new(&cycle, 0, window_images());
    let (mut map, mut scratch, mut check_scratch) =
        (PhaseMap::default(), MotionScratch::default(), SequenceScratch::default());
    let names = ["decoding C1 with motion", "check of the sequence of C1"];
    let spent = interleave(
        repetitions,
        &mut [
            contender(|| {
                decode_moving_into(&mut map, &mut scratch, &window[0], width, height, &fit, &validity).unwrap();
                black_box(&map);
            }),
            contender(|| _ = black_box(check.find_fault_in(&mut check_scratch, &window[0], width, height, &validity))),
        ],
    );
    names.into_iter().zip(spent).map(|(name, spent)| (name, median(spent.iter().map(|s| s.cpu_ns * 1e-6)))).collect()
}

/// Formats profiles as a table, one column each. There is a row for each stage of any profile.
fn format_table(columns: &[(String, Vec<(&'static str, f64)>)]) -> String {
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in columns.iter().flat_map(|(_, stages)| stages) {
        if !names.contains(name) {
            names.push(name);
        }
    }
    // Put the sum last.
    names.sort_by_key(|name| *name == "all");
    let mut text = format!("{:<30}", "CPU ms of a window");
    columns.iter().for_each(|(name, _)| text += &format!("{name:>24}"));
    for name in names {
        text += &format!("\n{name:<30}");
        for (_, stages) in columns {
            let ms = stages.iter().find(|(other, _)| *other == name);
            text += &ms.map_or(format!("{:>24}", "–"), |(_, ms)| format!("{ms:>24.2}"));
        }
    }
    text
}
