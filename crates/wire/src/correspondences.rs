//! Correspondences of all pixels of C1.
//!
//! Planes: column of q in the epipolar frame `f32`, modulation `u16`, fringe order `i16`, δ `i16` (turns · 65536),
//! slope of the phase `i16` (turns · 65536 per column), confidence `u16` (probability · 65535), outcome `u8`, number of
//! candidates that passed the back-projection test `u8`, mean `u8`. Column, order, δ, slope and confidence are zero for
//! pixels without a correspondence.

use fringeflow::cloud::TriangulationInput;
use fringeflow::correspondence::{Matches, Outcome};
use fringeflow::worker::Correspondences;
use fringeflow_message::{Block, CorrespondenceHeader, DELTA_PARTS, Window};

use super::planes::{blocks_of, copy, next_plane, next_plane_mut};
use super::{WireError, checked_pixels, drift};

/// Number of blocks of the payload for images of `pixels` pixels.
#[must_use]
pub const fn blocks(pixels: usize) -> usize {
    blocks_of::<f32>(pixels) + 5 * blocks_of::<i16>(pixels) + 3 * blocks_of::<u8>(pixels)
}

/// Creates the header of the correspondences computed from `window`.
#[must_use]
pub fn header(found: &Correspondences, window: &Window, published: u64) -> CorrespondenceHeader {
    let delta = &found.matches.delta;
    let (chosen_delta_mean_rad, chosen_delta_sd_rad) = found.matches.chosen_delta_rad;
    CorrespondenceHeader {
        published,
        window: *window,
        delta_mean_rad: delta.mean_rad,
        delta_sd_rad: delta.sd_rad,
        delta_noise_sd_rad: delta.noise_sd_rad,
        mean_periods: delta.mean_periods,
        references: delta.references as u64,
        chosen_delta_mean_rad,
        chosen_delta_sd_rad,
        delta_counts: delta_counts(&found.matches),
        phase_noise_grey: found.phase_noise_grey,
        drift: drift::numbers(found.drift.as_ref()),
        width_px: found.width as u32,
        height_px: (found.mean.len() / found.width.max(1)) as u32,
    }
}

/// Returns the histogram of δ for a header; missing bins are zero.
pub(super) fn delta_counts(matches: &Matches) -> [u32; DELTA_PARTS] {
    std::array::from_fn(|part| matches.delta_counts.get(part).copied().unwrap_or(0))
}

/// Writes correspondences into a payload of [`blocks`] blocks.
pub fn write(found: &Correspondences, mut out: &mut [Block]) {
    let matches = &found.matches;
    let pixels = matches.outcomes.len();
    let out = &mut out;
    copy(&matches.chosen.column_px, next_plane_mut(out, pixels));
    copy(&found.modulation, next_plane_mut(out, pixels));
    for plane in [&matches.chosen.order, &matches.chosen.delta, &matches.chosen.slope] {
        copy(plane, next_plane_mut(out, pixels));
    }
    copy(&matches.confidence, next_plane_mut(out, pixels));
    copy::<u8>(bytemuck::cast_slice(&matches.outcomes), next_plane_mut(out, pixels));
    copy(&matches.passing, next_plane_mut(out, pixels));
    copy(&found.mean, next_plane_mut(out, pixels));
}

/// Borrows correspondences from a payload, for triangulation.
///
/// # Errors
/// [`WireError`].
pub fn view<'a>(header: &CorrespondenceHeader, mut rest: &'a [Block]) -> Result<TriangulationInput<'a>, WireError> {
    let pixels = checked_pixels(rest, [header.width_px, header.height_px], blocks)?;
    let column_px = next_plane(&mut rest, pixels);
    let modulation = next_plane(&mut rest, pixels);
    let order = next_plane(&mut rest, pixels);
    let delta = next_plane(&mut rest, pixels);
    let slope = next_plane(&mut rest, pixels);
    let confidence = next_plane(&mut rest, pixels);
    let codes: &[u8] = next_plane(&mut rest, pixels);
    let outcomes = bytemuck::checked::try_cast_slice(codes).map_err(|_| unknown_outcome(codes))?;
    let passing = next_plane(&mut rest, pixels);
    let mean = next_plane(&mut rest, pixels);
    let (width, phase_noise_grey) = (header.width_px as usize, header.phase_noise_grey);
    Ok(TriangulationInput {
        width,
        outcomes,
        column_px,
        order,
        delta,
        slope,
        passing,
        confidence,
        mean,
        modulation,
        phase_noise_grey,
    })
}

/// The first code that is none of an outcome.
fn unknown_outcome(codes: &[u8]) -> WireError {
    let pixel = codes.iter().position(|&code| Outcome::from_code(code).is_none()).unwrap_or_default();
    WireError::Outcome { pixel, code: codes.get(pixel).copied().unwrap_or_default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow::correspondence::{ChosenCandidates, DeltaStatistics, KnownDrift};
    use fringeflow::phase::Modulation;

    fn found() -> Correspondences {
        let outcomes: Vec<Outcome> = (0..35).map(|i| Outcome::ALL[i % Outcome::ALL.len()]).collect();
        let chosen = ChosenCandidates {
            column_px: (0..35).map(|i| i as f32 / 3.0).collect(),
            order: (-7..28).collect(),
            delta: (0..35).map(|i| -i).collect(),
            slope: (0..35).map(|i| 31 * i).collect(),
        };
        let delta =
            DeltaStatistics { mean_rad: 0.1, sd_rad: 0.04, noise_sd_rad: 0.01, mean_periods: 5.5, references: 12 };
        let passing = (0..35).map(|i| i as u8 % 4).collect();
        let delta_counts = (0..DELTA_PARTS as u32).collect();
        let confidence = (0..35_u16).map(|i| bytemuck::cast(i * 1000)).collect();
        let chosen_delta_rad = (0.02, 0.03);
        let matches = Matches {
            outcomes,
            chosen,
            passing,
            confidence,
            delta,
            delta_counts,
            chosen_delta_rad,
            drift: None,
            slip_steps: [0; 2],
        };
        Correspondences {
            drift: KnownDrift::from_numbers([0.25; _]),
            width: 7,
            matches,
            mean: (0..35).collect(),
            modulation: (0..35).map(|i| Modulation::from_grey(i as f32 * 0.7)).collect(),
            phase_noise_grey: [1.5, 2.5],
        }
    }

    #[test]
    fn correspondences_survive_a_round_trip() {
        let found = found();
        let mut payload = vec![Block([0xff; 64]); blocks(35)];
        write(&found, &mut payload);
        let header = header(&found, &Window::default(), 3);
        assert_eq!(view(&header, &payload).unwrap(), found.triangulation_input());
    }

    #[test]
    fn an_unknown_outcome_is_refused() {
        let found = found();
        let mut payload = vec![Block([0; 64]); blocks(35)];
        write(&found, &mut payload);
        let outcomes = blocks_of::<f32>(35) + 5 * blocks_of::<i16>(35);
        payload[outcomes].0[4] = 99;
        let header = header(&found, &Window::default(), 3);
        assert_eq!(view(&header, &payload).unwrap_err(), WireError::Outcome { pixel: 4, code: 99 });
    }
}
