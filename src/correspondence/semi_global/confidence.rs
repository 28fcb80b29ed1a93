//! How likely a candidate is to be true.
//!
//! Every ground speaks for a candidate or against it by a curve, straight between its knots and constant beyond them; the
//! curves add up to the logarithm of the odds (an additive logistic model: Hastie and Tibshirani 1990, "Generalized Additive
//! Models"). Their values were fitted by `examples/fit_confidence.rs` to scenes of the virtual scanner.

use std::sync::LazyLock;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::decay::decay;

use super::UNITS_PER_NAT;
use super::grounds::Grounds;
use super::paths::PATHS;

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
        log_odds: &[-0.59, -0.22, -0.30, 0.07, 0.43, 0.56, 0.34],
    },
    Curve {
        of: |g| g.abs_z,
        knots: &[0.0, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0],
        log_odds: &[1.53, 1.27, 0.32, -0.34, -0.12, -0.63, -1.74],
    },
    Curve {
        of: |g| octaves(g.region_px),
        knots: &[0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 13.0],
        log_odds: &[1.41, 0.85, 1.04, 0.31, -3.49, 0.22, -0.05],
    },
    Curve {
        of: |g| g.region_lead_nats,
        knots: &[0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0],
        log_odds: &[0.59, 0.49, 1.50, -0.48, -0.23, -0.21, -1.37],
    },
    Curve {
        of: |g| f32::from(g.beside),
        knots: &[0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0],
        log_odds: &[-1.46, -0.17, -0.09, 0.09, 0.40, 0.67, 0.86],
    },
    Curve {
        of: |g| f32::from(g.around),
        knots: &[0.0, 4.0, 8.0, 16.0, 24.0, 36.0, 48.0],
        log_odds: &[-3.70, -1.89, -1.99, 0.56, 2.15, 1.39, 3.77],
    },
    Curve { of: hidden_support, knots: &[0.0, 8.0, 24.0, 48.0, SEEN], log_odds: &[-1.08, 2.73, -0.39, -3.83, 2.86] },
    Curve { of: |g| g.hidden_share, knots: &[0.0, 0.1, 0.3, 0.6, 1.0], log_odds: &[0.33, 0.10, -1.32, 1.61, -0.43] },
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
    /// What it adds to the logarithm of the odds, nats.
    fn log_odds(&self, grounds: &Grounds) -> f32 {
        let (place, share) = self.between(grounds);
        let at = self.log_odds[place];
        if share > 0.0 { at + share * (self.log_odds[place + 1] - at) } else { at }
    }

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

    /// As a number between 0 and 1.
    #[must_use]
    pub fn probability(self) -> f32 {
        f32::from(self.0) / f32::from(u16::MAX)
    }
}

/// Probability that odds of this logarithm say, in steps of 1/65535; never that of [`Confidence::NONE`].
#[inline(always)]
fn stated(nats: f32) -> u16 {
    let odds_against = decay(f64::from(nats.abs()));
    let unlikely = odds_against / (1.0 + odds_against);
    let probability = if nats < 0.0 { unlikely } else { 1.0 - unlikely };
    (probability * f64::from(u16::MAX)).round().max(1.0) as u16
}

/// The curves of [`MODEL`] by what they ask.
const MARGIN: usize = 0;
const ABS_Z: usize = 1;
const REGION_PX: usize = 2;
const REGION_LEAD: usize = 3;
const BESIDE: usize = 4;
const AROUND: usize = 5;
const HIDDEN: usize = 6;
const HIDDEN_SHARE: usize = 7;
/// Most margin that makes a difference: the last knot lies below.
const MAX_MARGIN: usize = (16 * PATHS) * UNITS_PER_NAT as usize;
/// Pixels around a pixel.
const MOST_AROUND: usize = 48;

/// What the regions of pixels say.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct OfRegion {
    pub(super) region_px: u32,
    pub(super) lead_nats: f32,
    pub(super) hidden_share: f32,
}

/// The model, made ready once.
pub(super) static TABLES: LazyLock<Tables> = LazyLock::new(Tables::new);

/// The model as tables of whatever answers are whole numbers.
pub(super) struct Tables {
    /// By how much the next best order has more, summed over all paths.
    margin: Vec<f32>,
    beside: [f32; MOST_AROUND + 1],
    around: [f32; MOST_AROUND + 1],
    /// Of points that C2 does not see, by the pixels around; the last is that of points that it sees.
    hidden: [f32; MOST_AROUND + 2],
}

impl Tables {
    fn new() -> Self {
        let none = Grounds::default;
        let margin = |units: usize| Grounds { margin_nats: margin_nats(units as u16), ..none() };
        let hidden = |around: usize| Grounds { is_hidden: around <= MOST_AROUND, around: around as u8, ..none() };
        Self {
            margin: (0..=MAX_MARGIN).map(|units| MODEL[MARGIN].log_odds(&margin(units))).collect(),
            beside: std::array::from_fn(|n| MODEL[BESIDE].log_odds(&Grounds { beside: n as u8, ..none() })),
            around: std::array::from_fn(|n| MODEL[AROUND].log_odds(&Grounds { around: n as u8, ..none() })),
            hidden: std::array::from_fn(|n| MODEL[HIDDEN].log_odds(&hidden(n))),
        }
    }

    /// What a region adds to the logarithm of the odds of its pixels.
    pub(super) fn of_region(&self, of_region: OfRegion) -> f32 {
        let OfRegion { region_px, lead_nats, hidden_share } = of_region;
        let grounds = Grounds { region_px, region_lead_nats: lead_nats, hidden_share, ..Grounds::default() };
        [REGION_PX, REGION_LEAD, HIDDEN_SHARE].iter().map(|&curve| MODEL[curve].log_odds(&grounds)).sum()
    }
}

/// Lead of an order over the next best, nats a path, of what that has more, summed over all paths.
pub(super) fn margin_nats(units: u16) -> f32 {
    f32::from(units) / (PATHS as f32 * UNITS_PER_NAT)
}

/// What speaks for the selected candidates of a row; numbers of pixels without candidate say nothing.
pub(super) struct GroundsRow<'a> {
    pub(super) margin: &'a [u16],
    pub(super) z: &'a [f32],
    pub(super) beside: &'a [u8],
    pub(super) around: &'a [u8],
    pub(super) is_hidden: &'a [bool],
    /// What their regions add.
    pub(super) of_regions: &'a [f32],
}

/// The confidence of the selected candidates of a row, to be told apart from pixels without by whoever asks; `log_odds` is
/// room.
pub(super) fn confidences(tables: &Tables, grounds: &GroundsRow<'_>, log_odds: &mut Vec<f32>, out: &mut [Confidence]) {
    log_odds.resize(out.len(), 0.0);
    fringeflow_simd::run(Level::in_use(), ConfidenceRow { tables, grounds, log_odds, out });
}

struct ConfidenceRow<'a> {
    tables: &'a Tables,
    grounds: &'a GroundsRow<'a>,
    log_odds: &'a mut [f32],
    out: &'a mut [Confidence],
}

impl Kernel for ConfidenceRow<'_> {
    type Output = ();

    /// Curve by curve, each over the whole row.
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { tables, grounds: g, log_odds, out } = self;
        let width = log_odds.len();
        let (margin, z, is_hidden) = (&g.margin[..width], &g.z[..width], &g.is_hidden[..width]);
        let (beside, around) = (&g.beside[..width], &g.around[..width]);
        let of_regions = &g.of_regions[..width];
        for u in 0..width {
            log_odds[u] = tables.margin[usize::from(margin[u]).min(MAX_MARGIN)];
        }
        for u in 0..width {
            log_odds[u] = log_odds[u] + of_z(z[u].abs()) + of_regions[u];
        }
        for u in 0..width {
            let around = usize::from(around[u]).min(MOST_AROUND);
            let hidden = if is_hidden[u] { around } else { MOST_AROUND + 1 };
            let by_support = tables.beside[usize::from(beside[u]).min(MOST_AROUND)];
            log_odds[u] = log_odds[u] + by_support + tables.around[around] + tables.hidden[hidden];
        }
        let out = &mut out[..width];
        for u in 0..width {
            out[u] = Confidence(stated(log_odds[u]));
        }
    }
}

/// What |z| adds to the logarithm of the odds; without a branch, so that many are asked at a time.
#[inline(always)]
fn of_z(abs_z: f32) -> f32 {
    const KNOTS: usize = MODEL[ABS_Z].knots.len();
    let Curve { knots, log_odds, .. } = &MODEL[ABS_Z];
    let (mut knot, mut width, mut at, mut rise) = (0.0, 1.0, log_odds[0], 0.0);
    for k in 0..KNOTS {
        let is_last = k + 1 == KNOTS;
        let next = if is_last { k } else { k + 1 };
        let is_beyond = abs_z >= knots[k];
        knot = if is_beyond { knots[k] } else { knot };
        width = if is_beyond { if is_last { 1.0 } else { knots[next] - knots[k] } } else { width };
        at = if is_beyond { log_odds[k] } else { at };
        rise = if is_beyond { log_odds[next] - log_odds[k] } else { rise };
    }
    at + (abs_z - knot) / width * rise
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

    /// All curves, one by one: the oracle.
    fn log_odds(grounds: &Grounds) -> f32 {
        let sum = |curves: &[usize]| curves.iter().map(|&curve| MODEL[curve].log_odds(grounds)).sum::<f32>();
        let by_support = sum(&[BESIDE]);
        let of_region = sum(&[REGION_PX, REGION_LEAD, HIDDEN_SHARE]);
        sum(&[MARGIN, ABS_Z]) + of_region + by_support + sum(&[AROUND]) + sum(&[HIDDEN])
    }

    #[test]
    fn a_row_has_the_confidences_of_its_pixels() {
        let mut state = 1_u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 16) % below
        };
        let tables = Tables::new();
        for count in [1, 16, 75] {
            let margin: Vec<u16> = (0..count).map(|_| random(3000) as u16).collect();
            let z: Vec<f32> = (0..count).map(|_| random(4000) as f32 / 250.0 - 8.0).collect();
            let beside: Vec<u8> = (0..count).map(|_| random(9) as u8).collect();
            let around: Vec<u8> = (0..count).map(|_| random(49) as u8).collect();
            let is_hidden: Vec<bool> = (0..count).map(|_| random(2) == 0).collect();
            let regions: Vec<OfRegion> = (0..count)
                .map(|_| OfRegion {
                    region_px: 1 + random(20_000),
                    lead_nats: random(1000) as f32 / 100.0,
                    hidden_share: random(100) as f32 / 99.0,
                })
                .collect();
            let of_regions: Vec<f32> = regions.iter().map(|&region| tables.of_region(region)).collect();
            let mut found = vec![Confidence::NONE; count];
            let row = GroundsRow {
                margin: &margin,
                z: &z,
                beside: &beside,
                around: &around,
                is_hidden: &is_hidden,
                of_regions: &of_regions,
            };
            confidences(&tables, &row, &mut Vec::new(), &mut found);
            for i in 0..count {
                let grounds = Grounds {
                    margin_nats: margin_nats(margin[i]),
                    abs_z: z[i].abs(),
                    region_px: regions[i].region_px,
                    region_lead_nats: regions[i].lead_nats,
                    beside: beside[i],
                    around: around[i],
                    is_hidden: is_hidden[i],
                    hidden_share: regions[i].hidden_share,
                };
                assert_eq!(found[i], Confidence(stated(log_odds(&grounds))), "{grounds:?}");
            }
        }
    }

    #[test]
    fn the_terms_of_a_curve_share_one_whole_and_give_the_same_odds() {
        for grounds in [sound(), Grounds { abs_z: 2.25, around: 13, is_hidden: true, ..sound() }, Grounds::default()] {
            let terms = grounds.terms();
            assert!((terms.iter().sum::<f32>() - CURVES as f32).abs() < 1e-5);
            let values = MODEL.iter().flat_map(|curve| curve.log_odds);
            let sum: f32 = terms.iter().zip(values).map(|(term, value)| term * value).sum();
            assert!((sum - log_odds(&grounds)).abs() < 1e-4);
        }
    }

    #[test]
    fn what_speaks_against_a_point_lowers_its_confidence() {
        let confidence = |grounds: Grounds| Confidence(stated(log_odds(&grounds)));
        assert!(confidence(sound()).probability() > 0.999);
        for worse in [
            Grounds { abs_z: 7.0, ..sound() },
            Grounds { beside: 0, around: 3, ..sound() },
            Grounds { is_hidden: true, hidden_share: 0.8, ..sound() },
            // So few pixels have no more around them.
            Grounds { region_px: 5, region_lead_nats: 1.0, margin_nats: 1.0, beside: 2, around: 4, ..sound() },
        ] {
            assert!(confidence(worse) < confidence(sound()), "{worse:?}");
        }
    }

    #[test]
    fn probabilities_are_those_of_their_odds() {
        for nats in [-20.0, -3.0, 0.0, 1.0, 4.6] {
            let exact = 1.0 / (1.0 + (-f64::from(nats)).exp());
            let stated = f64::from(Confidence(stated(nats)).probability());
            assert!((stated - exact).abs() < 2e-5, "{nats}: {stated} {exact}");
        }
        assert!(Confidence(stated(-100.0)) > Confidence::NONE);
        assert!(Confidence::at_least(0.9).probability() >= 0.9 && Confidence::at_least(0.0) == Confidence::NONE);
    }
}
