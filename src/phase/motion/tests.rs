use std::f64::consts::TAU;

use fringeflow_base::grey::PixelFormat;

use super::window::Scene as Known;
use super::*;

const WIDTH: usize = 256;
const HEIGHT: usize = 64;

/// A scene by pixel (column, row).
struct Scene {
    /// Phase at the centre.
    phase_rad: fn(usize, usize) -> f64,
    motion_rad: fn(usize, usize) -> f64,
    brightness: fn(usize) -> f64,
    /// Time from which on another, brighter surface is visible, in images from the centre of the window.
    changes_at: fn(usize) -> f64,
}

const RESTING: Scene = Scene {
    phase_rad: |u, v| 0.31 * u as f64 + 0.05 * v as f64,
    motion_rad: |_, _| 0.0,
    brightness: |_| 1.0,
    changes_at: |_| f64::INFINITY,
};

impl Scene {
    /// 16-bit images of the scene with N steps, starting with step `first`.
    fn images(&self, steps: usize, images: usize, first: usize) -> Vec<Vec<u8>> {
        (0..images)
            .map(|i| {
                let (t, shift) = (image_times::time(i, images), TAU * ((first + i) % steps) as f64 / steps as f64);
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
fn the_ripple_of_a_moving_scene_is_removed() {
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
fn the_sign_of_the_motion_is_measured() {
    let back = Scene { motion_rad: |_, _| -0.4, ..RESTING };
    let map = back.decoded(4, 6);
    assert!((map.motion.unwrap().median_rad + 0.4).abs() < 0.01, "{:?}", map.motion);
    assert!(back.largest_error_rad(&map) < 0.02);
}

#[test]
fn images_of_different_brightness_are_equalized() {
    // Every second image is brighter. Uncompensated, with four steps, half of the difference would appear as phase
    // error.
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
fn only_images_of_one_surface_count_where_an_edge_passes() {
    // The second surface appears in columns 20 to 22 in the last but one image, in columns 40 to 42 in the second.
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
        // Two columns share a motion, also where one of them changes and the other does not.
        assert!(!map.valid[pixel] || error_rad < 0.08, "column {}: {error_rad}", pixel % WIDTH);
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
    // Six images with four steps give less noise than four images, √(2/4).
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

fn flow_of(size_px: [usize; 2], way: impl Fn(usize) -> SurfaceMotion) -> Flow {
    let [columns, rows] = Flow::tile_counts(size_px);
    Flow::new(size_px, (0..columns * rows).map(way).collect()).unwrap()
}

/// A wall of dark and bright bars that moves in its own plane: the fringes stand still, the bars move.
struct Wall {
    velocity_px: f64,
    steps: usize,
}

impl Wall {
    const PERIOD_PX: f64 = 24.0;

    fn phase_rad(u: usize) -> f64 {
        TAU * u as f64 / Self::PERIOD_PX
    }

    fn shifts_rad(&self) -> Vec<f64> {
        (0..self.steps + 2).map(|i| TAU * i as f64 / self.steps as f64).collect()
    }

    fn images(&self) -> Vec<Vec<u8>> {
        let shifts = self.shifts_rad();
        let images = shifts.len();
        let grey = |i: usize, u: usize| {
            let bar = ((u as f64 - self.velocity_px * image_times::time(i, images)) / 3.0).sin();
            let albedo = 0.6 + 0.35 * bar;
            albedo * (110.0 + 80.0 * (Self::phase_rad(u) + shifts[i]).cos())
        };
        (0..images).map(|i| (0..WIDTH * HEIGHT).map(|pixel| grey(i, pixel % WIDTH).round() as u8).collect()).collect()
    }

    /// Root mean square error of the phase, without pixels whose path leaves the image.
    fn error_rad(&self, flow: Option<&Flow>) -> f64 {
        let bytes = self.images();
        let levels: Vec<GreyLevels<'_>> = bytes.iter().map(|bytes| GreyLevels::eight_bit(bytes)).collect();
        let mut fits = MotionFits::new(&self.shifts_rad()).unwrap();
        let (mut map, mut scratch, size) = (PhaseMap::default(), MotionScratch::default(), [WIDTH, HEIGHT]);
        match flow {
            Some(flow) => {
                decode_following_into(&mut map, &mut scratch, &levels, size, (&mut fits, flow), &Validity::default())
            }
            None => {
                decode_moving_into(&mut map, &mut scratch, &levels, WIDTH, HEIGHT, fits.resting(), &Validity::default())
            }
        }
        .unwrap();
        let inner = |pixel: &usize| map.valid[*pixel] && (32..WIDTH - 32).contains(&(pixel % WIDTH));
        let square = |pixel: usize| {
            let off = f64::from(map.phase[pixel]) / 65536.0 * TAU - Self::phase_rad(pixel % WIDTH);
            ((off + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0).powi(2)
        };
        let pixels: Vec<usize> = (0..WIDTH * HEIGHT).filter(inner).collect();
        assert!(pixels.len() * 10 > (WIDTH - 64) * HEIGHT * 9, "{} pixels", pixels.len());
        (pixels.iter().map(|&pixel| square(pixel)).sum::<f64>() / pixels.len() as f64).sqrt()
    }
}

#[test]
fn following_a_surface_removes_the_effect_of_its_texture_and_a_wrong_flow_does_no_harm() {
    let way = |velocity_px: f32| {
        let motion_rad = (TAU / Wall::PERIOD_PX) as f32 * velocity_px;
        flow_of([WIDTH, HEIGHT], |_| SurfaceMotion { velocity_px: [velocity_px, 0.0], motion_rad })
    };
    // Long windows as well: they can measure less motion for each image.
    for (steps, velocity_px) in [(4, 2.0), (16, 0.7)] {
        let wall = Wall { velocity_px, steps };
        let error_of = |share: f64| wall.error_rad(Some(&way((share * velocity_px) as f32)));
        let (alone, followed, half) = (wall.error_rad(None), error_of(1.0), error_of(0.5));
        assert!(followed < 0.007 && followed * 4.0 < alone, "{followed} rad where it is followed, {alone} rad alone");
        assert!(half < 1.1 * alone, "{half} rad where half of it is followed, {alone} rad alone");
    }
    let wall = Wall { velocity_px: 2.0, steps: 4 };
    let alone = wall.error_rad(None);
    // Wrong flows: wrong phase motion, too fast to stay in the image, not a motion at all, and moving with the fringes.
    let wrong = |velocity_px: [f32; 2], motion_rad: f32| {
        wall.error_rad(Some(&flow_of([WIDTH, HEIGHT], |_| SurfaceMotion { velocity_px, motion_rad })))
    };
    for (velocity_px, motion_rad) in [([0.0, 0.0], 0.9), ([9.0, -30.0], 0.4), ([500.0, 1e6], 1e9), ([3.0, 0.0], -1.57)]
    {
        let error_rad = wrong(velocity_px, motion_rad);
        assert!(error_rad < 1.1 * alone, "{velocity_px:?} {motion_rad}: {error_rad} rad, {alone} rad alone");
    }
}

#[test]
fn flows_that_are_not_finite_or_of_another_size_are_refused() {
    let tile = SurfaceMotion { velocity_px: [0.0, f32::NAN], motion_rad: 0.0 };
    assert_eq!(Flow::new([64, 32], vec![tile; 2]), None);
    assert_eq!(Flow::new([64, 32], vec![SurfaceMotion::default(); 3]), None);
    let flow = Flow::new([64, 32], vec![SurfaceMotion::default(); 2]).unwrap();
    let bytes = [9; 96 * 32];
    let mut fits = MotionFits::new(&[0.0, 1.5, 3.0, 4.5, 6.0]).unwrap();
    let images = [GreyLevels::eight_bit(&bytes); 5];
    let (mut map, mut scratch) = (PhaseMap::default(), MotionScratch::default());
    let decoded =
        decode_following_into(&mut map, &mut scratch, &images, [96, 32], (&mut fits, &flow), &Validity::default());
    assert!(decoded.is_none());
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

/// Compares complete maps, for widths that are not whole blocks and scenes with all kinds of pixels, with used scratch
/// memory.
#[test]
fn all_levels_and_any_scratch_memory_give_the_same_bits() {
    let scene = Scene {
        motion_rad: |u, v| 0.02 * u as f64 - 1.5 + 0.01 * v as f64,
        changes_at: |u| if u % 19 < 3 { 0.7 } else { f64::INFINITY },
        brightness: |i| 1.2 + 0.02 * (i % 3) as f64,
        ..RESTING
    };
    let mut scratch = MotionScratch::default();
    type Way = fn(usize) -> SurfaceMotion;
    let ways: [Option<Way>; 2] = [
        None,
        // Paths of all lengths: some leave the image, some cannot be followed.
        Some(|tile| SurfaceMotion {
            velocity_px: [tile as f32 * 1.3 - 2.0, 0.7 - tile as f32 * 0.4],
            motion_rad: tile as f32 * 0.3 - 1.0,
        }),
    ];
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
            for way in ways {
                let flow = way.map(|way| flow_of([width, height], way));
                let decoded = |level, scratch: &mut MotionScratch| {
                    let mut map = PhaseMap::default();
                    let (size, mut fits) = ([width, height], MotionFits::new(&shifts).unwrap());
                    let scene = match &flow {
                        Some(flow) => Known::Followed(&mut fits, flow),
                        None => Known::Unknown(&fit),
                    };
                    decode_at(level, &mut map, scratch, &levels, size, scene, &Validity::default()).unwrap();
                    map
                };
                let maps = Level::ALL.map(|level| decoded(level, &mut scratch));
                assert_eq!(maps[0], maps[1], "{steps} {count} {width}");
                assert_eq!(maps[1], maps[2], "{steps} {count} {width}");
                assert_eq!(maps[2], decoded(Level::in_use(), &mut MotionScratch::default()));
            }
        }
    }
}
