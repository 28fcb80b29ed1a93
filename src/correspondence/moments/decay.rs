//! The exponential function, the same on every machine.

/// e^(−x) for x ≥ 0, exact to 1e-6, and 0 beyond 18. The C library differs from processor to processor in the last bit.
#[inline(always)]
pub(super) const fn decay(x: f64) -> f64 {
    /// Squarings that undo the division of the exponent.
    const SQUARINGS: i32 = 5;
    if x > 18.0 {
        return 0.0;
    }
    let x = x / (1 << SQUARINGS) as f64;
    let mut value = 1.0 - x * (1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0)))));
    let mut squared = 0;
    while squared < SQUARINGS {
        value *= value;
        squared += 1;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_exponential_function() {
        for i in 0..180 {
            let x = f64::from(i) / 10.0;
            assert!((decay(x) - (-x).exp()).abs() < 1e-6, "{x}: {} {}", decay(x), (-x).exp());
        }
        assert_eq!(decay(18.1), 0.0);
    }
}
