//! The paper's method, by the library and by a plain scalar transcription; and by the library's own scalar forms.

use std::hint::black_box;
use std::sync::Arc;

use fringeflow::correspondence::{EpipolarImage, ResolutionMethod, SearchForm, find_candidates, resolve};
use fringeflow::phase::{Validity, decode};

use super::bench::{Bench, Measured, STEPS};
use super::clock::{contender, interleave};
use super::cloud::images_to_cloud;
use super::line::{Report, Time, Wanted};
use super::profile::PaperGates;
use super::scalar_paper::{Limits, Tables};
use super::scenes::{Workers, shifts, shifts_rad};

/// How many times faster, and the share of the pixels by which the accepted sets may differ, percent.
const WANTED: f64 = 35.0;
const DIFFERENT_PERCENT: f64 = 0.1;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let easy = bench.easy();
    let mut workers = Workers::with_table(&easy.scene, Arc::clone(&easy.table), STEPS, ResolutionMethod::Paper);
    _ = workers.cloud(0, &easy.images.levels());
    let (gates, settings) = (PaperGates::of(&workers), Default::default());
    let limits = Limits::of(&workers.found.matches.delta, &gates.readmission, easy.scene.size_px[0]);
    let tables = Tables::of(&easy.scene.rig.calibrated, &easy.table);
    let bytes =
        easy.images.cameras.each_ref().map(|images| images.iter().map(|i| i.pixels.as_slice()).collect::<Vec<_>>());
    let images = [bytes[0].as_slice(), bytes[1].as_slice()];
    let accepted = tables.reconstruct(images, &shifts_rad(STEPS), &limits);
    let plain = || decoded(&easy);
    let spent = interleave(
        bench.repetitions.min(5),
        &mut [
            images_to_cloud(&mut workers, &easy),
            contender(|| drop(black_box(tables.reconstruct(images, &shifts_rad(STEPS), &limits).points_m))),
            contender(|| {
                let [cam1, cam2] = plain();
                let cam2 = EpipolarImage::resample(&cam2, &easy.table).unwrap();
                let found = find_candidates(&cam1, &cam2, &easy.table, &gates.readmission, SearchForm::PlainScan);
                _ = black_box(resolve(gates.evidence(&cam1, &easy.table), found, &settings));
            }),
        ],
    );
    let name = "images → cloud, paper's method, against its scalar transcription, easy";
    report.ratio(name, &spent[1], &spent[0], Time::Cpu, Wanted::AtLeast(WANTED));
    let name = "images → resolution with the library's plain scan instead, easy";
    report.ratio(name, &spent[2], &spent[0], Time::Cpu, Wanted::AtLeast(1.0));
    let ours = &workers.found.matches;
    let differ = accepted.chosen.iter().enumerate().filter(|(pixel, other)| match (ours.candidate(*pixel), other) {
        (Some(a), Some(b)) => i32::from(a.order) != b.order,
        (a, b) => a.is_some() != b.is_some(),
    });
    let percent = 100.0 * differ.count() as f64 / ours.outcomes.len() as f64;
    let points = [workers.points.points.len(), accepted.points_m.len()].map(|points| format!("{points}"));
    let name = "pixels that only one of both accepts, or with another order, %";
    report.figure(name, points, percent, &[], Wanted::AtMost(DIFFERENT_PERCENT));
}

/// Phase maps of both cameras.
fn decoded(measured: &Measured) -> [fringeflow::phase::PhaseMap; 2] {
    let [width, height] = measured.scene.size_px;
    measured.images.levels().map(|l| decode(&l, width, height, &shifts(STEPS), &Validity::default()).unwrap())
}
