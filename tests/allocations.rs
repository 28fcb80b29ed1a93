//! After warm-up, windows allocate no memory: each reuses the memory of the previous one.

#[path = "../benches/ratios/counting_allocator.rs"]
mod counting_allocator;
#[path = "../benches/scenes/mod.rs"]
#[allow(dead_code, clippy::unwrap_used, clippy::print_stderr, reason = "shared with the benches")]
mod scenes;

use std::sync::Arc;

use fringeflow::phase::usual_extra_images;
use fringeflow_base::grey::{GreyLevels, PixelFormat};

use counting_allocator::{allocated, held};
use scenes::{Geometry, Images, SMALL_PX, Scene, Workers};

#[global_allocator]
static ALLOCATOR: counting_allocator::CountingAllocator = counting_allocator::CountingAllocator;

const STEPS: usize = 4;
/// Windows for warm-up, and windows that are measured.
const WARM_UP: usize = 3;
const MEASURED: usize = 3;

#[test]
fn windows_allocate_nothing_after_warm_up() {
    // Use this thread as the whole pool: handing work to other threads allocates now and then, independently of
    // windows.
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global().unwrap();
    let scene = Scene::new(Geometry::Easy, SMALL_PX);
    let table = Arc::new(scene.table());
    let [resting, moving] = [scene.images(STEPS, PixelFormat::Grey), scene.moving_images(STEPS)];
    for (name, window) in [("resting", resting.levels()), ("moving", moving_window(&moving))] {
        let mut workers = Workers::with_table(&scene, Arc::clone(&table), STEPS);
        assert_eq!(count_allocations(|| _ = workers.cloud(0, &window)), [0, 0], "{name}");
        assert!(workers.points.points.len() > 10_000);
    }

    // Cases that concern only the phase: many saturated samples, images of different brightness, and the check at rest.
    let [bright, flickering] = [bright(resting), flickering(moving)];
    let longer = scene.images(2 * STEPS, PixelFormat::Grey);
    let windows = [
        ("saturated", STEPS, bright.levels()),
        ("flickering", STEPS, moving_window(&flickering)),
        ("checked at rest", 2 * STEPS, longer.levels()),
    ];
    for (name, steps, window) in windows {
        let mut workers = Workers::with_table(&scene, Arc::clone(&table), steps);
        assert_eq!(count_allocations(|| workers.decode(0, &window)), [0, 0], "{name}");
        assert!(workers.maps.cam1.fit.valid_pixels > 10_000, "{name}");
    }
    assert!(saturated_share(&bright.levels()[0]) > 0.1);
}

/// The images of a window with motion compensation.
fn moving_window(images: &Images) -> [Vec<GreyLevels<'_>>; 2] {
    images.levels().map(|levels| levels[..STEPS + usual_extra_images(STEPS)].to_vec())
}

/// The same images, three times as bright.
fn bright(mut images: Images) -> Images {
    let pixels = images.cameras.iter_mut().flatten().flat_map(|image| &mut image.pixels);
    pixels.for_each(|grey| *grey = grey.saturating_mul(3));
    images
}

/// The same images, every third one darker by a fifth.
fn flickering(mut images: Images) -> Images {
    let darkened = images.cameras.iter_mut().flat_map(|images| images.iter_mut().step_by(3));
    darkened.flat_map(|image| &mut image.pixels).for_each(|grey| *grey -= *grey / 5);
    images
}

/// Share of saturated pixels in the first image.
fn saturated_share(levels: &[GreyLevels<'_>]) -> f64 {
    let bytes = levels[0].bytes;
    bytes.iter().filter(|&&grey| grey == u8::MAX).count() as f64 / bytes.len() as f64
}

/// Counts allocations and their bytes over [`MEASURED`] windows, after [`WARM_UP`] others. Checks that the memory held
/// does not grow.
fn count_allocations(mut window: impl FnMut()) -> [u64; 2] {
    (0..WARM_UP).for_each(|_| window());
    let ([calls, bytes], before) = (allocated(), held());
    (0..MEASURED).for_each(|_| window());
    let ([more_calls, more_bytes], after) = (allocated(), held());
    assert_eq!(after, before, "bytes held");
    [more_calls - calls, more_bytes - bytes]
}
