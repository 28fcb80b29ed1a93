//! Draws the outcome of each pixel.

use fringeflow::correspondence::{Outcome, OutcomeCounts};

use super::colour::{BACKGROUND, BLUE, GREEN, INK, INVALID, MUTED, ORANGE, PURPLE, Rgb, SKY_BLUE, VERMILION, YELLOW};
use super::legend::{Entry, with_legend};
use super::picture::Picture;

/// Draws the outcome of each pixel of C1 in colours, with a legend of the outcomes that occur and their shares below.
///
/// `outcomes` are row by row for an image of `size_px` (width, height). Pixels without an outcome stay dark.
#[must_use]
pub fn outcome_picture(outcomes: &[Outcome], size_px: [usize; 2]) -> Picture {
    let picture = Picture::from_fn(size_px, |i| outcomes.get(i).map_or(BACKGROUND, |&o| colour(o)));
    with_legend(picture, &legend(outcomes))
}

fn legend(outcomes: &[Outcome]) -> Vec<Entry> {
    let occurring = OutcomeCounts::from_outcomes(outcomes);
    let occurring = occurring.iter().filter(|&(_, count)| count > 0);
    let entry = |(outcome, count): (Outcome, u64)| Entry {
        name: outcome.name().replace('_', " "),
        colour: colour(outcome),
        share: count as f64 / outcomes.len() as f64,
    };
    occurring.map(entry).collect()
}

/// Cool colours for easy decisions, yellow for decisions by neighbours across the epipolar lines, warm colours for
/// rejections.
fn colour(outcome: Outcome) -> Rgb {
    match outcome {
        Outcome::GrayCode => INK,
        Outcome::Reference => BLUE,
        Outcome::Unique => SKY_BLUE,
        Outcome::AlongEpipolar => GREEN,
        Outcome::AcrossEpipolar => YELLOW,
        Outcome::Invalid => BACKGROUND,
        Outcome::OutsideVolume => INVALID,
        Outcome::NoCandidate => MUTED,
        Outcome::RejectedByDelta => ORANGE,
        Outcome::Ambiguous => PURPLE,
        Outcome::Contradicted => VERMILION,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preview::font::can_draw;

    #[test]
    fn the_legend_lists_the_outcomes_with_their_shares() {
        let outcomes = [[Outcome::Reference; 3].as_slice(), &[Outcome::RejectedByDelta]].concat();
        let entries = legend(&outcomes);
        let named: Vec<_> = entries.iter().map(|e| (e.name.as_str(), e.share)).collect();
        assert_eq!(named, [("reference", 0.75), ("rejected by delta", 0.25)]);
        assert!(legend(&Outcome::ALL).iter().all(|e| can_draw(&e.name)));
    }

    #[test]
    fn pixels_have_the_colour_of_their_outcome_and_the_legend_lies_below() {
        let size = [200, 30];
        let outcomes: Vec<Outcome> = (0..200 * 30).map(|i| Outcome::ALL[i % 11]).collect();
        let picture = outcome_picture(&outcomes, size);
        for (pixel, &outcome) in picture.pixels().iter().zip(&outcomes) {
            assert_eq!(*pixel, colour(outcome));
        }
        let [width, height] = picture.size_px();
        assert_eq!(width, 200);
        let below = &picture.pixels()[200 * 30..width * height];
        assert!(Outcome::ALL.iter().all(|&o| below.contains(&colour(o))));
    }

    #[test]
    fn colours_differ() {
        for (i, &a) in Outcome::ALL.iter().enumerate() {
            assert!(Outcome::ALL[..i].iter().all(|&b| colour(a) != colour(b)), "{a:?}");
        }
    }
}
