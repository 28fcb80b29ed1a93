//! Histograms of the pixels of an image, which add up in any order.

use fringeflow_simd::{LANES, Lanes};

/// Counts that neighbours take turns at: most of them fall into the same bin, and each would wait for the one before.
const TURNS: usize = 4;

/// How many values fall into each of some equal parts of a range; 2^16 at most.
#[derive(Clone, Debug)]
pub(super) struct Histogram<const BINS: usize> {
    /// By bin: turns side by side, for distances of whole pages would look like the same place to the processor.
    counts: [[u32; TURNS]; BINS],
}

impl<const BINS: usize> Default for Histogram<BINS> {
    fn default() -> Self {
        Self { counts: [[0; TURNS]; BINS] }
    }
}

impl<const BINS: usize> Histogram<BINS> {
    /// Counts a value, given in bins; what is beyond the ends of the range counts there.
    pub(super) fn add(&mut self, bins: f32) {
        let count = &mut self.counts[(bins as usize).min(BINS - 1)][0];
        // More may have been taken away here than was counted here.
        *count = count.wrapping_add(1);
    }

    /// Takes a value away that was counted.
    pub(super) fn remove(&mut self, bins: f32) {
        let count = &mut self.counts[(bins as usize).min(BINS - 1)][0];
        *count = count.wrapping_sub(1);
    }

    /// Counts those of 32 values, in bins, that are used: bit k says it of value k.
    #[inline(always)]
    pub(super) fn add_block<L: Lanes>(&mut self, lanes: L, bins: L::Reals, used: u32) {
        let l = lanes;
        let mut places = [0; LANES];
        l.store_real_words(l.min_real(l.max_real(bins, l.real(0.0)), l.real((BINS - 1) as f32)), &mut places);
        if used == u32::MAX {
            for places in places.as_chunks::<TURNS>().0 {
                for (turn, &place) in places.iter().enumerate() {
                    self.counts[usize::from(place) % BINS][turn] += 1;
                }
            }
        } else {
            let mut left = used;
            while left != 0 {
                let k = left.trailing_zeros() as usize;
                self.counts[usize::from(places[k]) % BINS][k % TURNS] += 1;
                left &= left - 1;
            }
        }
    }

    /// Adds the counts of another.
    pub(super) fn merge(&mut self, other: &Self) {
        let (mine, theirs) = (self.counts.as_flattened_mut(), other.counts.as_flattened());
        mine.iter_mut().zip(theirs).for_each(|(m, t)| *m = m.wrapping_add(*t));
    }

    /// How many values were counted.
    pub(super) fn len(&self) -> u64 {
        (0..BINS).map(|bin| self.count(bin)).sum()
    }

    /// The value that a share of all does not exceed, as a fraction of the range.
    pub(super) fn quantile(&self, share: f64) -> f32 {
        quantile((0..BINS).map(|bin| self.count(bin)), share)
    }

    /// How many values a bin has.
    pub(super) fn count(&self, bin: usize) -> u64 {
        // What was taken away may have been counted at another turn.
        u64::from(self.counts[bin].iter().fold(0_u32, |sum, &count| sum.wrapping_add(count)))
    }
}

/// The value that a share of all does not exceed, as a fraction of the range of bins with these counts.
pub(super) fn quantile(counts: impl ExactSizeIterator<Item = u64> + Clone, share: f64) -> f32 {
    let bins = counts.len();
    let wanted = (counts.clone().sum::<u64>() as f64 * share).ceil() as u64;
    let bin = counts
        .scan(0, |below, count| {
            *below += count;
            Some(*below)
        })
        .position(|below| below >= wanted);
    (bin.unwrap_or(0) as f32 + 0.5) / bins as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_simd::{Kernel, Level};

    const BINS: usize = 1024;

    struct Count<'a>(&'a mut Histogram<BINS>, &'a [f32; LANES], u32);

    impl Kernel for Count<'_> {
        type Output = ();

        #[inline(always)]
        fn run<L: Lanes>(self, lanes: L) {
            let values = lanes.load_reals(self.1);
            self.0.add_block(lanes, values, self.2);
        }
    }

    #[test]
    fn blocks_count_as_their_values_do() {
        let values: [f32; LANES] = std::array::from_fn(|k| (k * k) as f32 * 1.7 - 9.0);
        for level in Level::ALL {
            for used in [u32::MAX, 0, 0x1234_5678] {
                let (mut one_by_one, mut at_once) = (Histogram::<BINS>::default(), Histogram::default());
                fringeflow_simd::run(level, Count(&mut at_once, &values, used));
                (0..LANES).filter(|k| used >> k & 1 == 1).for_each(|k| one_by_one.add(values[k]));
                assert_eq!(at_once.len(), u64::from(used.count_ones()));
                assert!((0..BINS).all(|bin| at_once.count(bin) == one_by_one.count(bin)));
                (0..LANES).filter(|k| used >> k & 1 == 1).for_each(|k| at_once.remove(values[k]));
                assert_eq!(at_once.len(), 0);
            }
        }
    }

    #[test]
    fn quantiles_are_those_of_the_values() {
        let mut histogram = Histogram::<BINS>::default();
        (0..1000).for_each(|k| histogram.add(k as f32));
        assert!((histogram.quantile(0.5) - 500.0 / 1024.0).abs() < 1e-3);
        assert!((histogram.quantile(0.95) - 950.0 / 1024.0).abs() < 1e-3);
    }
}
