//! Normally distributed random numbers.

use std::f64::consts::TAU;

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

/// Draws a standard normal number (Box and Muller 1958).
pub(crate) fn standard_normal(rng: &mut ChaCha8Rng) -> f64 {
    let (a, b): (f64, f64) = (rng.random(), rng.random());
    // 1 − a is never zero.
    (-2.0 * (1.0 - a).ln()).sqrt() * (TAU * b).cos()
}
