//! Phase maps of both cameras: per camera phase `u16`, modulation `u16`, mean `u8`, valid `u8` (0 or 1).

use rayon::prelude::*;

use fringeflow::phase::{Exposure, FitStatistics, Harmonics, Modulation, Motion, PhaseMap};
use fringeflow::worker::PhasePair;
use fringeflow_message::{Block, Fit, MapsHeader, Window};

use super::planes::{PIECE_VALUES, blocks_of, copy, next_plane, next_plane_mut, refill};
use super::{WireError, checked_pixels, drift};

/// Number of blocks of the payload for images of `pixels` pixels.
#[must_use]
pub const fn blocks(pixels: usize) -> usize {
    2 * (2 * blocks_of::<u16>(pixels) + 2 * blocks_of::<u8>(pixels))
}

/// Creates the header of the maps computed from `window`. The images of camera 2 started `skew_ns` after those of
/// camera 1.
#[must_use]
pub fn header(maps: &PhasePair, window: &Window, skew_ns: i64, published: u64) -> MapsHeader {
    MapsHeader {
        published,
        window: *window,
        cam1: fit(&maps.cam1),
        cam2: fit(&maps.cam2),
        skew_ns,
        known_drift: drift::numbers(maps.known_drift.as_ref()),
        refused_windows: 0,
        width_px: maps.cam1.width as u32,
        height_px: maps.cam1.height as u32,
    }
}

/// Writes maps of the same size into a payload of [`blocks`] blocks.
pub fn write(maps: &PhasePair, mut out: &mut [Block]) {
    for map in [&maps.cam1, &maps.cam2] {
        let pixels = map.phase.len();
        copy(&map.phase, next_plane_mut(&mut out, pixels));
        copy(&map.modulation, next_plane_mut(&mut out, pixels));
        copy(&map.mean, next_plane_mut(&mut out, pixels));
        copy::<u8>(bytemuck::cast_slice(&map.valid), next_plane_mut(&mut out, pixels));
    }
}

/// The maps of one camera, borrowed from a payload.
#[derive(Clone, Copy, Debug)]
pub struct MapView<'a> {
    /// Wrapped phase, turns · 65536.
    pub phase: &'a [u16],
    /// Modulation.
    pub modulation: &'a [Modulation],
    /// Mean grey level.
    pub mean: &'a [u8],
    /// 1 if the phase is valid, else 0.
    pub valid: &'a [u8],
}

/// Borrows the maps of both cameras from a payload.
///
/// # Errors
/// [`WireError::Length`].
pub fn view<'a>(header: &MapsHeader, mut payload: &'a [Block]) -> Result<[MapView<'a>; 2], WireError> {
    let pixels = checked_pixels(payload, [header.width_px, header.height_px], blocks)?;
    let rest = &mut payload;
    Ok([(); 2].map(|()| MapView {
        phase: next_plane(rest, pixels),
        modulation: next_plane(rest, pixels),
        mean: next_plane(rest, pixels),
        valid: next_plane(rest, pixels),
    }))
}

/// Reads maps from a payload.
///
/// # Errors
/// [`WireError::Length`]; `out` is then unchanged.
pub fn read(header: &MapsHeader, payload: &[Block], out: &mut PhasePair) -> Result<(), WireError> {
    let [cam1, cam2] = view(header, payload)?;
    for (map, view, fit) in [(&mut out.cam1, cam1, &header.cam1), (&mut out.cam2, cam2, &header.cam2)] {
        read_map(map, &view);
        map.width = header.width_px as usize;
        map.height = header.height_px as usize;
        map.fit = statistics(fit);
        map.exposure = exposure(fit);
        map.harmonics = harmonics(fit);
        map.motion = motion(fit);
    }
    out.known_drift = drift::read(&header.known_drift);
    Ok(())
}

fn read_map(map: &mut PhaseMap, view: &MapView<'_>) {
    refill(&mut map.phase, view.phase);
    refill(&mut map.modulation, view.modulation);
    refill(&mut map.mean, view.mean);
    view.valid.par_iter().with_min_len(PIECE_VALUES).map(|&byte| byte != 0).collect_into_vec(&mut map.valid);
}

/// The figures of the map of one camera.
#[must_use]
pub fn fit(map: &PhaseMap) -> Fit {
    let (statistics, exposure, motion) = (&map.fit, &map.exposure, &map.motion);
    let Harmonics { second_share, third_share } = map.harmonics;
    Fit {
        valid_pixels: statistics.valid_pixels,
        residual_share: statistics.residual_share.unwrap_or(-1.0),
        noise_grey: statistics.noise_grey,
        noise_gain: statistics.noise_gain,
        motion_rad: motion.map_or(0.0, |motion| motion.median_rad),
        fast_motion_rad: motion.map_or(-1.0, |motion| motion.fast_rad),
        brightness_share: motion.map_or(0.0, |motion| motion.brightness_share),
        one_surface_pixels: motion.map_or(0, |motion| motion.one_surface_pixels),
        lost_pixels: motion.map_or(0, |motion| motion.lost_pixels),
        lit_pixels: exposure.lit_pixels,
        saturated_pixels: exposure.saturated_pixels,
        dim_pixels: exposure.dim_pixels,
        second_harmonic_share: second_share.unwrap_or(-1.0),
        third_harmonic_share: third_share.unwrap_or(-1.0),
        unlit_share: map.unlit_share() as f32,
        unused_range_share: map.unused_range_share() as f32,
    }
}

fn statistics(fit: &Fit) -> FitStatistics {
    FitStatistics {
        valid_pixels: fit.valid_pixels,
        residual_share: (fit.residual_share >= 0.0).then_some(fit.residual_share),
        noise_grey: fit.noise_grey,
        noise_gain: fit.noise_gain,
    }
}

fn exposure(fit: &Fit) -> Exposure {
    let Fit { lit_pixels, saturated_pixels, dim_pixels, .. } = *fit;
    Exposure { lit_pixels, saturated_pixels, dim_pixels }
}

fn harmonics(fit: &Fit) -> Harmonics {
    let share = |share: f32| (share >= 0.0).then_some(share);
    Harmonics { second_share: share(fit.second_harmonic_share), third_share: share(fit.third_harmonic_share) }
}

fn motion(fit: &Fit) -> Option<Motion> {
    (fit.fast_motion_rad >= 0.0).then_some(Motion {
        median_rad: fit.motion_rad,
        fast_rad: fit.fast_motion_rad,
        brightness_share: fit.brightness_share,
        one_surface_pixels: fit.one_surface_pixels,
        lost_pixels: fit.lost_pixels,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow::correspondence::KnownDrift;

    fn map(width: usize, height: usize, seed: usize) -> PhaseMap {
        let pixels = width * height;
        PhaseMap {
            width,
            height,
            phase: (0..pixels).map(|i| (i * 7919 + seed) as u16).collect(),
            modulation: (0..pixels).map(|i| Modulation::from_grey((i + seed) as f32 / 3.0)).collect(),
            mean: (0..pixels).map(|i| (i + seed) as u8).collect(),
            valid: (0..pixels).map(|i| (i + seed).is_multiple_of(3)).collect(),
            fit: FitStatistics { valid_pixels: 5, residual_share: None, noise_grey: 1.5, noise_gain: 0.7 },
            exposure: Exposure { lit_pixels: 9, saturated_pixels: 2, dim_pixels: 1 },
            harmonics: Harmonics { second_share: Some(0.03), third_share: None },
            motion: Some(Motion { median_rad: -0.1, fast_rad: 0.2, one_surface_pixels: 3, ..Motion::default() }),
        }
    }

    #[test]
    fn maps_survive_a_round_trip() {
        // With 35 pixels no plane ends at the end of a block.
        let maps =
            PhasePair { cam1: map(7, 5, 1), cam2: map(7, 5, 2), known_drift: KnownDrift::from_numbers([0.5; _]) };
        let mut payload = vec![Block([0xff; 64]); blocks(35)];
        write(&maps, &mut payload);
        let header = header(&maps, &Window::default(), 40, 3);
        let mut read_back = PhasePair { cam1: map(3, 3, 0), ..PhasePair::default() };
        read(&header, &payload, &mut read_back).unwrap();
        assert_eq!(read_back, maps);
    }

    #[test]
    fn a_payload_of_another_length_is_refused() {
        let header = MapsHeader { width_px: 7, height_px: 5, ..MapsHeader::default() };
        for length in [0, blocks(35) - 1, blocks(35) + 1] {
            let payload = vec![Block([0; 64]); length];
            let found = read(&header, &payload, &mut PhasePair::default());
            let expected = blocks(35);
            assert_eq!(found, Err(WireError::Length { found: length, expected, width_px: 7, height_px: 5 }));
        }
        let huge = MapsHeader { width_px: u32::MAX, height_px: u32::MAX, ..MapsHeader::default() };
        assert!(read(&huge, &[], &mut PhasePair::default()).is_err());
    }
}
