//! Correspondences of all pixels of C1.
//!
//! Planes: column of q in the epipolar frame `f32`, modulation `u16`, fringe order `i16`, δ `i16` (turns · 65536),
//! slope of the phase `i16` (turns · 65536 per column), confidence `u16` (probability · 65535), outcome `u8`, number of
//! candidates that passed the back-projection test `u8`, mean `u8`. Column, order, δ, slope and confidence are zero for
//! pixels without a correspondence.

use fringeflow::correspondence::{Confidence, DeltaStatistics, Matches, Outcome};
use fringeflow::phase::Modulation;
use fringeflow::worker::Correspondences;
use fringeflow_message::{Block, CorrespondenceHeader, DELTA_PARTS, Window};

use super::planes::{blocks_of, next_plane, next_plane_mut, refill};
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

/// The planes of a payload, in their order.
struct Planes<'a> {
    column_px: &'a [f32],
    modulation: &'a [Modulation],
    order: &'a [i16],
    delta: &'a [i16],
    slope: &'a [i16],
    confidence: &'a [Confidence],
    outcome: &'a [u8],
    passing: &'a [u8],
    mean: &'a [u8],
}

/// Writes correspondences into a payload of [`blocks`] blocks.
pub fn write(found: &Correspondences, mut out: &mut [Block]) {
    let matches = &found.matches;
    let pixels = matches.outcomes.len();
    let out = &mut out;
    next_plane_mut(out, pixels).copy_from_slice(&matches.chosen.column_px);
    next_plane_mut(out, pixels).copy_from_slice(&found.modulation);
    for plane in [&matches.chosen.order, &matches.chosen.delta, &matches.chosen.slope] {
        next_plane_mut(out, pixels).copy_from_slice(plane);
    }
    next_plane_mut(out, pixels).copy_from_slice(&matches.confidence);
    let codes: &mut [u8] = next_plane_mut(out, pixels);
    codes.iter_mut().zip(&matches.outcomes).for_each(|(code, &outcome)| *code = outcome as u8);
    next_plane_mut(out, pixels).copy_from_slice(&matches.passing);
    next_plane_mut(out, pixels).copy_from_slice(&found.mean);
}

/// Reads correspondences from a payload.
///
/// # Errors
/// [`WireError`]; `out` is then unchanged.
pub fn read(header: &CorrespondenceHeader, mut rest: &[Block], out: &mut Correspondences) -> Result<(), WireError> {
    let pixels = checked_pixels(rest, [header.width_px, header.height_px], blocks)?;
    let planes = Planes {
        column_px: next_plane(&mut rest, pixels),
        modulation: next_plane(&mut rest, pixels),
        order: next_plane(&mut rest, pixels),
        delta: next_plane(&mut rest, pixels),
        slope: next_plane(&mut rest, pixels),
        confidence: next_plane(&mut rest, pixels),
        outcome: next_plane(&mut rest, pixels),
        passing: next_plane(&mut rest, pixels),
        mean: next_plane(&mut rest, pixels),
    };
    // A table lookup, because this runs for every pixel.
    let known: [Option<Outcome>; 256] = std::array::from_fn(|code| Outcome::from_code(code as u8));
    let outcome = |&code: &u8| known[usize::from(code)];
    if let Some(pixel) = planes.outcome.iter().position(|code| outcome(code).is_none()) {
        return Err(WireError::Outcome { pixel, code: planes.outcome[pixel] });
    }
    out.width = header.width_px as usize;
    out.phase_noise_grey = header.phase_noise_grey;
    out.drift = drift::read(&header.drift);
    refill(&mut out.mean, planes.mean);
    refill(&mut out.modulation, planes.modulation);
    let matches = &mut out.matches;
    matches.outcomes.clear();
    matches.outcomes.extend(planes.outcome.iter().filter_map(outcome));
    refill(&mut matches.chosen.column_px, planes.column_px);
    refill(&mut matches.chosen.order, planes.order);
    refill(&mut matches.chosen.delta, planes.delta);
    refill(&mut matches.chosen.slope, planes.slope);
    refill(&mut matches.passing, planes.passing);
    refill(&mut matches.confidence, planes.confidence);
    refill(&mut matches.delta_counts, &header.delta_counts);
    matches.delta = statistics(header);
    matches.chosen_delta_rad = (header.chosen_delta_mean_rad, header.chosen_delta_sd_rad);
    Ok(())
}

fn statistics(header: &CorrespondenceHeader) -> DeltaStatistics {
    DeltaStatistics {
        mean_rad: header.delta_mean_rad,
        sd_rad: header.delta_sd_rad,
        noise_sd_rad: header.delta_noise_sd_rad,
        mean_periods: header.mean_periods,
        references: header.references as usize,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow::correspondence::{ChosenCandidates, KnownDrift};

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
        let mut read_back = Correspondences::default();
        read(&header, &payload, &mut read_back).unwrap();
        assert_eq!(read_back, found);
    }

    #[test]
    fn an_unknown_outcome_is_refused() {
        let found = found();
        let mut payload = vec![Block([0; 64]); blocks(35)];
        write(&found, &mut payload);
        let outcomes = blocks_of::<f32>(35) + 5 * blocks_of::<i16>(35);
        payload[outcomes].0[4] = 99;
        let header = header(&found, &Window::default(), 3);
        let refused = read(&header, &payload, &mut Correspondences::default());
        assert_eq!(refused, Err(WireError::Outcome { pixel: 4, code: 99 }));
    }
}
