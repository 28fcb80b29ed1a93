//! The probability that a point is true.

use fringeflow_simd::{Kernel, LANES, Lanes, Level};

use super::continuity::NEIGHBOURS;
use super::decay::decay;
use super::likelihood::ln;

/// Log odds of a point for each of its [`Grounds::terms`]: a logistic regression, as `examples/fit_confidence.rs` does it,
/// to the scenes with even numbers of the first 96 of the list to build with.
const FACTORS: [f32; CONFIDENCE_TERMS] = [1.08, 0.07, 0.18, 0.18, 4.58, 0.32];

/// Number of factors of the model.
pub const CONFIDENCE_TERMS: usize = 6;

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
    /// How many pixels lie between it and the pixels of the node that it continues, and itself; 0 if it is one of them.
    pub depth: u8,
}

impl Grounds {
    /// The terms of the model: a logistic regression, in which the probability rises with each of them.
    #[must_use]
    #[inline(always)]
    pub fn terms(&self) -> [f32; CONFIDENCE_TERMS] {
        let continuing = f32::from(self.continuing) / f32::from(NEIGHBOURS);
        let depth = ln(1.0 + f32::from(self.depth));
        [1.0, self.surface, self.odds_nats, -self.cost_nats, continuing, -depth]
    }
}

/// Probability that a point is true, in steps of 1/65535.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Confidence(u16);

impl Confidence {
    /// No point, or no confidence stated.
    pub const NONE: Self = Self(0);

    /// The confidence at these log odds; never [`Self::NONE`].
    fn at(nats: f32) -> Self {
        let unlikely = UNLIKELY.at(nats.abs());
        let steps = if nats < 0.0 { unlikely } else { f32::from(u16::MAX) - unlikely };
        Self((steps + 0.5).max(1.0) as u16)
    }

    /// As a number between 0 and 1.
    #[must_use]
    pub fn probability(self) -> f32 {
        f32::from(self.0) / f32::from(u16::MAX)
    }
}

/// Pixels of a row that belong to one part of a surface.
pub(super) struct OfPart<'a> {
    /// What they have in common: surface and odds.
    pub(super) part: Grounds,
    /// What each has of its own.
    pub(super) costs_nats: &'a [f32],
    pub(super) continuing: &'a [u8],
    pub(super) depths: &'a [u8],
}

impl OfPart<'_> {
    /// Writes their confidences; none is [`Confidence::NONE`].
    pub(super) fn write(self, confidence: &mut [Confidence]) {
        fringeflow_simd::run(Level::in_use(), ConfidenceKernel { pixels: self, confidence });
    }
}

struct ConfidenceKernel<'a, 'b> {
    pixels: OfPart<'a>,
    confidence: &'b mut [Confidence],
}

impl Kernel for ConfidenceKernel<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { pixels: OfPart { part, costs_nats, continuing, depths }, confidence } = self;
        let blocks = costs_nats.chunks(LANES).zip(continuing.chunks(LANES)).zip(depths.chunks(LANES));
        for (((costs, continuing), depths), confidence) in blocks.zip(confidence.chunks_mut(LANES)) {
            let mut nats = [0.0; LANES];
            let own = nats.iter_mut().zip(costs).zip(continuing).zip(depths);
            for (((nats, &cost_nats), &continuing), &depth) in own {
                let terms = Grounds { cost_nats, continuing, depth, ..part }.terms();
                let mut sum = 0.0;
                for i in 0..CONFIDENCE_TERMS {
                    sum += terms[i] * FACTORS[i];
                }
                *nats = sum;
            }
            for (confidence, nats) in confidence.iter_mut().zip(nats) {
                *confidence = Confidence::at(nats);
            }
        }
    }
}

/// 1 / (1 + eˣ) in steps of [`Confidence`], at the ends of intervals of x; 0 beyond.
struct Logistic([f32; Self::PER_NAT * Self::MAX_NATS + 2]);

static UNLIKELY: Logistic = Logistic::new();

impl Logistic {
    /// Intervals per nat: between their ends the function is straight to a fifth of a step.
    const PER_NAT: usize = 64;
    const MAX_NATS: usize = 12;

    const fn new() -> Self {
        let mut ends = [0.0; Self::PER_NAT * Self::MAX_NATS + 2];
        let mut i = 0;
        while i < ends.len() {
            let odds_against = decay(i as f64 / Self::PER_NAT as f64);
            ends[i] = (u16::MAX as f64 * odds_against / (1.0 + odds_against)) as f32;
            i += 1;
        }
        Self(ends)
    }

    /// The value for x ≥ 0.
    fn at(&self, x: f32) -> f32 {
        let place = (x * Self::PER_NAT as f32).min((Self::PER_NAT * Self::MAX_NATS) as f32);
        let i = place as usize;
        let share = place - i as f32;
        self.0[i] + share * (self.0[i + 1] - self.0[i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn confidence(grounds: Grounds) -> Confidence {
        let mut confidence = [Confidence::NONE];
        let Grounds { cost_nats, continuing, depth, .. } = grounds;
        let pixels = OfPart { part: grounds, costs_nats: &[cost_nats], continuing: &[continuing], depths: &[depth] };
        pixels.write(&mut confidence);
        confidence[0]
    }

    #[test]
    fn confidence_rises_with_each_ground_and_falls_with_the_cost() {
        let usual = Grounds { surface: 2.0, odds_nats: 4.0, cost_nats: 1.0, continuing: 6, depth: 20 };
        let mut last = [Confidence::NONE; 5];
        for i in 0..40_u8 {
            let x = 0.25 * f32::from(i);
            let each = [
                Grounds { surface: x, ..usual },
                Grounds { odds_nats: x - 5.0, ..usual },
                Grounds { cost_nats: 10.0 - x, ..usual },
                Grounds { continuing: i / 5, ..usual },
                Grounds { depth: 40 - i, ..usual },
            ];
            for (last, now) in last.iter_mut().zip(each.map(confidence)) {
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
            let found = f64::from(confidence(grounds(odds_nats)).probability());
            assert!((found - expected).abs() < 2e-5, "{found} {expected}");
        }
    }
}
