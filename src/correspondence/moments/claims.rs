//! Awards each place of C2 to one of the pixels that claim it.

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::nodes::NONE;

/// Pixels that a task handles, at least.
pub(super) const MIN_PIXELS: usize = 4096;

/// Scratch memory of awards.
#[derive(Debug, Default)]
pub(super) struct Claims {
    /// The best bid for each place; 0 if there is none.
    bids: Vec<AtomicU64>,
}

impl Clone for Claims {
    /// Nothing is kept from award to award.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Claims {
    /// Awards each place to the best founded pixel that claims it, and to the first of those that are founded alike.
    /// `places` holds the place of each pixel, or [`NONE`]; `owners` is set to the pixel of each place, or [`NONE`].
    ///
    /// The greatest bid wins whatever the order of the bids, so the number of threads changes nothing.
    pub(super) fn award(&mut self, places: &[u32], founded: impl Fn(usize) -> f32 + Sync, owners: &mut [u32]) {
        let Self { bids } = self;
        bids.resize_with(owners.len(), AtomicU64::default);
        bids.par_iter_mut().with_min_len(MIN_PIXELS).for_each(|bid| *bid.get_mut() = 0);
        let claims = places.par_iter().with_min_len(MIN_PIXELS).enumerate().filter(|(_, place)| **place != NONE);
        claims.for_each(|(pixel, &place)| {
            bids[place as usize].fetch_max(bid(founded(pixel), pixel as u32), Ordering::Relaxed);
        });
        owners.par_iter_mut().zip(bids).with_min_len(MIN_PIXELS).for_each(|(owner, bid)| {
            let bid = *bid.get_mut();
            *owner = if bid == 0 { NONE } else { !(bid as u32) };
        });
    }
}

/// A number that is greater for pixels that are better founded, and among equals for those that come first.
fn bid(founded: f32, pixel: u32) -> u64 {
    // Zero has two signs. Then the order of floats is that of integers, backwards for negative ones.
    let bits = (founded + 0.0).to_bits();
    let rank = if bits >> 31 == 0 { bits | 1 << 31 } else { !bits };
    u64::from(rank) << 32 | u64::from(!pixel)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bids_are_ordered_as_what_they_stand_for() {
        let founded = [f32::MIN, -3.5, -1e-30, 0.0, 1e-30, 2.0, 7.0, f32::MAX];
        assert!(founded.windows(2).all(|pair| bid(pair[0], 0) < bid(pair[1], 5)));
        assert!(bid(-0.0, 3) == bid(0.0, 3) && bid(1.0, 4) > bid(1.0, 5) && bid(f32::MIN, u32::MAX - 1) > 0);
    }

    #[test]
    fn the_best_founded_pixel_gets_the_place_and_the_first_of_equals() {
        let mut owners = vec![0; 4];
        let founded = [1.0, 2.0, 2.0, -5.0, 0.5];
        Claims::default().award(&[0, 0, 0, 2, NONE], |pixel| founded[pixel], &mut owners);
        assert_eq!(owners, [1, NONE, 3, NONE]);
    }
}
