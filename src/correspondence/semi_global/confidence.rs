//! How likely a candidate is to be true.
//!
//! Every ground speaks for a candidate or against it by a curve, straight between its knots and constant beyond them; the
//! curves add up to the logarithm of the odds (an additive logistic model: Hastie and Tibshirani 1990, "Generalized Additive
//! Models"). Their values were fitted by `examples/fit_confidence.rs` to scenes of the virtual scanner.

use rayon::prelude::*;

use super::super::decay::decay;
use super::grounds::Grounds;
use super::selection::Selected;

/// Number of curves.
const CURVES: usize = 8;

/// How one ground speaks for a candidate.
struct Curve {
    /// What is asked.
    of: fn(&Grounds) -> f32,
    /// Answers at which the curve bends.
    knots: &'static [f32],
    /// What they add to the logarithm of the odds, nats.
    log_odds: &'static [f32],
}

const MODEL: [Curve; CURVES] = [
    Curve {
        of: |g| g.margin_nats,
        knots: &[0.0, 1.0, 2.0, 4.0, 6.0, 8.0, 12.0],
        log_odds: &[-0.80, -0.24, -0.23, -0.31, 0.51, 0.34, 1.11],
    },
    Curve {
        of: |g| g.abs_z,
        knots: &[0.0, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0],
        log_odds: &[0.66, 0.21, 0.15, 0.02, 0.31, -0.17, -0.82],
    },
    Curve {
        of: |g| octaves(g.region_px),
        knots: &[0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 13.0],
        log_odds: &[1.03, 0.48, 0.24, -0.89, -1.50, -0.73, 1.74],
    },
    Curve {
        of: |g| g.region_lead_nats,
        knots: &[0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0],
        log_odds: &[-0.34, 0.43, 0.38, 0.82, 0.53, -0.51, -0.94],
    },
    Curve {
        of: |g| f32::from(g.beside),
        knots: &[0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0],
        log_odds: &[-1.49, 0.00, 0.51, 0.47, 0.43, 0.23, 0.23],
    },
    Curve {
        of: |g| f32::from(g.around),
        knots: &[0.0, 4.0, 8.0, 16.0, 24.0, 36.0, 48.0],
        log_odds: &[-1.16, -0.83, -1.82, -0.20, 0.58, 0.90, 2.91],
    },
    Curve { of: hidden_support, knots: &[0.0, 8.0, 24.0, 48.0, SEEN], log_odds: &[-2.06, 1.91, 0.00, -3.99, 4.52] },
    Curve { of: |g| g.hidden_share, knots: &[0.0, 0.1, 0.3, 0.6, 1.0], log_odds: &[-0.79, 0.78, -0.42, 1.22, -0.42] },
];

/// Stands for a point that C2 sees.
const SEEN: f32 = 49.0;

/// What surrounds a hidden point.
fn hidden_support(grounds: &Grounds) -> f32 {
    if grounds.is_hidden { f32::from(grounds.around) } else { SEEN }
}

/// The logarithm to base 2, straight between its whole values: the same on every machine.
fn octaves(count: u32) -> f32 {
    let whole = count.max(1).ilog2();
    whole as f32 + (count.max(1) as f32 / (1_u32 << whole) as f32 - 1.0)
}

/// Number of values of the model: those of all curves.
pub const CONFIDENCE_TERMS: usize = {
    let (mut sum, mut i) = (0, 0);
    while i < CURVES {
        assert!(MODEL[i].knots.len() == MODEL[i].log_odds.len());
        sum += MODEL[i].knots.len();
        i += 1;
    }
    sum
};

impl Curve {
    /// The knots that an answer lies between, as place of the first and share of the second.
    fn between(&self, grounds: &Grounds) -> (usize, f32) {
        let answer = (self.of)(grounds);
        let last = self.knots.len() - 1;
        let next = self.knots.iter().position(|&knot| knot > answer).unwrap_or(last + 1);
        if next == 0 || next > last {
            return (next.saturating_sub(1), 0.0);
        }
        let [a, b] = [self.knots[next - 1], self.knots[next]];
        (next - 1, (answer - a) / (b - a))
    }
}

impl Grounds {
    /// How far each value of the model counts for these grounds: what a fit of the model weighs.
    #[must_use]
    pub fn terms(&self) -> [f32; CONFIDENCE_TERMS] {
        let mut terms = [0.0; CONFIDENCE_TERMS];
        let mut rest = &mut terms[..];
        for curve in &MODEL {
            let (own, others) = std::mem::take(&mut rest).split_at_mut(curve.knots.len());
            let (place, share) = curve.between(self);
            own[place] = 1.0 - share;
            if share > 0.0 {
                own[place + 1] = share;
            }
            rest = others;
        }
        terms
    }

    /// The logarithm of the odds that the candidate is true, nats.
    fn log_odds(&self) -> f32 {
        let value = |curve: &Curve| {
            let (place, share) = curve.between(self);
            let at = curve.log_odds[place];
            if share > 0.0 { at + share * (curve.log_odds[place + 1] - at) } else { at }
        };
        MODEL.iter().map(value).sum()
    }
}

/// Probability that a point is where it is said to be, in steps of 1/65535.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Confidence(u16);

impl Confidence {
    /// No point, or one of a method that states no confidence.
    pub const NONE: Self = Self(0);

    /// The least confidence that is not below a probability.
    pub(super) fn at_least(probability: f32) -> Self {
        Self((probability * f32::from(u16::MAX)).ceil() as u16)
    }

    /// The probability that odds of this logarithm say; never [`Self::NONE`].
    fn of_log_odds(nats: f32) -> Self {
        let odds_against = decay(f64::from(nats.abs()));
        let unlikely = odds_against / (1.0 + odds_against);
        let probability = if nats < 0.0 { unlikely } else { 1.0 - unlikely };
        Self((probability * f64::from(u16::MAX)).round().max(1.0) as u16)
    }

    /// As a number between 0 and 1.
    #[must_use]
    pub fn probability(self) -> f32 {
        f32::from(self.0) / f32::from(u16::MAX)
    }
}

/// The confidence of every selected candidate.
pub(super) fn confidences(selected: &[Option<Selected>], grounds: &[Grounds]) -> Vec<Confidence> {
    let of_pixel = |(selected, grounds): (&Option<Selected>, &Grounds)| match selected {
        Some(_) => Confidence::of_log_odds(grounds.log_odds()),
        None => Confidence::NONE,
    };
    selected.par_iter().zip(grounds).map(of_pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sound() -> Grounds {
        Grounds {
            margin_nats: 8.0,
            abs_z: 0.5,
            region_px: 20_000,
            region_lead_nats: 7.0,
            beside: 8,
            around: 48,
            is_hidden: false,
            hidden_share: 0.0,
        }
    }

    #[test]
    fn the_terms_of_a_curve_share_one_whole_and_give_the_same_odds() {
        for grounds in [sound(), Grounds { abs_z: 2.25, around: 13, is_hidden: true, ..sound() }, Grounds::default()] {
            let terms = grounds.terms();
            assert!((terms.iter().sum::<f32>() - CURVES as f32).abs() < 1e-5);
            let values = MODEL.iter().flat_map(|curve| curve.log_odds);
            let sum: f32 = terms.iter().zip(values).map(|(term, value)| term * value).sum();
            assert!((sum - grounds.log_odds()).abs() < 1e-4);
        }
    }

    #[test]
    fn what_speaks_against_a_point_lowers_its_confidence() {
        let confidence = |grounds: Grounds| Confidence::of_log_odds(grounds.log_odds());
        assert!(confidence(sound()).probability() > 0.999);
        for worse in [
            Grounds { abs_z: 7.0, ..sound() },
            Grounds { beside: 0, around: 3, ..sound() },
            Grounds { is_hidden: true, hidden_share: 0.8, ..sound() },
            Grounds { region_px: 5, region_lead_nats: 1.0, margin_nats: 1.0, ..sound() },
        ] {
            assert!(confidence(worse) < confidence(sound()), "{worse:?}");
        }
    }

    #[test]
    fn probabilities_are_those_of_their_odds() {
        for nats in [-20.0, -3.0, 0.0, 1.0, 4.6] {
            let exact = 1.0 / (1.0 + (-f64::from(nats)).exp());
            let stated = f64::from(Confidence::of_log_odds(nats).probability());
            assert!((stated - exact).abs() < 2e-5, "{nats}: {stated} {exact}");
        }
        assert!(Confidence::of_log_odds(-100.0) > Confidence::NONE);
        assert!(Confidence::at_least(0.9).probability() >= 0.9 && Confidence::at_least(0.0) == Confidence::NONE);
    }
}
