//! Draws wrapped phase and modulation.

use fringeflow::phase::{Modulation, PhaseMap};

use super::colour::{INVALID, cyclic_map};
use super::picture::Picture;

/// Share of the pixels that the modulation picture clips to white.
const WHITE_SHARE: f64 = 0.005;

/// Draws the wrapped phase in cyclic colours. Invalid pixels are dark grey.
#[must_use]
pub fn phase_picture(map: &PhaseMap) -> Picture {
    let colours = cyclic_map();
    Picture::from_fn([map.width, map.height], |i| {
        if map.valid[i] { colours[usize::from(map.phase[i] >> 8)] } else { INVALID }
    })
}

/// Draws the modulation in grey: black is zero, white its 99.5th percentile.
#[must_use]
pub fn modulation_picture(map: &PhaseMap) -> Picture {
    let white = upper_percentile(&map.modulation);
    Picture::from_fn([map.width, map.height], |i| {
        // The cast saturates at white.
        [(map.modulation[i].grey() / white * 255.0).round() as u8; 3]
    })
}

fn upper_percentile(modulation: &[Modulation]) -> f32 {
    let mut sorted = modulation.to_vec();
    let rank = ((sorted.len() as f64 * (1.0 - WHITE_SHARE)) as usize).min(sorted.len().saturating_sub(1));
    if sorted.is_empty() {
        return 1.0;
    }
    let (_, white, _) = sorted.select_nth_unstable(rank);
    white.grey().max(f32::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> PhaseMap {
        let count = 40 * 30;
        PhaseMap {
            width: 40,
            height: 30,
            phase: (0..count).map(|i| (i * 997) as u16).collect(),
            modulation: (0..count).map(|i| Modulation::from_grey(i as f32 / 10.0)).collect(),
            mean: vec![0; count],
            valid: (0..count).map(|i| i % 7 != 0).collect(),
            ..PhaseMap::default()
        }
    }

    #[test]
    fn only_invalid_pixels_are_dark_grey() {
        let map = map();
        let picture = phase_picture(&map);
        assert_eq!(picture.size_px(), [40, 30]);
        for (pixel, valid) in picture.pixels().iter().zip(&map.valid) {
            assert_eq!(*pixel == INVALID, !valid);
        }
    }

    #[test]
    fn the_last_phase_looks_like_the_first() {
        let [first, last] = [0, 65535].map(|phase| {
            let map = PhaseMap { width: 1, height: 1, phase: vec![phase], valid: vec![true], ..PhaseMap::default() };
            phase_picture(&map).pixels()[0]
        });
        assert!((0..3).all(|c| first[c].abs_diff(last[c]) <= 6), "{first:?} {last:?}");
    }

    #[test]
    fn modulation_fills_the_greys() {
        let picture = modulation_picture(&map());
        let greys = picture.pixels();
        assert_eq!(greys[0], [0; 3]);
        assert_eq!(greys[1199], [255; 3]);
        assert!((120..=135).contains(&greys[600][0]));
        let none = PhaseMap { width: 2, height: 1, modulation: vec![Modulation::default(); 2], ..PhaseMap::default() };
        assert_eq!(modulation_picture(&none).pixels(), [[0; 3], [0; 3]]);
    }
}
