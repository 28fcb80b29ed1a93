//! The probability that a point is true.

use super::continuity::NEIGHBOURS;
use super::decay::decay;

/// Log odds of a point for each of its [`Grounds::terms`]: a logistic regression, as `examples/fit_confidence.rs` does it,
/// to the scenes with even numbers of the first 96 of the list to build with.
const FACTORS: [f32; CONFIDENCE_TERMS] = [0.45, 0.29, 0.18, 0.19, 3.34];

/// Number of factors of the model.
pub const CONFIDENCE_TERMS: usize = 5;

/// What speaks for and against a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Grounds {
    /// Logarithm of the log likelihood ratio of its surface.
    pub surface: f32,
    /// Log odds of its order over the next best or none, from the moments of δ of its part of the surface, nats.
    pub odds_nats: f32,
    /// What its own δ speaks against it, nats.
    pub cost_nats: f32,
    /// How many of the eight pixels around it continue its absolute phase.
    pub continuing: u8,
}

impl Grounds {
    /// The terms of the model: a logistic regression, in which the probability rises with each of them.
    #[must_use]
    pub fn terms(&self) -> [f32; CONFIDENCE_TERMS] {
        let continuing = f32::from(self.continuing) / f32::from(NEIGHBOURS);
        [1.0, self.surface, self.odds_nats, -self.cost_nats, continuing]
    }
}

/// Probability that a point is true, in steps of 1/65535.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Confidence(u16);

impl Confidence {
    /// No point, or no confidence stated.
    pub const NONE: Self = Self(0);

    /// The confidence that these grounds give; never [`Self::NONE`].
    pub(super) fn of(grounds: &Grounds) -> Self {
        let nats: f32 = grounds.terms().iter().zip(FACTORS).map(|(term, factor)| term * factor).sum();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn confidence_rises_with_each_ground_and_falls_with_the_cost() {
        let usual = Grounds { surface: 2.0, odds_nats: 4.0, cost_nats: 1.0, continuing: 6 };
        let mut last = [Confidence::NONE; 4];
        for i in 0..40_u8 {
            let x = 0.25 * f32::from(i);
            let each = [
                Grounds { surface: x, ..usual },
                Grounds { odds_nats: x - 5.0, ..usual },
                Grounds { cost_nats: 10.0 - x, ..usual },
                Grounds { continuing: i / 5, ..usual },
            ];
            for (last, now) in last.iter_mut().zip(each.map(|grounds| Confidence::of(&grounds))) {
                assert!(now >= *last && now > Confidence::NONE && now.probability() <= 1.0);
                *last = now;
            }
        }
    }

    #[test]
    fn the_logistic_function_is_exact() {
        let grounds = |odds_nats: f32| Grounds { odds_nats, ..Grounds::default() };
        for odds_nats in [-40.0, -12.0, -5.0, 0.0, 3.0, 20.0_f32] {
            let nats = f64::from(FACTORS[0]) + f64::from(FACTORS[2] * odds_nats);
            let expected = 1.0 / (1.0 + (-nats).exp());
            let found = f64::from(Confidence::of(&grounds(odds_nats)).probability());
            assert!((found - expected).abs() < 2e-5, "{found} {expected}");
        }
    }
}
