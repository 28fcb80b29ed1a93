//! The whole chain: from 2 × 4 images to a cloud, by the three workers in one thread.

use std::hint::black_box;

use criterion::{Criterion, Throughput};

use fringeflow_base::grey::PixelFormat;

use crate::scenes::{Geometry, Scene, Workers};

const STEPS: usize = 4;

/// Benchmarks images to cloud in both geometries.
pub(crate) fn benches(criterion: &mut Criterion, size_px: [usize; 2]) {
    let mut group = criterion.benchmark_group("images to cloud");
    group.throughput(Throughput::Elements((size_px[0] * size_px[1]) as u64));
    for geometry in [Geometry::Easy, Geometry::Hard] {
        let scene = Scene::new(geometry, size_px);
        let images = scene.images(STEPS, PixelFormat::Grey);
        let mut workers = Workers::new(&scene, STEPS);
        group.bench_function(format!("{geometry:?}"), |bencher| {
            let levels = images.levels();
            bencher.iter(|| workers.cloud(0, black_box(&levels)).points.len());
        });
    }
    group.finish();
}
