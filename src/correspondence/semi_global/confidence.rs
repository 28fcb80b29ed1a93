//! The probability that a candidate is true.
//!
//! An additive logistic model (Hastie and Tibshirani 1990, "Generalized Additive Models"): each of the grounds adds a
//! curve to the logarithm of the odds. Curves are linear between their knots and constant beyond them. Their values
//! were fitted by `examples/fit_confidence.rs` to scenes of the virtual scanner.

use std::sync::LazyLock;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::decay::decay;

use super::cost_table::UNITS_PER_NAT;
use super::grounds::Grounds;
use super::paths::PATHS;

/// Number of curves.
const CURVES: usize = 8;

/// The contribution of one ground to the logarithm of the odds.
struct Curve {
    /// The quantity on the horizontal axis.
    of: fn(&Grounds) -> f32,
    /// Values of the quantity at which the curve bends.
    knots: &'static [f32],
    /// Logarithm of the odds there, nats.
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
        of: |g| f32::from(g.near_support),
        knots: &[0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0],
        log_odds: &[-1.46, -0.17, -0.09, 0.09, 0.40, 0.67, 0.86],
    },
    Curve {
        of: |g| f32::from(g.wide_support),
        knots: &[0.0, 4.0, 8.0, 16.0, 24.0, 36.0, 48.0],
        log_odds: &[-3.70, -1.89, -1.99, 0.56, 2.15, 1.39, 3.77],
    },
    Curve { of: hidden_support, knots: &[0.0, 8.0, 24.0, 48.0, SEEN], log_odds: &[-1.08, 2.73, -0.39, -3.83, 2.86] },
    Curve { of: |g| g.hidden_share, knots: &[0.0, 0.1, 0.3, 0.6, 1.0], log_odds: &[0.33, 0.10, -1.32, 1.61, -0.43] },
];

/// Stands for a point that C2 sees.
const SEEN: f32 = 49.0;

/// Support of a hidden point, else [`SEEN`].
fn hidden_support(grounds: &Grounds) -> f32 {
    if grounds.is_hidden { f32::from(grounds.wide_support) } else { SEEN }
}

/// Logarithm to base 2, linear between powers of two: the same on every machine.
fn octaves(count: u32) -> f32 {
    let whole = count.max(1).ilog2();
    whole as f32 + (count.max(1) as f32 / (1_u32 << whole) as f32 - 1.0)
}

/// Number of values of the model, over all curves.
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
    /// Contribution to the logarithm of the odds, nats.
    fn log_odds(&self, grounds: &Grounds) -> f32 {
        let (place, share) = self.knot_before(grounds);
        let at = self.log_odds[place];
        if share > 0.0 { at + share * (self.log_odds[place + 1] - at) } else { at }
    }

    /// Index of the knot before the quantity, and how far it lies towards the next one.
    fn knot_before(&self, grounds: &Grounds) -> (usize, f32) {
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
    /// Weight of each value of the model for these grounds, for fitting the model.
    #[must_use]
    pub fn terms(&self) -> [f32; CONFIDENCE_TERMS] {
        let mut terms = [0.0; CONFIDENCE_TERMS];
        let mut rest = &mut terms[..];
        for curve in &MODEL {
            let (own, others) = std::mem::take(&mut rest).split_at_mut(curve.knots.len());
            let (place, share) = curve.knot_before(self);
            own[place] = 1.0 - share;
            if share > 0.0 {
                own[place + 1] = share;
            }
            rest = others;
        }
        terms
    }
}

/// Probability that a point is true, in steps of 1/65535.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Confidence(u16);

impl Confidence {
    /// No point, or no confidence stated.
    pub const NONE: Self = Self(0);

    /// The least confidence that is not below a probability.
    pub(super) fn at_least(probability: f32) -> Self {
        Self((probability * f32::from(u16::MAX)).ceil() as u16)
    }

    /// The confidence of these log odds, nats.
    pub(in crate::correspondence) fn of_log_odds(nats: f32) -> Self {
        Self(from_log_odds(nats))
    }

    /// As a number between 0 and 1.
    #[must_use]
    pub fn probability(self) -> f32 {
        f32::from(self.0) / f32::from(u16::MAX)
    }
}

/// Probability of these odds, in steps of 1/65535; never that of [`Confidence::NONE`].
#[inline(always)]
fn from_log_odds(nats: f32) -> u16 {
    let odds_against = decay(f64::from(nats.abs()));
    let unlikely = odds_against / (1.0 + odds_against);
    let probability = if nats < 0.0 { unlikely } else { 1.0 - unlikely };
    (probability * f64::from(u16::MAX)).round().max(1.0) as u16
}

/// Indices of the curves of [`MODEL`].
const MARGIN: usize = 0;
const ABS_Z: usize = 1;
const REGION_PX: usize = 2;
const REGION_LEAD: usize = 3;
const NEAR_SUPPORT: usize = 4;
const WIDE_SUPPORT: usize = 5;
const HIDDEN: usize = 6;
const HIDDEN_SHARE: usize = 7;
/// Largest margin in the table, in units of cost. It lies beyond the last knot, where the curve is constant.
const MAX_MARGIN_UNITS: usize = (16 * PATHS) * UNITS_PER_NAT as usize;
/// Pixels in the wide neighbourhood of a pixel.
const MAX_SUPPORT: usize = 48;

/// The grounds shared by all pixels of a region.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RegionGrounds {
    pub(super) region_px: u32,
    pub(super) lead_nats: f32,
    pub(super) hidden_share: f32,
}

/// The model, tabulated once.
pub(super) static TABLES: LazyLock<Tables> = LazyLock::new(Tables::new);

/// The curves whose quantities are whole numbers, as tables.
pub(super) struct Tables {
    /// By the margin: the excess of the next best order, summed over all paths.
    margin: Vec<f32>,
    near_support: [f32; MAX_SUPPORT + 1],
    wide_support: [f32; MAX_SUPPORT + 1],
    /// For points that C2 does not see, by their support; the last entry is for points that it sees.
    hidden: [f32; MAX_SUPPORT + 2],
}

impl Tables {
    fn new() -> Self {
        let none = Grounds::default;
        let margin = |units: usize| Grounds { margin_nats: margin_nats(units as u16), ..none() };
        let hidden = |wide_support: usize| Grounds {
            is_hidden: wide_support <= MAX_SUPPORT,
            wide_support: wide_support as u8,
            ..none()
        };
        Self {
            margin: (0..=MAX_MARGIN_UNITS).map(|units| MODEL[MARGIN].log_odds(&margin(units))).collect(),
            near_support: std::array::from_fn(|n| {
                MODEL[NEAR_SUPPORT].log_odds(&Grounds { near_support: n as u8, ..none() })
            }),
            wide_support: std::array::from_fn(|n| {
                MODEL[WIDE_SUPPORT].log_odds(&Grounds { wide_support: n as u8, ..none() })
            }),
            hidden: std::array::from_fn(|n| MODEL[HIDDEN].log_odds(&hidden(n))),
        }
    }

    /// Contribution of a region to the logarithm of the odds of its pixels.
    pub(super) fn region_log_odds(&self, of_region: RegionGrounds) -> f32 {
        let RegionGrounds { region_px, lead_nats, hidden_share } = of_region;
        let grounds = Grounds { region_px, region_lead_nats: lead_nats, hidden_share, ..Grounds::default() };
        [REGION_PX, REGION_LEAD, HIDDEN_SHARE].iter().map(|&curve| MODEL[curve].log_odds(&grounds)).sum()
    }
}

/// Converts a margin, summed over all paths, to nats per path.
pub(super) fn margin_nats(units: u16) -> f32 {
    f32::from(units) / (PATHS as f32 * UNITS_PER_NAT)
}

/// The grounds of the selected candidates of a row. Those of pixels without candidate are undefined.
pub(super) struct GroundsRow<'a> {
    pub(super) margin: &'a [u16],
    pub(super) z: &'a [f32],
    pub(super) near_support: &'a [u8],
    pub(super) wide_support: &'a [u8],
    pub(super) is_hidden: &'a [bool],
    /// Contribution of the region of each pixel.
    pub(super) region_log_odds: &'a [f32],
}

/// Computes the confidence of the selected candidates of a row; undefined for other pixels. `log_odds` is scratch.
pub(super) fn confidences(tables: &Tables, grounds: &GroundsRow<'_>, log_odds: &mut Vec<f32>, out: &mut [Confidence]) {
    log_odds.resize(out.len(), 0.0);
    fringeflow_simd::run(Level::in_use(), ConfidenceRow { tables, grounds, log_odds, out });
}

/// Computes the confidences of a row.
struct ConfidenceRow<'a> {
    tables: &'a Tables,
    grounds: &'a GroundsRow<'a>,
    log_odds: &'a mut [f32],
    out: &'a mut [Confidence],
}

impl Kernel for ConfidenceRow<'_> {
    type Output = ();

    /// Curve by curve over the whole row, so that each loop vectorizes.
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { tables, grounds: g, log_odds, out } = self;
        let width = log_odds.len();
        let (margin, z, is_hidden) = (&g.margin[..width], &g.z[..width], &g.is_hidden[..width]);
        let (near_support, wide_support) = (&g.near_support[..width], &g.wide_support[..width]);
        let region_log_odds = &g.region_log_odds[..width];
        for u in 0..width {
            log_odds[u] = tables.margin[usize::from(margin[u]).min(MAX_MARGIN_UNITS)];
        }
        for u in 0..width {
            log_odds[u] = log_odds[u] + log_odds_of_z(z[u].abs()) + region_log_odds[u];
        }
        for u in 0..width {
            let wide_support = usize::from(wide_support[u]).min(MAX_SUPPORT);
            let hidden = if is_hidden[u] { wide_support } else { MAX_SUPPORT + 1 };
            let by_support = tables.near_support[usize::from(near_support[u]).min(MAX_SUPPORT)];
            log_odds[u] = log_odds[u] + by_support + tables.wide_support[wide_support] + tables.hidden[hidden];
        }
        let out = &mut out[..width];
        for u in 0..width {
            out[u] = Confidence(from_log_odds(log_odds[u]));
        }
    }
}

/// Contribution of |z|; free of branches so that it vectorizes.
#[inline(always)]
fn log_odds_of_z(abs_z: f32) -> f32 {
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
    use crate::correspondence::test_random::random;

    fn sound() -> Grounds {
        Grounds {
            margin_nats: 8.0,
            abs_z: 0.5,
            region_px: 20_000,
            region_lead_nats: 7.0,
            near_support: 8,
            wide_support: 48,
            is_hidden: false,
            hidden_share: 0.0,
        }
    }

    /// All curves, one by one: the oracle.
    fn log_odds(grounds: &Grounds) -> f32 {
        let sum = |curves: &[usize]| curves.iter().map(|&curve| MODEL[curve].log_odds(grounds)).sum::<f32>();
        let by_support = sum(&[NEAR_SUPPORT]);
        let of_region = sum(&[REGION_PX, REGION_LEAD, HIDDEN_SHARE]);
        sum(&[MARGIN, ABS_Z]) + of_region + by_support + sum(&[WIDE_SUPPORT]) + sum(&[HIDDEN])
    }

    #[test]
    fn a_row_has_the_confidences_of_its_pixels() {
        let mut random = random(1);
        let tables = Tables::new();
        for count in [1, 16, 75] {
            let margin: Vec<u16> = (0..count).map(|_| random(3000) as u16).collect();
            let z: Vec<f32> = (0..count).map(|_| random(4000) as f32 / 250.0 - 8.0).collect();
            let near_support: Vec<u8> = (0..count).map(|_| random(9) as u8).collect();
            let wide_support: Vec<u8> = (0..count).map(|_| random(49) as u8).collect();
            let is_hidden: Vec<bool> = (0..count).map(|_| random(2) == 0).collect();
            let regions: Vec<RegionGrounds> = (0..count)
                .map(|_| RegionGrounds {
                    region_px: 1 + random(20_000) as u32,
                    lead_nats: random(1000) as f32 / 100.0,
                    hidden_share: random(100) as f32 / 99.0,
                })
                .collect();
            let region_log_odds: Vec<f32> = regions.iter().map(|&region| tables.region_log_odds(region)).collect();
            let mut found = vec![Confidence::NONE; count];
            let row = GroundsRow {
                margin: &margin,
                z: &z,
                near_support: &near_support,
                wide_support: &wide_support,
                is_hidden: &is_hidden,
                region_log_odds: &region_log_odds,
            };
            confidences(&tables, &row, &mut Vec::new(), &mut found);
            for i in 0..count {
                let grounds = Grounds {
                    margin_nats: margin_nats(margin[i]),
                    abs_z: z[i].abs(),
                    region_px: regions[i].region_px,
                    region_lead_nats: regions[i].lead_nats,
                    near_support: near_support[i],
                    wide_support: wide_support[i],
                    is_hidden: is_hidden[i],
                    hidden_share: regions[i].hidden_share,
                };
                assert_eq!(found[i], Confidence(from_log_odds(log_odds(&grounds))), "{grounds:?}");
            }
        }
    }

    #[test]
    fn the_terms_of_a_curve_share_one_whole_and_give_the_same_odds() {
        for grounds in
            [sound(), Grounds { abs_z: 2.25, wide_support: 13, is_hidden: true, ..sound() }, Grounds::default()]
        {
            let terms = grounds.terms();
            assert!((terms.iter().sum::<f32>() - CURVES as f32).abs() < 1e-5);
            let values = MODEL.iter().flat_map(|curve| curve.log_odds);
            let sum: f32 = terms.iter().zip(values).map(|(term, value)| term * value).sum();
            assert!((sum - log_odds(&grounds)).abs() < 1e-4);
        }
    }

    #[test]
    fn worse_grounds_lower_the_confidence() {
        let confidence = |grounds: Grounds| Confidence(from_log_odds(log_odds(&grounds)));
        assert!(confidence(sound()).probability() > 0.999);
        for worse in [
            Grounds { abs_z: 7.0, ..sound() },
            Grounds { near_support: 0, wide_support: 3, ..sound() },
            Grounds { is_hidden: true, hidden_share: 0.8, ..sound() },
            // So few pixels have no more around them.
            Grounds {
                region_px: 5,
                region_lead_nats: 1.0,
                margin_nats: 1.0,
                near_support: 2,
                wide_support: 4,
                ..sound()
            },
        ] {
            assert!(confidence(worse) < confidence(sound()), "{worse:?}");
        }
    }

    #[test]
    fn probabilities_are_those_of_their_odds() {
        for nats in [-20.0, -3.0, 0.0, 1.0, 4.6] {
            let exact = 1.0 / (1.0 + (-f64::from(nats)).exp());
            let from_log_odds = f64::from(Confidence(from_log_odds(nats)).probability());
            assert!((from_log_odds - exact).abs() < 2e-5, "{nats}: {from_log_odds} {exact}");
        }
        assert!(Confidence(from_log_odds(-100.0)) > Confidence::NONE);
        assert!(Confidence::at_least(0.9).probability() >= 0.9 && Confidence::at_least(0.0) == Confidence::NONE);
    }
}
