//! Phase shifts of a pattern sequence, and the weights of the least-squares phase (paper, section 2.1). In: N shifts.
//! Out: N weights for each of three sums. Cost: once per sequence.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};

use fringeflow_base::limits::{MAX_STEPS, MIN_STEPS};

/// Shifts count as equally spaced up to this deviation, rad (files hold ten digits).
const SPACING_TOLERANCE_RAD: f64 = 1e-6;
/// Smallest eigenvalue of the normal matrix, per step, that determines all three unknowns.
const MIN_EIGENVALUE: f64 = 1e-3;

/// Phase shifts `s_k` of N images with the weights of their least-squares solution.
///
/// The images are linear in (A, C, S) with `C = B·cos φ`, `S = B·sin φ`: `I_k = A + C·cos s_k − S·sin s_k`.
///
/// ```
/// use fringeflow::phase::PhaseShifts;
///
/// let four_steps = PhaseShifts::new(&[0.0, 90.0, 180.0, 270.0].map(f64::to_radians))?;
/// assert_eq!(four_steps.steps(), 4);
/// // Noise of one grey level at a modulation of 50 makes this standard deviation of the phase, rad: √(2/N)/50.
/// assert!((four_steps.noise_gain() / 50.0 - 0.0141).abs() < 1e-4);
/// // Shifts that are equal modulo 2π do not determine a phase.
/// assert!(PhaseShifts::new(&[0.0, 90.0, 360.0].map(f64::to_radians)).is_err());
/// # Ok::<(), fringeflow::phase::ShiftError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseShifts {
    steps: usize,
    /// Zero beyond the number of steps, like the weights.
    shifts_rad: [f64; MAX_STEPS],
    /// Rows of the solution: A, C and S as weighted sums of the images.
    weights: [[f32; MAX_STEPS]; 3],
}

/// Why shifts do not determine a phase.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ShiftError {
    /// Too few or too many shifts.
    #[error("{steps} phase images were given; a sequence has {MIN_STEPS} to {MAX_STEPS}")]
    Steps {
        /// Number of shifts.
        steps: usize,
    },
    /// Too few or too many images in a window of a moving scene.
    #[error("a window has {images} images; to separate motion from phase it must have {least} to {most}")]
    Window {
        /// Images of the window.
        images: usize,
        /// Fewest allowed.
        least: usize,
        /// Most allowed.
        most: usize,
    },
    /// A shift is NaN or infinite.
    #[error("phase shift {index} is {value}; every shift must be a finite number")]
    NotFinite {
        /// Index of the shift, from 0.
        index: usize,
        /// Its value.
        value: f64,
    },
    /// The shifts do not differ enough.
    #[error(
        "the phase shifts {shifts_rad:.4?} rad do not determine a phase: at least three of them must differ clearly \
         (modulo 2π)"
    )]
    Degenerate {
        /// The shifts, rad.
        shifts_rad: Vec<f64>,
    },
}

/// A unit in which phase shifts are given in the place of radians.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MistakenUnit {
    /// All are multiples of half a degree, and some are more than a turn in radians. Radians of a cycle are fractions of
    /// 2π and never are.
    Degrees,
    /// They divide one evenly.
    Turns,
}

impl MistakenUnit {
    /// The unit of phase shifts that should be in radians, if it seems to be another one.
    #[must_use]
    pub fn of_shifts(shifts_rad: &[f64]) -> Option<Self> {
        let mut in_order = shifts_rad.to_vec();
        in_order.sort_by(f64::total_cmp);
        in_order.dedup();
        let distinct = in_order.len() as f64;
        let divides_one = |(k, shift): (usize, &f64)| (shift - in_order[0] - k as f64 / distinct).abs() < 1e-3;
        if shifts_rad.iter().all(|shift| (2.0 * shift).fract() == 0.0) && shifts_rad.iter().any(|s| s.abs() > TAU) {
            Some(Self::Degrees)
        } else if in_order.len() >= MIN_STEPS && in_order.iter().enumerate().all(divides_one) {
            Some(Self::Turns)
        } else {
            None
        }
    }

    /// What to do about it.
    #[must_use]
    pub fn remedy(self) -> &'static str {
        match self {
            Self::Degrees => "these look like degrees; write radians: degrees · π / 180",
            Self::Turns => "these look like turns; write radians: turns · 2π",
        }
    }
}

impl PhaseShifts {
    /// Shifts of N images, rad.
    ///
    /// Equally spaced shifts get the closed-form weights `1/N`, `2/N·cos s_k`, `−2/N·sin s_k`; others get the general
    /// least-squares solution.
    ///
    /// # Errors
    /// Fewer than 3 or more than 16 shifts, a shift that is not finite, or shifts that do not determine a phase.
    pub fn new(shifts_rad: &[f64]) -> Result<Self, ShiftError> {
        let steps = shifts_rad.len();
        if !(MIN_STEPS..=MAX_STEPS).contains(&steps) {
            return Err(ShiftError::Steps { steps });
        }
        if let Some(index) = shifts_rad.iter().position(|s| !s.is_finite()) {
            return Err(ShiftError::NotFinite { index, value: shifts_rad[index] });
        }
        Self::solved(shifts_rad).ok_or_else(|| ShiftError::Degenerate { shifts_rad: shifts_rad.to_vec() })
    }

    /// Finite shifts of 3 to 16 images; `None` if they do not determine a phase.
    pub(super) fn solved(shifts_rad: &[f64]) -> Option<Self> {
        let weights = match even_order(shifts_rad) {
            Some(_) => equal_weights(shifts_rad),
            None => least_squares_weights(shifts_rad)?,
        };
        let weights = weights.map(|row| row.map(|weight| weight as f32));
        Some(Self { steps: shifts_rad.len(), shifts_rad: fringeflow_simd::filled(shifts_rad, 0.0), weights })
    }

    /// Number of images N.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// 1.0 if every shift is 2π/N more than the one before, −1.0 if every shift is 2π/N less, otherwise `None`.
    ///
    /// Such a cycle, started at another step, is the same cycle with another phase.
    #[must_use]
    pub fn even_direction(&self) -> Option<f64> {
        let step = TAU / self.steps() as f64;
        let deviation = |pair: &[f64], direction: f64| {
            ((pair[1] - pair[0]) * direction - step + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU
        };
        [1.0, -1.0].into_iter().find(|&direction| {
            self.shifts_rad().windows(2).all(|pair| deviation(pair, direction).abs() < SPACING_TOLERANCE_RAD)
        })
    }

    /// The shifts, rad.
    #[must_use]
    pub fn shifts_rad(&self) -> &[f64] {
        &self.shifts_rad[..self.steps]
    }

    /// The images by rising shift, starting with the first image; `None` if the shifts are not equally spaced.
    pub(super) fn even_order(&self) -> Option<[usize; MAX_STEPS]> {
        even_order(self.shifts_rad())
    }

    /// Weights in A, C and S of images with these angles (rad). The angles are equally spaced if the shifts are.
    pub(super) fn weights_at(&self, angles_rad: &[f64]) -> [[f64; MAX_STEPS]; 3] {
        let solved = if self.even_order().is_some() { None } else { least_squares_weights(angles_rad) };
        solved.unwrap_or_else(|| equal_weights(angles_rad))
    }

    /// Weights of the images in A, C and S, N each.
    pub(super) fn weights(&self) -> [&[f32]; 3] {
        self.weights.each_ref().map(|row| &row[..self.steps])
    }

    /// Standard deviation of the phase per unit of noise ÷ modulation; √(2/N) for equally spaced shifts.
    #[must_use]
    pub fn noise_gain(&self) -> f64 {
        let norm = |w: &[f32]| w.iter().map(|&w| f64::from(w) * f64::from(w)).sum::<f64>();
        (0.5 * (norm(&self.weights[1]) + norm(&self.weights[2]))).sqrt()
    }
}

/// The images by rising shift, starting with the first image, if the shifts are 2π/N apart in any order.
fn even_order(shifts_rad: &[f64]) -> Option<[usize; MAX_STEPS]> {
    let step = TAU / shifts_rad.len() as f64;
    let (mut order, mut taken) = ([0; MAX_STEPS], [false; MAX_STEPS]);
    // Every image must hit one of N equally spaced slots that no other image hits.
    let is_even = shifts_rad.iter().enumerate().all(|(image, s)| {
        let place = (s - shifts_rad[0]).rem_euclid(TAU) / step;
        let slot = place.round() as usize % shifts_rad.len();
        order[slot] = image;
        let fits = (place - place.round()).abs() * step < SPACING_TOLERANCE_RAD;
        fits && !std::mem::replace(&mut taken[slot], true)
    });
    is_even.then_some(order)
}

fn equal_weights(shifts_rad: &[f64]) -> [[f64; MAX_STEPS]; 3] {
    let n = shifts_rad.len() as f64;
    weights_of(shifts_rad, |s| [1.0 / n, 2.0 / n * s.cos(), -2.0 / n * s.sin()])
}

/// Weights of each shift in the three sums; zero beyond the number of shifts.
fn weights_of(shifts_rad: &[f64], weights: impl Fn(f64) -> [f64; 3]) -> [[f64; MAX_STEPS]; 3] {
    let mut all = [[0.0; MAX_STEPS]; 3];
    for (k, &shift_rad) in shifts_rad.iter().enumerate() {
        all.iter_mut().zip(weights(shift_rad)).for_each(|(row, weight)| row[k] = weight);
    }
    all
}

fn least_squares_weights(shifts_rad: &[f64]) -> Option<[[f64; MAX_STEPS]; 3]> {
    let row = |s: f64| Vector3::new(1.0, s.cos(), -s.sin());
    let normal: Matrix3<f64> = shifts_rad.iter().map(|&s| row(s) * row(s).transpose()).sum();
    let smallest = normal.symmetric_eigenvalues().min();
    if smallest < MIN_EIGENVALUE * shifts_rad.len() as f64 {
        return None;
    }
    let inverse = normal.try_inverse()?;
    Some(weights_of(shifts_rad, |s| (inverse * row(s)).into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_spacing_is_the_special_case_of_least_squares() {
        for n in MIN_STEPS..=MAX_STEPS {
            // Any start, sense and order.
            let shifts: Vec<f64> = (0..n).rev().map(|k| 0.3 - TAU * k as f64 / n as f64).collect();
            assert!(even_order(&shifts).is_some());
            let (closed, general) = (equal_weights(&shifts), least_squares_weights(&shifts).unwrap());
            for (a, b) in closed.iter().flatten().zip(general.iter().flatten()) {
                assert!((a - b).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn noise_gain_is_the_textbook_value() {
        let shifts: Vec<f64> = (0..8).map(|k| TAU * f64::from(k) / 8.0).collect();
        assert!((PhaseShifts::new(&shifts).unwrap().noise_gain() - 0.5).abs() < 1e-6);
    }

    #[test]
    fn shifts_that_determine_nothing_are_refused() {
        assert!(matches!(PhaseShifts::new(&[0.0, 1.0]), Err(ShiftError::Steps { steps: 2 })));
        assert!(matches!(PhaseShifts::new(&[1.0; 5]), Err(ShiftError::Degenerate { .. })));
        assert!(matches!(PhaseShifts::new(&[0.0, 1.0, TAU, 1.0 + TAU]), Err(ShiftError::Degenerate { .. })));
        assert!(matches!(PhaseShifts::new(&[0.0, f64::NAN, 1.0]), Err(ShiftError::NotFinite { index: 1, .. })));
    }
}
