use std::f64::consts::TAU;

use crate::grey::PixelFormat;

use super::*;

const WIDTH: usize = 256;
const HEIGHT: usize = 64;

/// What a pixel shows at a time, images from the centre of the window.
struct Scene {
    /// Phase at the centre.
    phase_rad: fn(usize, usize) -> f64,
    motion_rad: fn(usize, usize) -> f64,
    brightness: fn(usize) -> f64,
    /// Time from which on another, brighter surface is seen.
    changes_at: fn(usize) -> f64,
}

const RESTING: Scene = Scene {
    phase_rad: |u, v| 0.31 * u as f64 + 0.05 * v as f64,
    motion_rad: |_, _| 0.0,
    brightness: |_| 1.0,
    changes_at: |_| f64::INFINITY,
};

impl Scene {
    /// 16-bit images of the scene with N steps, the first of which is `first`.
    fn images(&self, steps: usize, images: usize, first: usize) -> Vec<Vec<u8>> {
        (0..images)
            .map(|i| {
                let (t, shift) = (fit::time(i, images), TAU * ((first + i) % steps) as f64 / steps as f64);
                let grey = |pixel: usize| {
                    let (u, v) = (pixel % WIDTH, pixel / WIDTH);
                    let phase = (self.phase_rad)(u, v) + (self.motion_rad)(u, v) * t + shift;
                    let [mean, modulation] = if t < (self.changes_at)(u) { [100.0, 60.0] } else { [150.0, 90.0] };
                    let phase = if t < (self.changes_at)(u) { phase } else { phase + 2.0 };
                    (self.brightness)(i) * (mean + modulation * phase.cos())
                };
                (0..WIDTH * HEIGHT).flat_map(|pixel| ((grey(pixel) * 256.0).round() as u16).to_le_bytes()).collect()
            })
            .collect()
    }

    fn decoded(&self, steps: usize, images: usize) -> PhaseMap {
        let first = 1;
        let shifts: Vec<f64> = (0..images).map(|i| TAU * ((first + i) % steps) as f64 / steps as f64).collect();
        let bytes = self.images(steps, images, first);
        let levels: Vec<GreyLevels<'_>> =
            bytes.iter().map(|bytes| GreyLevels { format: PixelFormat::Y16, bytes }).collect();
        decode_moving(&levels, WIDTH, HEIGHT, &MotionFit::new(&shifts).unwrap(), &Validity::default()).unwrap()
    }

    fn error_rad(&self, map: &PhaseMap, pixel: usize) -> f64 {
        let off = f64::from(map.phase[pixel]) / 65536.0 * TAU - (self.phase_rad)(pixel % WIDTH, pixel / WIDTH);
        (off + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0
    }

    fn largest_error_rad(&self, map: &PhaseMap) -> f64 {
        let valid = |pixel: &usize| map.valid[*pixel];
        assert!((0..WIDTH * HEIGHT).filter(valid).count() * 50 >= WIDTH * HEIGHT * 49);
        (0..WIDTH * HEIGHT).filter(valid).map(|pixel| self.error_rad(map, pixel).abs()).fold(0.0, f64::max)
    }
}

#[test]
fn a_resting_scene_has_its_phase_and_no_motion() {
    for (steps, images) in [(3, 5), (3, 6), (4, 5), (4, 6), (4, 8), (5, 7), (8, 10), (16, 18)] {
        let map = RESTING.decoded(steps, images);
        assert!(RESTING.largest_error_rad(&map) < 1e-3, "{steps} steps, {images} images");
        let motion = map.motion.unwrap();
        assert!(motion.median_rad.abs() < 0.005 && motion.brightness_share < 1e-3, "{motion:?}");
        assert_eq!((motion.one_surface_pixels, motion.lost_pixels), (0, 0));
        assert!(map.modulation.iter().all(|b| (b.grey() - 60.0).abs() < 0.1) && map.mean.iter().all(|&m| m == 100));
    }
}

#[test]
fn the_ripple_of_a_moving_scene_is_taken_off() {
    for (steps, images, limit_rad) in [(3, 6, 0.02), (4, 6, 0.01), (4, 8, 0.02), (5, 7, 0.01), (8, 10, 0.05)] {
        let moving = Scene { motion_rad: |u, _| 0.1 + 0.3 * u as f64 / WIDTH as f64, ..RESTING };
        let map = moving.decoded(steps, images);
        let error_rad = moving.largest_error_rad(&map);
        assert!(error_rad < limit_rad, "{steps} steps, {images} images: {error_rad}");
        let motion = map.motion.unwrap();
        assert!((motion.median_rad - 0.25).abs() < 0.01 && (motion.fast_rad - 0.385).abs() < 0.015, "{motion:?}");
    }
}

#[test]
fn both_senses_of_motion_are_told_apart() {
    let back = Scene { motion_rad: |_, _| -0.4, ..RESTING };
    let map = back.decoded(4, 6);
    assert!((map.motion.unwrap().median_rad + 0.4).abs() < 0.01, "{:?}", map.motion);
    assert!(back.largest_error_rad(&map) < 0.02);
}

#[test]
fn images_of_different_brightness_are_levelled() {
    // Every second image is brighter: of four steps, what would otherwise add half of that in phase.
    let flicker = |i: usize| [0.97, 1.03][i % 2];
    for motion_rad in [(|_, _| 0.0) as fn(usize, usize) -> f64, |_, _| 0.2] {
        let scene = Scene { brightness: flicker, motion_rad, ..RESTING };
        let map = scene.decoded(4, 6);
        assert!(scene.largest_error_rad(&map) < 0.04, "{}", scene.largest_error_rad(&map));
        let share = map.motion.unwrap().brightness_share;
        assert!((share - 0.03).abs() < 0.015, "{share}");
    }
}

#[test]
fn where_something_moves_across_only_images_of_one_surface_count() {
    // At columns from 20 on the second surface is seen from the last image but one, at 40 from the second.
    let scene = Scene {
        changes_at: |u| match u {
            20..23 => 1.0,
            40..43 => -2.0,
            _ => f64::INFINITY,
        },
        motion_rad: |_, _| 0.1,
        ..RESTING
    };
    let map = scene.decoded(4, 6);
    let motion = map.motion.unwrap();
    assert!(motion.one_surface_pixels >= 6 * HEIGHT as u64, "{motion:?}");
    for pixel in 0..WIDTH * HEIGHT {
        let shift = if (40..43).contains(&(pixel % WIDTH)) { 2.0 } else { 0.0 };
        let error_rad = (scene.error_rad(&map, pixel) - shift).abs();
        assert!(!map.valid[pixel] || error_rad < 0.07, "column {}: {error_rad}", pixel % WIDTH);
    }
}

#[test]
fn saturated_samples_are_left_out() {
    let bright = Scene { brightness: |_| 1.75, motion_rad: |_, _| 0.1, ..RESTING };
    let bytes = bright.images(4, 8, 0);
    let clipped: Vec<Vec<u8>> = bytes
        .iter()
        .map(|bytes| bytes.chunks_exact(2).map(|b| (u16::from_le_bytes([b[0], b[1]]) / 256).min(255) as u8).collect())
        .collect();
    let levels: Vec<GreyLevels<'_>> = clipped.iter().map(|bytes| GreyLevels::eight_bit(bytes)).collect();
    let shifts: Vec<f64> = (0..8).map(|i| TAU * f64::from(i) / 4.0).collect();
    let fit = MotionFit::new(&shifts).unwrap();
    let map = decode_moving(&levels, WIDTH, HEIGHT, &fit, &Validity::default()).unwrap();
    let saturated = clipped.iter().flatten().filter(|&&grey| grey == 255).count();
    assert!(saturated > 100 && bright.largest_error_rad(&map) < 0.05, "{}", bright.largest_error_rad(&map));
}

#[test]
fn the_noise_gain_is_that_of_the_phase() {
    // Of six images with four steps the fit leaves less noise than four images do: √(2/4).
    let shifts: Vec<f64> = (0..6).map(|i| TAU * f64::from(i) / 4.0).collect();
    assert!((MotionFit::new(&shifts).unwrap().noise_gain() - 0.6847).abs() < 1e-3);
}

#[test]
fn windows_that_determine_nothing_are_refused() {
    use crate::phase::ShiftError;
    let refused = |shifts: &[f64]| MotionFit::new(shifts).unwrap_err();
    assert!(matches!(refused(&[0.0, 1.0, 2.0, 3.0]), ShiftError::Window { images: 4, .. }));
    assert!(matches!(refused(&[0.0; 25]), ShiftError::Window { images: 25, .. }));
    assert!(matches!(refused(&[1.0; 6]), ShiftError::Degenerate { .. }));
    assert!(matches!(refused(&[0.0, 1.0, f64::NAN, 3.0, 4.0]), ShiftError::NotFinite { index: 2, .. }));
    let fit = MotionFit::new(&[0.0, 1.5, 3.0, 4.5, 6.0]).unwrap();
    let bytes = [9; 4];
    assert!(decode_moving(&[GreyLevels::eight_bit(&bytes); 4], 2, 2, &fit, &Validity::default()).is_none());
    assert!(decode_moving(&[GreyLevels::eight_bit(&bytes); 5], 3, 2, &fit, &Validity::default()).is_none());
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let moving = Scene { motion_rad: |u, _| 0.01 * u as f64, changes_at: |u| (u % 7) as f64, ..RESTING };
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| moving.decoded(4, 6))
    };
    let (one, three) = (with(1), with(3));
    assert_eq!(one, three);
}

/// Everything that is decoded, of widths that are no whole blocks and of scenes with all that may happen to a pixel; in a room that
/// another window was decoded in.
#[test]
fn all_levels_and_any_room_give_the_same_bits() {
    let scene = Scene {
        motion_rad: |u, v| 0.02 * u as f64 - 1.5 + 0.01 * v as f64,
        changes_at: |u| if u % 19 < 3 { 0.7 } else { f64::INFINITY },
        brightness: |i| 1.2 + 0.02 * (i % 3) as f64,
        ..RESTING
    };
    let mut room = MotionRoom::default();
    for (steps, count, format) in [(4, 6, PixelFormat::Y16), (3, 6, PixelFormat::Grey), (8, 11, PixelFormat::Grey)] {
        let bytes = scene.images(steps, count, 0);
        let eighth = |image: &Vec<u8>| image.chunks_exact(2).map(|b| b[1]).collect::<Vec<u8>>();
        let bytes: Vec<Vec<u8>> = if format == PixelFormat::Grey { bytes.iter().map(eighth).collect() } else { bytes };
        let shifts: Vec<f64> = (0..count).map(|i| TAU * (i % steps) as f64 / steps as f64).collect();
        let fit = MotionFit::new(&shifts).unwrap();
        for (width, height) in [(WIDTH, HEIGHT), (77, 90), (31, 3), (1, 40)] {
            let used = width * height * format.bytes();
            let levels: Vec<GreyLevels<'_>> =
                bytes.iter().map(|bytes| GreyLevels { format, bytes: &bytes[..used] }).collect();
            let maps = Level::ALL.map(|level| {
                let mut map = PhaseMap::default();
                let size = [width, height];
                decode_at(level, &mut map, &mut room, &levels, size, &fit, &Validity::default()).unwrap();
                map
            });
            assert_eq!(maps[0], maps[1], "{steps} {count} {width}");
            assert_eq!(maps[1], maps[2], "{steps} {count} {width}");
            let fresh = decode_moving(&levels, width, height, &fit, &Validity::default());
            assert_eq!(Some(&maps[2]), fresh.as_ref());
        }
    }
}
