//! The likelihood of δ under a true and under a wrong order: the only place that knows how either looks.
//!
//! ```text
//! over a smooth surface, δ of a wrong order is a smooth function with a slope; δ of the true order has none
//! moments of δ − field over the samples of a node, u and v in half tiles from its middle:
//!     m      mean            true: near 0, but for the error of the field    wrong: anywhere on the circle, or, beside a
//!                                                                           neighbour, as far from its mean as a slope leads
//!     a, b   slopes          true: small                                    wrong: as wide as measured on wrong orders
//!     f      share near 0    true: nearly all                               wrong: any
//!     e      excess          true: small                                    wrong: as wide as measured on wrong orders
//!                            e = ln(sd about the plane / sd of noise): what bends, or two surfaces in one node
//! ratio = ln p(m, a, b, f, e | true) − ln p(m, a, b, f, e | wrong)
//! ```
//!
//! The widths of true orders, and those of slopes and excess of wrong ones, are measured on the images.
//!
//! Nothing in the ratio grows with the number of samples: the pixels of a surface are not independent. All densities
//! are heavy-tailed (Student's t with three degrees of freedom). Angles are in radians.

use std::f32::consts::TAU;

use super::model::Model;

/// Fewest fitting samples from which moments are computed.
const MIN_FITTING: f32 = 3.0;
/// Least residual, variances of noise.
const MIN_RESIDUAL: f32 = 1e-6;

/// The widths of the densities, radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Widths {
    /// Of the mean of a true order about the field.
    pub(super) mean: f32,
    /// Of the slopes of a true order along and across the epipolar lines, per half tile.
    pub(super) slopes: [f32; 2],
    /// Of the slopes of a wrong order along and across the epipolar lines, per half tile.
    pub(super) wrong_slopes: [f32; 2],
    /// Of the mean of a wrong order given that of its neighbours; `None`: anywhere on the circle.
    pub(super) wrong_mean: Option<f32>,
    /// Of the excess of a true order.
    pub(super) excess: f32,
    /// Of the excess of a wrong order.
    pub(super) wrong_excess: f32,
}

/// Sums over the samples of a node at one order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sums {
    /// Samples that C2 sees, and those of them with δ near the field.
    pub(super) seen: f32,
    pub(super) fitting: f32,
    /// Sums over the fitting samples of u, v, δ and their products.
    pub(super) u: f32,
    pub(super) v: f32,
    pub(super) e: f32,
    pub(super) uu: f32,
    pub(super) uv: f32,
    pub(super) vv: f32,
    pub(super) ue: f32,
    pub(super) ve: f32,
    pub(super) ee: f32,
}

/// What the samples of a node show at one order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Look {
    /// C2 sees too few of the samples.
    Unseen,
    /// Too few samples fit.
    Unfit,
    /// The moments of δ.
    Fits(Moments),
}

/// Moments of δ less the field.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Moments {
    /// Mean.
    pub(super) mean: f32,
    /// Slopes along u and v, per half tile.
    pub(super) slopes: [f32; 2],
    /// Variance of noise of the mean and of both slopes.
    pub(super) variance: [f32; 3],
    /// Share of fitting samples among the seen ones.
    pub(super) share: f32,
    /// Fitting samples.
    pub(super) count: f32,
    /// Variance about the plane.
    pub(super) residual: f32,
}

impl Sums {
    /// Adds a sample, as the kernel of the evidence does, that C2 sees at (u, v) with δ less the field `e`, if `e` is below `cap`.
    #[cfg(test)]
    pub(super) fn add(&mut self, [u, v]: [f32; 2], e: f32, cap: f32) {
        self.seen += 1.0;
        if e.abs() < cap {
            self.fitting += 1.0;
            self.u += u;
            self.v += v;
            self.e += e;
            self.uu += u * u;
            self.uv += u * v;
            self.vv += v * v;
            self.ue += u * e;
            self.ve += v * e;
            self.ee += e * e;
        }
    }

    /// The moments. `sampled` counts all samples, `noise` is the mean variance of a sample, and `slope_width` the widest
    /// slope expected, with which slopes that the samples hardly determine are kept small.
    pub(super) fn look(&self, sampled: f32, noise: f32, slope_width: f32, model: &Model) -> Look {
        if self.seen < MIN_FITTING.max(model.min_seen * sampled) {
            return Look::Unseen;
        }
        let (n, share) = (self.fitting, self.fitting / self.seen);
        if share < model.min_share || n < MIN_FITTING {
            return Look::Unfit;
        }
        let per = 1.0 / n;
        let (u, v, mean) = (self.u * per, self.v * per, self.e * per);
        let ridge = noise / (slope_width * slope_width);
        let uu = self.uu - n * u * u + ridge;
        let vv = self.vv - n * v * v + ridge;
        let uv = self.uv - n * u * v;
        let (ue, ve) = (self.ue - n * u * mean, self.ve - n * v * mean);
        let determinant = (uu * vv - uv * uv).max(1e-9);
        let slopes = [(ue * vv - ve * uv) / determinant, (ve * uu - ue * uv) / determinant];
        let variance = [noise * per, noise * vv / determinant, noise * uu / determinant];
        let about = self.ee - n * mean * mean - slopes[0] * ue - slopes[1] * ve;
        let residual = about.max(0.0) / (n - 3.0).max(1.0);
        Look::Fits(Moments { mean, slopes, variance, share, count: n, residual })
    }
}

impl Moments {
    /// Excess: logarithm of the sd about the plane over the sd of noise.
    pub(super) fn excess(&self) -> f32 {
        0.5 * ln((self.residual / (self.variance[0] * self.count)).max(MIN_RESIDUAL))
    }

    /// Variance of the excess from the number of samples alone.
    fn variance_of_excess(&self) -> f32 {
        0.5 / (self.count - 3.0).max(1.0)
    }

    /// Whether what is left about the plane can be noise, so that the node holds one surface.
    pub(super) fn is_pure(&self, widths: &Widths, model: &Model) -> bool {
        let variance = widths.excess * widths.excess + self.variance_of_excess();
        self.excess() < model.pure_sd * variance.sqrt()
    }

    /// Log likelihood ratio of slopes, share and excess, true against wrong, nats.
    fn ratio_but_mean(&self, widths: &Widths, model: &Model) -> f32 {
        let mut ratio = model.share_exponent * ln(self.share) + ln(1.0 + model.share_exponent);
        for axis in 0..2 {
            let (value, noise) = (self.slopes[axis], self.variance[1 + axis]);
            let slope = widths.slopes[axis] * widths.slopes[axis];
            // A wrong slope is never narrower than a true one.
            let wrong = (widths.wrong_slopes[axis] * widths.wrong_slopes[axis]).max(slope);
            ratio += student(value, slope + noise) - student(value, wrong + noise);
        }
        // Less than the noise is no bend.
        let (excess, counting) = (self.excess().max(0.0), self.variance_of_excess());
        let own = widths.excess * widths.excess;
        let wrong = (widths.wrong_excess * widths.wrong_excess).max(own);
        ratio + student(excess, own + counting) - student(excess, wrong + counting)
    }

    /// Log likelihood ratio of the mean less `expected`, true against wrong, nats.
    pub(super) fn ratio_of_mean(&self, expected: f32, widths: &Widths) -> f32 {
        let (noise, off) = (self.variance[0], self.mean - expected);
        let wrong = match widths.wrong_mean {
            Some(width) => student(off, width * width),
            None => -LN_TAU,
        };
        student(off, widths.mean * widths.mean + noise) - wrong
    }

    /// Log likelihood ratio of the mean within a component that was chosen and lies this far from the field, nats. The
    /// means of a wrong one lie all over the reach about the field.
    pub(super) fn ratio_within(&self, offset: f32, model: &Model) -> f32 {
        let wrong = model.wrong_means_rad * model.wrong_means_rad + self.variance[0];
        student(self.mean - offset, self.variance_within(model)) - student(self.mean, wrong)
    }

    /// Variance of the mean about the offset of a true component, rad².
    pub(super) fn variance_within(&self, model: &Model) -> f32 {
        model.true_means_rad * model.true_means_rad + self.variance[0]
    }

    /// Log likelihood ratio of all moments, nats; at least the floor of the model.
    pub(super) fn ratio(&self, expected_mean: f32, widths: &Widths, model: &Model) -> f32 {
        (self.ratio_of_mean(expected_mean, widths) + self.ratio_but_mean(widths, model)).max(model.floor_nats)
    }
}

const LN_TAU: f32 = 1.837_877_1;
/// Log of the density at 0 of Student's t with three degrees of freedom and scale 1: ln(2 / (π·√3)).
const LN_STUDENT: f32 = -1.000_889_7;

/// Log density of Student's t with three degrees of freedom, scaled by a variance.
fn student(x: f32, variance: f32) -> f32 {
    LN_STUDENT - 0.5 * ln(variance) - student_cost(x * x / variance)
}

/// What the square of a distance in sd costs under Student's t, nats.
#[inline]
pub(super) fn student_cost(square: f32) -> f32 {
    2.0 * ln(1.0 + square / 3.0)
}

/// Weight, in a fit by least squares, of a value whose distance in sd has this square under Student's t.
pub(super) fn student_weight(square: f32) -> f32 {
    4.0 / (3.0 + square)
}

/// Natural logarithm of a positive number to 1e-6, the same bits on every machine.
#[inline]
pub(super) fn ln(x: f32) -> f32 {
    let bits = x.to_bits();
    // x = m · 2ᵉ, m from 0.7 to 1.4.
    let e = (bits.wrapping_sub(0x3f33_3333) as i32) >> 23;
    let m = f32::from_bits(bits.wrapping_sub((e << 23) as u32));
    let t = (m - 1.0) / (m + 1.0);
    let tt = t * t;
    let series = ((tt * (1.0 / 9.0) + 1.0 / 7.0) * tt + 0.2) * tt + 1.0 / 3.0;
    2.0 * t * (1.0 + tt * series) + e as f32 * std::f32::consts::LN_2
}

/// Turns to radians.
pub(super) fn radians(turns: f32) -> f32 {
    turns * TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODEL: Model = Model::USUAL;

    const WIDTHS: Widths = Widths {
        mean: 0.03,
        slopes: [0.03; 2],
        wrong_slopes: [0.5, 0.2],
        wrong_mean: None,
        excess: 0.1,
        wrong_excess: 1.0,
    };

    fn tile(delta: impl Fn(f32, f32) -> f32) -> Sums {
        let mut sums = Sums::default();
        for (i, j) in (0..8).flat_map(|i| (0..8).map(move |j| (i, j))) {
            let place = [(i as f32 - 3.5) / 4.0, (j as f32 - 3.5) / 4.0];
            sums.add(place, delta(place[0], place[1]), 0.3);
        }
        sums
    }

    fn ratio(delta: impl Fn(f32, f32) -> f32) -> f32 {
        match tile(delta).look(64.0, 1e-4, 0.5, &MODEL) {
            Look::Fits(moments) => moments.ratio(0.0, &WIDTHS, &MODEL),
            _ => MODEL.floor_nats,
        }
    }

    #[test]
    fn the_logarithm_is_exact() {
        for x in [1e-12_f32, 0.013, 0.69, 0.71, 1.0, 1.39, 1.41, 2.0, 77.0, 1e9] {
            assert!((ln(x) - x.ln()).abs() < 2e-6 * x.ln().abs().max(1.0), "{x}");
        }
    }

    #[test]
    fn a_flat_delta_is_true_and_a_slope_is_not() {
        assert!(ratio(|_, _| 0.0) > 8.0);
        assert!(ratio(|_, _| 0.03) > 7.0, "an error of the field costs little");
        assert!(ratio(|_, _| 0.0) - ratio(|u, _| 0.25 * u) > 5.0);
        assert!(ratio(|u, _| 1.5 * u) < 0.0);
    }

    #[test]
    fn the_ratio_falls_with_mean_and_slopes() {
        let mut last = [f32::INFINITY; 3];
        for step in 0..20 {
            let x = 0.01 * step as f32;
            for (last, now) in last.iter_mut().zip([ratio(|_, _| x), ratio(|u, _| x * u), ratio(|_, v| x * v)]) {
                assert!(now <= *last + 1e-4, "{now} after {last} at {x}");
                *last = now;
            }
        }
    }

    #[test]
    fn within_a_component_only_a_small_mean_speaks_for_it() {
        let ratio = |mean: f32| Moments { mean, ..Moments::default() }.ratio_within(0.0, &MODEL);
        assert!(ratio(0.0) > 1.0 && ratio(0.1) < -1.0);
        assert!((0..20).all(|i| ratio(0.01 * i as f32) > ratio(0.01 * (i + 1) as f32)));
    }

    #[test]
    fn a_bend_and_a_second_surface_are_no_noise() {
        let pure = |delta: fn(f32, f32) -> f32| match tile(delta).look(64.0, 1e-4, 0.5, &MODEL) {
            Look::Fits(moments) => moments.is_pure(&WIDTHS, &MODEL),
            _ => false,
        };
        let noise = |u: f32, v: f32| 0.014 * (997.0 * (u + 3.1 * v)).sin();
        assert!(pure(noise));
        assert!(!pure(|u, _| if u < 0.3 { 0.0 } else { 0.12 }) && !pure(|u, _| 0.15 * u * u));
        assert!(ratio(noise) > ratio(|u, _| 0.15 * u * u - 0.05) + 1.0);
    }

    #[test]
    fn where_wrong_orders_are_flat_slopes_say_nothing() {
        let flat = Widths { wrong_slopes: [0.01, 0.01], ..WIDTHS };
        let moments = |slope: f32| match tile(|u, _| slope * u).look(64.0, 1e-4, 0.5, &MODEL) {
            Look::Fits(moments) => moments.ratio(0.0, &flat, &MODEL),
            _ => MODEL.floor_nats,
        };
        assert!((moments(0.0) - moments(0.05)).abs() < 1e-3);
    }

    #[test]
    fn a_place_that_cam2_does_not_see_is_unseen() {
        assert_eq!(Sums::default().look(64.0, 1e-4, 0.5, &MODEL), Look::Unseen);
        assert_eq!(tile(|_, _| 2.0).look(64.0, 1e-4, 0.5, &MODEL), Look::Unfit);
    }
}
