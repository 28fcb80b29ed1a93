//! Lens distortion in OpenCV's model: radial, rational, tangential, thin prism (operator D of the paper, section 2.1).
//!
//! In: coefficients and a point at z = 1. Out: its distorted or undistorted image. Cost: two polynomials and a
//! division; undistortion takes about four Newton steps of twice that.

use nalgebra::{Matrix2, Vector2};

/// Coefficients of the distortion of normalized image coordinates (`z = 1`).
///
/// `x' = x·ρ + 2·p1·xy + p2·(r² + 2x²) + s1·r² + s2·r⁴` and
/// `y' = y·ρ + p1·(r² + 2y²) + 2·p2·xy + s3·r² + s4·r⁴` with
/// `ρ = (1 + k1·r² + k2·r⁴ + k3·r⁶) / (1 + k4·r² + k5·r⁴ + k6·r⁶)`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Numerator of the radial term: k1, k2, k3.
    pub radial: [f64; 3],
    /// Denominator of the radial term: k4, k5, k6.
    pub rational: [f64; 3],
    /// Tangential term: p1, p2.
    pub tangential: [f64; 2],
    /// Thin-prism term: s1, s2, s3, s4.
    pub thin_prism: [f64; 4],
}

/// Newton steps after which an inversion that has not converged counts as impossible.
const MAX_NEWTON_STEPS: usize = 30;
/// Residual, in normalized coordinates, at which the inversion is accepted (1e-12 · f is far below a pixel).
const NEWTON_TOLERANCE: f64 = 1e-12;
/// Larger radii (79° off axis) are not examined: no scanner lens reaches them.
const MAX_EXAMINED_RADIUS: f64 = 5.0;

impl Distortion {
    /// The distortion from OpenCV's vector of 4, 5, 8 or 12 coefficients: k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4]]].
    ///
    /// Missing coefficients are zero. Further ones are ignored: the caller has checked them.
    #[must_use]
    pub fn from_opencv(coefficients: &[f64]) -> Self {
        let c = |i: usize| coefficients.get(i).copied().unwrap_or(0.0);
        Self {
            radial: [c(0), c(1), c(4)],
            rational: [c(5), c(6), c(7)],
            tangential: [c(2), c(3)],
            thin_prism: [c(8), c(9), c(10), c(11)],
        }
    }

    /// The coefficients in OpenCV's order, 12 of them.
    #[must_use]
    pub fn to_opencv(&self) -> [f64; 12] {
        let ([k1, k2, k3], [k4, k5, k6]) = (self.radial, self.rational);
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.thin_prism);
        [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4]
    }

    /// Distorted normalized coordinates of an ideal point.
    #[must_use]
    pub fn distort(&self, ideal: Vector2<f64>) -> Vector2<f64> {
        let (x, y) = (ideal.x, ideal.y);
        let r2 = x * x + y * y;
        let rho = polynomial(self.radial, r2) / polynomial(self.rational, r2);
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.thin_prism);
        Vector2::new(
            x * rho + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (s1 + s2 * r2),
            y * rho + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (s3 + s4 * r2),
        )
    }

    /// Derivative of [`Self::distort`] at an ideal point.
    #[must_use]
    pub fn jacobian(&self, ideal: Vector2<f64>) -> Matrix2<f64> {
        let (x, y) = (ideal.x, ideal.y);
        let r2 = x * x + y * y;
        let (num, den) = (polynomial(self.radial, r2), polynomial(self.rational, r2));
        let rho = num / den;
        let rho_r2 = (slope(self.radial, r2) - rho * slope(self.rational, r2)) / den;
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.thin_prism);
        let (prism_x, prism_y) = (s1 + 2.0 * s2 * r2, s3 + 2.0 * s4 * r2);
        Matrix2::new(
            rho + 2.0 * x * x * rho_r2 + 2.0 * p1 * y + 6.0 * p2 * x + 2.0 * x * prism_x,
            2.0 * x * y * rho_r2 + 2.0 * p1 * x + 2.0 * p2 * y + 2.0 * y * prism_x,
            2.0 * x * y * rho_r2 + 2.0 * p1 * x + 2.0 * p2 * y + 2.0 * x * prism_y,
            rho + 2.0 * y * y * rho_r2 + 6.0 * p1 * y + 2.0 * p2 * x + 2.0 * y * prism_y,
        )
    }

    /// The ideal point whose distorted image is `distorted`; `None` where the model cannot be inverted.
    #[must_use]
    pub fn undistort(&self, distorted: Vector2<f64>) -> Option<Vector2<f64>> {
        let mut ideal = distorted;
        for _ in 0..MAX_NEWTON_STEPS {
            let residual = self.distort(ideal) - distorted;
            if residual.amax() <= NEWTON_TOLERANCE {
                let jacobian = self.jacobian(ideal);
                // Beyond the fold the mapping reverses its sense: the determinant or the trace turns negative there.
                return (jacobian.determinant() > 0.0 && jacobian.trace() > 0.0).then_some(ideal);
            }
            ideal -= self.jacobian(ideal).try_inverse()? * residual;
            if !(ideal.x.is_finite() && ideal.y.is_finite()) {
                return None;
            }
        }
        None
    }

    /// Largest ideal radius up to which the radial term grows. Up to there no two rays share an image point.
    #[must_use]
    pub fn max_invertible_radius(&self) -> f64 {
        let step = 1e-3;
        let mut radius = 0.0;
        while radius < MAX_EXAMINED_RADIUS {
            let next = radius + step;
            let r2 = next * next;
            let den = polynomial(self.rational, r2);
            let rho = polynomial(self.radial, r2) / den;
            let rho_r2 = (slope(self.radial, r2) - rho * slope(self.rational, r2)) / den;
            // The distorted radius is r·ρ(r²); its derivative is ρ + 2r²·dρ/d(r²).
            if den <= 0.0 || rho + 2.0 * r2 * rho_r2 <= 0.0 {
                return radius;
            }
            radius = next;
        }
        radius
    }
}

/// `1 + c0·t + c1·t² + c2·t³`.
fn polynomial(c: [f64; 3], t: f64) -> f64 {
    1.0 + t * (c[0] + t * (c[1] + t * c[2]))
}

/// Derivative of [`polynomial`] with respect to `t`.
fn slope(c: [f64; 3], t: f64) -> f64 {
    c[0] + t * (2.0 * c[1] + t * 3.0 * c[2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn any_distortion() -> impl Strategy<Value = Distortion> {
        (
            prop::array::uniform3(-0.2..0.2),
            prop::array::uniform3(-0.1..0.1),
            prop::array::uniform2(-0.005..0.005),
            prop::array::uniform4(-0.005..0.005),
        )
            .prop_map(|(radial, rational, tangential, thin_prism)| Distortion {
                radial,
                rational,
                tangential,
                thin_prism,
            })
    }

    proptest! {
        #[test]
        fn undistort_inverts_distort(d in any_distortion(), x in -0.4..0.4, y in -0.4..0.4) {
            let ideal = Vector2::new(x, y);
            let back = d.undistort(d.distort(ideal)).unwrap();
            prop_assert!((back - ideal).amax() < 1e-10);
        }

        #[test]
        fn jacobian_is_the_derivative(d in any_distortion(), x in -0.4..0.4, y in -0.4..0.4) {
            let (at, h) = (Vector2::new(x, y), 1e-6);
            let column = |e: Vector2<f64>| (d.distort(at + e * h) - d.distort(at - e * h)) / (2.0 * h);
            let numeric = Matrix2::from_columns(&[column(Vector2::x()), column(Vector2::y())]);
            prop_assert!((d.jacobian(at) - numeric).amax() < 1e-7);
        }
    }

    #[test]
    fn opencv_order_round_trips() {
        let c: Vec<f64> = (1..=12).map(f64::from).collect();
        assert_eq!(Distortion::from_opencv(&c).to_opencv().to_vec(), c);
    }

    #[test]
    fn a_folding_lens_has_a_limit() {
        let folding = Distortion { radial: [-1.0, 0.0, 0.0], ..Distortion::default() };
        // d/dr (r − r³) = 0 at r = 1/√3.
        assert!((folding.max_invertible_radius() - 1.0 / 3.0_f64.sqrt()).abs() < 2e-3);
        assert!(folding.undistort(Vector2::new(0.6, 0.0)).is_none());
    }
}
