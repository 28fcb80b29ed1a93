//! From images to phase maps.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput};

use fringeflow::phase::{
    MotionFit, MotionScratch, PhaseMap, Validity, decode_into, decode_moving_into, usual_extra_images,
};
use fringeflow_base::grey::PixelFormat;

use crate::scenes::{Geometry, Scene, shifts, shifts_rad};

/// Steps for plain decoding, and for decoding with motion.
const STEPS: [usize; 3] = [4, 8, 16];
const MOVING_STEPS: usize = 4;

/// Benchmarks the decoding of one camera.
pub(crate) fn benches(criterion: &mut Criterion, size_px: [usize; 2]) {
    let scene = Scene::new(Geometry::Easy, size_px);
    let ([width, height], validity) = (size_px, Validity::default());
    let mut group = criterion.benchmark_group("decode");
    group.throughput(Throughput::Elements((width * height) as u64));
    for format in [PixelFormat::Grey, PixelFormat::Y12] {
        for steps in STEPS {
            let images = scene.images(steps, format);
            let (levels, shifts) = (&images.levels()[0], shifts(steps));
            group.bench_function(BenchmarkId::new(format.name(), steps), |bencher| {
                let mut map = PhaseMap::default();
                bencher.iter(|| decode_into(&mut map, black_box(levels), width, height, &shifts, &validity));
            });
        }
    }
    let images = scene.moving_images(MOVING_STEPS);
    let window = MOVING_STEPS + usual_extra_images(MOVING_STEPS);
    let cycle = shifts_rad(MOVING_STEPS).into_iter().cycle();
    let fit = MotionFit::new(&cycle.take(window).collect::<Vec<_>>()).unwrap();
    let levels = &images.levels()[0][..window];
    group.bench_function(BenchmarkId::new("moving", MOVING_STEPS), |bencher| {
        let (mut map, mut scratch) = (PhaseMap::default(), MotionScratch::default());
        bencher.iter(|| decode_moving_into(&mut map, &mut scratch, black_box(levels), width, height, &fit, &validity));
    });
    group.finish();
}
