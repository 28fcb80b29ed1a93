//! Random numbers for tests.

/// Random numbers below a bound, from a linear congruential generator (Knuth): every run gives the same.
pub(super) fn random(mut state: u64) -> impl FnMut(u64) -> u64 {
    move |below| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    }
}
