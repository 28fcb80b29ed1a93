use std::f64::consts::TAU;

use fringeflow_base::limits::MIN_STEPS;

use crate::phase::map::{Exposure, FitStatistics, Modulation};

use super::*;

/// One-row images of a ramp of phases with offset 100 and modulation 60, times `gain`; one per shift.
fn ramp(shifts_rad: &[f64], gain: f64, pixels: usize) -> Vec<Vec<u8>> {
    let grey = |i: usize, s: f64| gain * (100.0 + 60.0 * (phase_of(i, pixels) + s).cos());
    shifts_rad.iter().map(|&s| (0..pixels).map(|i| grey(i, s).round() as u8).collect()).collect()
}

fn phase_of(i: usize, pixels: usize) -> f64 {
    TAU * i as f64 / pixels as f64
}

fn decode_rows(rows: &[Vec<u8>], shifts_rad: &[f64]) -> PhaseMap {
    let images: Vec<GreyLevels<'_>> = rows.iter().map(|row| GreyLevels::eight_bit(row)).collect();
    let shifts = PhaseShifts::new(shifts_rad).unwrap();
    decode(&images, rows[0].len(), 1, &shifts, &Validity::default()).unwrap()
}

/// Decodes deeper images; `value` converts a grey level, which need not be whole, to a sample.
fn decode_deep(
    format: PixelFormat,
    rows: &[Vec<f64>],
    shifts_rad: &[f64],
    value: impl Fn(f64) -> u16,
    validity: &Validity,
) -> PhaseMap {
    let bytes = |row: &Vec<f64>| row.iter().flat_map(|&grey| value(grey).to_le_bytes()).collect::<Vec<u8>>();
    let rows: Vec<Vec<u8>> = rows.iter().map(bytes).collect();
    let images: Vec<GreyLevels<'_>> = rows.iter().map(|bytes| GreyLevels { format, bytes }).collect();
    decode(&images, images[0].pixels(), 1, &PhaseShifts::new(shifts_rad).unwrap(), validity).unwrap()
}

fn largest_error_rad(map: &PhaseMap) -> f64 {
    let error = |i: usize| {
        let off = f64::from(map.phase[i]) / 65536.0 * TAU - phase_of(i, map.width);
        (off + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0
    };
    (0..map.width).map(|i| error(i).abs()).fold(0.0, f64::max)
}

#[test]
fn any_known_shifts_give_back_the_phase() {
    let mut sequences: Vec<Vec<f64>> =
        (MIN_STEPS..=MAX_STEPS).map(|n| (0..n).map(|k| TAU * k as f64 / n as f64).collect()).collect();
    sequences.push(vec![0.0, 1.4, 3.3, 4.6]);
    sequences.push(vec![-0.2, 0.9, 2.0, 2.9, 4.4, 5.0, 11.0]);
    for shifts in sequences {
        let map = decode_rows(&ramp(&shifts, 1.0, 1500), &shifts);
        // Rounding moves each grey level by at most 0.5 of 60; its worst case over all samples bounds the phase.
        assert!(largest_error_rad(&map) < 0.02, "{shifts:?}: {}", largest_error_rad(&map));
        assert!(map.modulation.iter().all(|b| (b.grey() - 60.0).abs() < 1.2));
        assert!(map.valid.iter().all(|&v| v));
    }
}

#[test]
fn saturated_samples_are_left_out() {
    let shifts: Vec<f64> = (0..8).map(|k| TAU * f64::from(k) / 8.0).collect();
    // Peaks of 1.8·160 = 288 are clipped by the cast to 255.
    let map = decode_rows(&ramp(&shifts, 1.8, 1000), &shifts);
    assert!(largest_error_rad(&map) < 0.02);
    assert!(map.valid.iter().all(|&v| v));
}

#[test]
fn pixels_without_a_sinusoid_are_invalid() {
    let shifts: Vec<f64> = (0..6).map(|k| TAU * f64::from(k) / 6.0).collect();
    let dark = vec![vec![10_u8; 4]; 6];
    assert!(decode_rows(&dark, &shifts).valid.iter().all(|&v| !v));
    let spike: Vec<Vec<u8>> = [0, 0, 200, 0, 200, 200].iter().map(|&g| vec![g; 4]).collect();
    assert!(decode_rows(&spike, &shifts).valid.iter().all(|&v| !v));
    let white = vec![vec![255_u8; 4]; 6];
    assert!(decode_rows(&white, &shifts).valid.iter().all(|&v| !v));
}

#[test]
fn the_noise_is_measured() {
    let shifts: Vec<f64> = (0..8).map(|k| TAU * f64::from(k) / 8.0).collect();
    let mut rows = ramp(&shifts, 1.0, 20_000);
    // Twelve coin tosses per sample: nearly normal, standard deviation √3.
    let mut state = 1_u32;
    for grey in rows.iter_mut().flatten() {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *grey = *grey + (state >> 20).count_ones() as u8 - 6;
    }
    let fit = decode_rows(&rows, &shifts).fit;
    assert!((fit.noise_grey - 3.0_f32.sqrt()).abs() < 0.1, "{}", fit.noise_grey);
    assert!((fit.residual_share.unwrap() - 0.029).abs() < 0.003);
}

#[test]
fn eight_bits_in_the_high_bits_of_more_are_the_same_image() {
    for (steps, gain) in [(4, 1.0), (8, 1.8), (16, 1.4)] {
        let shifts: Vec<f64> = (0..steps).map(|k| TAU * f64::from(k) / f64::from(steps)).collect();
        // Gains above 1.5 saturate.
        let rows = ramp(&shifts, gain, 1500);
        let greys: Vec<Vec<f64>> = rows.iter().map(|row| row.iter().map(|&g| f64::from(g)).collect()).collect();
        for saturation_grey in [255, 200] {
            let validity = Validity { saturation_grey, ..Validity::default() };
            let images: Vec<GreyLevels<'_>> = rows.iter().map(|row| GreyLevels::eight_bit(row)).collect();
            let map = decode(&images, 1500, 1, &PhaseShifts::new(&shifts).unwrap(), &validity).unwrap();
            for format in [PixelFormat::Y10, PixelFormat::Y12, PixelFormat::Y14, PixelFormat::Y16] {
                let shifted = |grey| (grey as u16) << (format.bits() - 8);
                let deep = decode_deep(format, &greys, &shifts, shifted, &validity);
                // The lower limit of the noise, the rounding, depends on the bits.
                let noise_grey = map.fit.noise_grey;
                assert!(deep.fit.noise_grey <= noise_grey);
                let fit = FitStatistics { noise_grey, ..deep.fit };
                assert_eq!(PhaseMap { fit, ..deep }, map, "{steps} steps, gain {gain}, {format:?}");
            }
        }
    }
}

#[test]
fn deeper_images_have_finer_phases() {
    let shifts: Vec<f64> = (0..4).map(|k| TAU * f64::from(k) / 4.0).collect();
    let grey = |i: usize, s: f64| 100.0 + 6.0 * (phase_of(i, 3000) + s).cos();
    let greys: Vec<Vec<f64>> = shifts.iter().map(|&s| (0..3000).map(|i| grey(i, s)).collect()).collect();
    let mut limit_rad = 0.12;
    for format in [PixelFormat::Y10, PixelFormat::Y12, PixelFormat::Y14] {
        let round = |grey: f64| (grey / f64::from(format.grey_per_value())).round() as u16;
        let map = decode_deep(format, &greys, &shifts, round, &Validity::default());
        // Samples are rounded by up to half a value, at a modulation of 6 grey levels; the phase has steps of 1e-4.
        limit_rad /= 4.0;
        assert!(largest_error_rad(&map) < limit_rad + 2e-4, "{format:?}: {}", largest_error_rad(&map));
        assert!(map.modulation.iter().all(|b| (b.grey() - 6.0).abs() < 0.2) && map.mean.iter().all(|&m| m == 100));
        assert!((map.fit.noise_grey - 0.288_675 * format.grey_per_value()).abs() < 0.05);
    }
}

#[test]
fn full_scale_of_every_depth_is_saturated() {
    let shifts: Vec<f64> = (0..8).map(|k| TAU * f64::from(k) / 8.0).collect();
    let greys: Vec<Vec<f64>> = shifts
        .iter()
        .map(|&s| (0..1000).map(|i| 1.8 * (100.0 + 60.0 * (phase_of(i, 1000) + s).cos())).collect())
        .collect();
    for format in [PixelFormat::Y10, PixelFormat::Y12, PixelFormat::Y14, PixelFormat::Y16] {
        let clipped = |grey: f64| (grey / f64::from(format.grey_per_value())).min(f64::from(format.max_value())) as u16;
        let map = decode_deep(format, &greys, &shifts, clipped, &Validity::default());
        assert!(largest_error_rad(&map) < 0.02, "{format:?}: {}", largest_error_rad(&map));
        assert!(map.valid.iter().all(|&v| v));
    }
}

#[test]
fn images_of_different_depth_are_refused() {
    let shifts = PhaseShifts::new(&[0.0, 2.0, 4.0]).unwrap();
    let bytes = [9; 8];
    let deep = GreyLevels { format: PixelFormat::Y12, bytes: &bytes };
    let decoded = |images: &[GreyLevels<'_>]| decode(images, 4, 1, &shifts, &Validity::default()).is_some();
    assert!(decoded(&[deep; 3]) && decoded(&[GreyLevels::eight_bit(&bytes[..4]); 3]));
    assert!(!decoded(&[deep, deep, GreyLevels { format: PixelFormat::Y10, ..deep }]));
    assert!(!decoded(&[GreyLevels::eight_bit(&bytes); 3]));
}

/// Compares all results of the kernel for random images.
#[test]
fn all_levels_decode_the_same_bits() {
    const PIXELS: usize = 5 * 32 + 7;
    let mut state = 7_u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 16) as u16
    };
    let mut sequences: Vec<Vec<f64>> =
        [3, 4, 5, 8, 11, 12, 13, 16].map(|n| (0..n).map(|k| TAU * f64::from(k) / f64::from(n) + 0.4).collect()).into();
    sequences.push(vec![0.0, 1.4, 3.3, 4.6]);
    for shifts_rad in sequences {
        let shifts = PhaseShifts::new(&shifts_rad).unwrap();
        for format in [PixelFormat::Grey, PixelFormat::Y10, PixelFormat::Y16] {
            let value = |r: u16| if r.is_multiple_of(5) { format.max_value() } else { r & format.max_value() };
            let images: Vec<Vec<u8>> = (0..shifts.steps())
                .map(|_| (0..PIXELS).flat_map(|_| value(random()).to_le_bytes()[..format.bytes()].to_vec()).collect())
                .collect();
            let maps = Level::ALL.map(|level| decode_at(level, format, &images, &shifts));
            assert!(maps[0].2 == maps[1].2 && maps[0] == maps[1] && maps[1] == maps[2], "{shifts_rad:?} {format:?}");
        }
    }
}

type Planes = (Vec<u16>, Vec<Modulation>, Vec<u8>, Vec<bool>, u64, Exposure);

fn decode_at(level: Level, format: PixelFormat, images: &[Vec<u8>], shifts: &PhaseShifts) -> Planes {
    let pixels = images[0].len() / format.bytes();
    let mut map = PhaseMap::default();
    map.resize(pixels, 1);
    let plan = Plan::new(shifts);
    let PhaseMap { phase, modulation, mean, valid, .. } = &mut map;
    let counts = if format == PixelFormat::Grey {
        let samples: Vec<&[u8]> = images.iter().map(Vec::as_slice).collect();
        let limits = Limits::new::<u8>(format, &Validity::default(), shifts.steps());
        Band { samples: &samples, plan: &plan, limits: &limits, shifts, phase, modulation, mean, valid }.decode(level)
    } else {
        let samples: Vec<&[[u8; 2]]> = images.iter().map(|image| image.as_chunks().0).collect();
        let limits = Limits::new::<[u8; 2]>(format, &Validity::default(), shifts.steps());
        Band { samples: &samples, plan: &plan, limits: &limits, shifts, phase, modulation, mean, valid }.decode(level)
    };
    (map.phase, map.modulation, map.mean, map.valid, counts.valid_pixels, counts.exposure)
}
