//! Settled paths: one order costs nothing, all others the price of a change.

use crate::correspondence::semi_global::cost_table::UNITS_PER_NAT;
use crate::correspondence::semi_global::links::MAX_SHIFT;
use crate::correspondence::semi_global::order_ranges::MAX_LANES;

/// Price of a change of order where the wrapped phase continues, nats.
const CHANGE_NATS: f32 = 8.0;
pub(super) const CHANGE: u16 = (CHANGE_NATS * UNITS_PER_NAT) as u16;
const _: () = assert!(CHANGE < u8::MAX as u16);

/// Costs of a settled pixel, with a margin on either side for shifted ranges.
pub(super) static SETTLED: [u8; 2 * (MAX_LANES + MAX_SHIFT)] = {
    let mut costs = [CHANGE as u8; 2 * (MAX_LANES + MAX_SHIFT)];
    costs[MAX_LANES + MAX_SHIFT] = 0;
    costs
};

/// The costs of a pixel settled on the order in `place`, `lanes` of them from `shift` on.
#[inline(always)]
pub(super) fn settled(place: usize, shift: usize, lanes: usize) -> &'static [u8] {
    &SETTLED[MAX_LANES + shift - place..][..lanes]
}

/// Index of the first zero byte, from the lowest on; 8 if there is none.
#[inline(always)]
pub(super) fn place_of_zero(bytes: u64) -> usize {
    // The subtraction borrows from the lowest zero byte first.
    let (lowest, highest) = (u64::MAX / 255, u64::MAX / 255 * 128);
    let zeros = bytes.wrapping_sub(lowest) & !bytes & highest;
    zeros.trailing_zeros() as usize / 8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_zero_is_found() {
        let place = |bytes: [u8; 8]| place_of_zero(u64::from_le_bytes(bytes));
        assert_eq!(place([1, 0, 255, 0, 3, 1, 0, 7]), 1);
        assert_eq!(place([1, 128, 255, 1, 3, 1, 9, 0]), 7);
        assert_eq!(place([1, 128, 255, 1, 3, 1, 9, 2]), 8);
    }
}
