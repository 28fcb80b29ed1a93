//! Draws correct and false points, if the truth is known.

use super::colour::{BACKGROUND, BLUE, GREEN, MUTED, Rgb, SKY_BLUE, VERMILION, YELLOW, mix};
use super::legend::{Entry, with_legend};
use super::picture::Picture;
use crate::evaluation::Judgement;

/// Draws the judgement of each pixel of C1 in colours, with a legend and the shares below.
///
/// False points are drawn 3 × 3 pixels large, since single pixels are hard to see on a screen. The shares count pixels.
/// `judgements` are row by row for an image of `size_px` (width, height).
#[must_use]
pub fn judgement_picture(judgements: &[Judgement], size_px: [usize; 2]) -> Picture {
    let at = |i: usize| judgements.get(i).copied().unwrap_or(Judgement::Nothing);
    let mut picture = Picture::from_fn(size_px, |i| colour(at(i)));
    for i in (0..size_px[0] * size_px[1]).filter(|&i| at(i).is_false()) {
        let [u, v] = [i % size_px[0], i / size_px[0]];
        for v in v.saturating_sub(1)..(v + 2).min(size_px[1]) {
            for u in u.saturating_sub(1)..(u + 2).min(size_px[0]) {
                // Neighbouring false points keep their own colours.
                if !at(v * size_px[0] + u).is_false() {
                    picture.set(u, v, colour(at(i)));
                }
            }
        }
    }
    with_legend(picture, &legend(judgements))
}

fn legend(judgements: &[Judgement]) -> Vec<Entry> {
    let count = |judgement| judgements.iter().filter(|&&j| j == judgement).count();
    let entry = |judgement: Judgement| Entry {
        name: judgement.name().to_owned(),
        colour: colour(judgement),
        share: count(judgement) as f64 / judgements.len().max(1) as f64,
    };
    Judgement::ALL.into_iter().filter(|&j| count(j) > 0).map(entry).collect()
}

/// Muted colours for correct points, bright ones for false points.
fn colour(judgement: Judgement) -> Rgb {
    match judgement {
        Judgement::Nothing => BACKGROUND,
        Judgement::Correct => mix(BACKGROUND, BLUE, 0.6),
        Judgement::Wrong => VERMILION,
        Judgement::Stray => YELLOW,
        Judgement::Tolerated => mix(BACKGROUND, GREEN, 0.6),
        Judgement::Missed => SKY_BLUE,
        Judgement::Unjudged => MUTED,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn false_points_are_visible_and_counted_once() {
        let mut judgements = vec![Judgement::Correct; 100 * 50];
        judgements[20 * 100 + 30] = Judgement::Wrong;
        judgements[49 * 100 + 99] = Judgement::Stray;
        judgements[0] = Judgement::Missed;
        let picture = judgement_picture(&judgements, [100, 50]);
        let drawn = |j: Judgement| picture.pixels()[..5000].iter().filter(|&&p| p == colour(j)).count();
        assert_eq!([drawn(Judgement::Wrong), drawn(Judgement::Stray), drawn(Judgement::Missed)], [9, 4, 1]);
        let entries = legend(&judgements);
        let shares: Vec<_> = entries.iter().map(|e| (e.name.as_str(), (e.share * 5000.0).round())).collect();
        assert_eq!(shares, [("correct", 4997.0), ("wrong", 1.0), ("stray", 1.0), ("missed", 1.0)]);
    }

    #[test]
    fn no_pixels_make_an_empty_legend() {
        assert!(legend(&[]).is_empty());
    }
}
