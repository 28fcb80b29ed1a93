//! The exponential function, the same on every machine.

/// e^(−x) for x ≥ 0, exact to 1e-6, and 0 beyond 18. The C library differs from processor to processor in the last bit.
#[inline(always)]
pub(super) fn decay(x: f64) -> f64 {
    /// Squarings that undo the division of the exponent.
    const SQUARINGS: i32 = 5;
    if x > 18.0 {
        return 0.0;
    }
    let x = x / f64::from(1 << SQUARINGS);
    let series = 1.0 - x * (1.0 - x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0)))));
    (0..SQUARINGS).fold(series, |value, _| value * value)
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
