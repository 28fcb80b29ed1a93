//! From phase maps to correspondences and points, step by step.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, Throughput};

use fringeflow::cloud::Cloud;
use fringeflow::correspondence::{
    Drift, EpipolarImage, MatchSettings, Matcher, Matches, ResolutionMethod, SegmentTable, find_candidates,
    find_unique_candidates, match_phases,
};
use fringeflow::phase::{Validity, decode};
use fringeflow::worker::{CloudWorker, Correspondences};
use fringeflow_base::grey::PixelFormat;

use crate::scenes::{Geometry, Scene, ambiguous_share, shifts};

const STEPS: usize = 4;

/// Benchmarks each step from the phase maps to the cloud.
pub(crate) fn benches(criterion: &mut Criterion, size_px: [usize; 2]) {
    for geometry in [Geometry::Easy, Geometry::Hard] {
        bench_geometry(criterion, &Scene::new(geometry, size_px));
    }
}

fn bench_geometry(criterion: &mut Criterion, scene: &Scene) {
    let ([width, height], table) = (scene.size_px, Arc::new(scene.table()));
    let images = scene.images(STEPS, PixelFormat::Grey);
    let [cam1, cam2] =
        images.levels().map(|levels| decode(&levels, width, height, &shifts(STEPS), &Validity::default()).unwrap());
    let settings_for = |method| MatchSettings { method, ..MatchSettings::default() };
    let settings = settings_for(ResolutionMethod::Paper);
    let matches = match_phases(&cam1, &cam2, &table, &settings).unwrap();
    println!(
        "{:?}: {:.1} % of the pixels with candidates have several",
        scene.geometry,
        100.0 * ambiguous_share(&matches)
    );
    let mut group = criterion.benchmark_group(format!("correspondence/{:?}", scene.geometry));
    group.throughput(Throughput::Elements((width * height) as u64));
    group.bench_function("segment table", |bencher| {
        let rig = &scene.rig;
        bencher.iter(|| SegmentTable::build(black_box(&rig.calibrated), &rig.volume, &rig.columns));
    });
    group.bench_function("resampling", |bencher| {
        bencher.iter(|| EpipolarImage::resample(black_box(&cam2), &table));
    });
    let (image, gate) = (EpipolarImage::resample(&cam2, &table).unwrap(), matches.delta.gate());
    group.bench_function(BenchmarkId::new("candidates", "all"), |bencher| {
        bencher.iter(|| find_candidates(black_box(&cam1), &image, &table, &gate));
    });
    group.bench_function(BenchmarkId::new("candidates", "of pixels with one"), |bencher| {
        bencher.iter(|| find_unique_candidates(black_box(&cam1), &image, &table, &gate));
    });
    for method in ResolutionMethod::ALL {
        group.bench_function(BenchmarkId::new("match", method.name()), |bencher| {
            let (mut matcher, mut matches) = (Matcher::default(), Matches::default());
            bencher.iter(|| {
                matcher.match_phases(black_box(&cam1), &cam2, &table, (&settings_for(method), None), &mut matches)
            });
        });
    }
    let found = Correspondences {
        drift: matches.drift.as_ref().map(Drift::to_known),
        width,
        matches,
        mean: cam1.mean.clone(),
        modulation: cam1.modulation.clone(),
        phase_noise_grey: [&cam1, &cam2].map(|map| map.fit.noise_grey * map.fit.noise_gain),
    };
    let (mut worker, mut cloud) =
        (CloudWorker::new(&scene.rig.calibrated, Arc::clone(&table)).unwrap(), Cloud::default());
    group.bench_function("triangulation", |bencher| bencher.iter(|| worker.step(black_box(&found), &mut cloud)));
    group.finish();
}
