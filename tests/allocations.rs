//! A window like those before it asks for no memory: whatever it needs is kept from the one before.

#[path = "../benches/ratios/counting_allocator.rs"]
mod counting_allocator;
#[path = "../benches/scenes/mod.rs"]
#[allow(dead_code, clippy::unwrap_used, clippy::print_stderr, reason = "shared with the benches")]
mod scenes;

use std::sync::Arc;

use fringeflow::correspondence::ResolutionMethod;
use fringeflow::grey::PixelFormat;
use fringeflow::phase::{MotionFit, MotionRoom, PhaseMap, Validity, decode_moving_into, usual_extra_images};

use counting_allocator::allocated;
use scenes::{Geometry, SMALL_PX, Scene, Workers, shifts_rad};

#[global_allocator]
static ALLOCATOR: counting_allocator::CountingAllocator = counting_allocator::CountingAllocator;

const STEPS: usize = 4;
/// Windows that warm up, and those that are counted.
const WARM_UP: usize = 3;
const COUNTED: usize = 3;

#[test]
fn windows_ask_for_no_memory_after_warm_up() {
    // This thread is the whole pool: to hand work to others asks for memory now and then, by its own and not by a window.
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global().unwrap();
    let scene = Scene::new(Geometry::Easy, SMALL_PX);
    let table = Arc::new(scene.table());
    let images = scene.images(STEPS, PixelFormat::Grey);
    let window = images.levels();
    for method in ResolutionMethod::ALL {
        let mut workers = Workers::with_table(&scene, Arc::clone(&table), STEPS, method);
        assert_eq!(asked(|| _ = workers.cloud(0, &window)), [0, 0], "{}", method.name());
        assert!(workers.points.points.len() > 10_000);
    }

    // The decoding of moving windows; the check of their sequence, before it, keeps lists of blocks.
    let images = scene.moving_images(STEPS);
    let shifts_rad: Vec<f64> = shifts_rad(STEPS).into_iter().cycle().take(STEPS + usual_extra_images(STEPS)).collect();
    let (fit, validity) = (MotionFit::new(&shifts_rad).unwrap(), Validity::default());
    let (mut map, mut room) = (PhaseMap::default(), MotionRoom::default());
    let [cam1, _] = images.levels();
    let [width, height] = SMALL_PX;
    let mut decode =
        || decode_moving_into(&mut map, &mut room, &cam1[..shifts_rad.len()], width, height, &fit, &validity).unwrap();
    assert_eq!(asked(&mut decode), [0, 0]);
    assert!(map.fit.valid_pixels > 10_000);
}

/// Calls and bytes of some windows, after others.
fn asked(mut window: impl FnMut()) -> [u64; 2] {
    (0..WARM_UP).for_each(|_| window());
    let [calls, bytes] = allocated();
    (0..COUNTED).for_each(|_| window());
    let [more_calls, more_bytes] = allocated();
    [more_calls - calls, more_bytes - bytes]
}
