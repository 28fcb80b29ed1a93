//! Histograms over the pixels of an image. In: values. Out: quantiles. Cost: an increment per value. Counts are whole
//! numbers, so partial histograms can be added in any order.

use fringeflow_simd::{LANES, Lanes};

/// Copies of every counter, used in turn. Neighbouring pixels mostly fall into the same bin, and an increment would
/// have to wait for the one before.
const COPIES: usize = 4;

/// Histogram of `BINS` bins of equal width, at most 2^16.
#[derive(Clone, Debug)]
pub(super) struct Histogram<const BINS: usize> {
    /// The copies of a counter are next to each other: at distances of whole pages their addresses would alias.
    counts: [[u32; COPIES]; BINS],
}

impl<const BINS: usize> Default for Histogram<BINS> {
    fn default() -> Self {
        Self { counts: [[0; COPIES]; BINS] }
    }
}

impl<const BINS: usize> Histogram<BINS> {
    /// Counts a value, given in bins. Values outside the range count in the first or last bin.
    pub(super) fn add(&mut self, bins: f32) {
        let count = &mut self.counts[(bins as usize).min(BINS - 1)][0];
        // `remove` may have wrapped this counter below zero: other copies hold the rest.
        *count = count.wrapping_add(1);
    }

    /// Removes a value that was counted.
    pub(super) fn remove(&mut self, bins: f32) {
        let count = &mut self.counts[(bins as usize).min(BINS - 1)][0];
        *count = count.wrapping_sub(1);
    }

    /// Counts 32 values, given in bins. Value k counts only if bit k of `used` is set.
    #[inline(always)]
    pub(super) fn add_block<L: Lanes>(&mut self, lanes: L, bins: L::Reals, used: u32) {
        let l = lanes;
        let mut indices = [0; LANES];
        l.store_real_words(l.min_real(l.max_real(bins, l.real(0.0)), l.real((BINS - 1) as f32)), &mut indices);
        // `% BINS` changes nothing; it proves to the compiler that the index is in range.
        if used == u32::MAX {
            for indices in indices.as_chunks::<COPIES>().0 {
                for (copy, &index) in indices.iter().enumerate() {
                    self.counts[usize::from(index) % BINS][copy] += 1;
                }
            }
        } else {
            let mut remaining = used;
            while remaining != 0 {
                let k = remaining.trailing_zeros() as usize;
                self.counts[usize::from(indices[k]) % BINS][k % COPIES] += 1;
                remaining &= remaining - 1;
            }
        }
    }

    /// Adds the counts of another histogram.
    pub(super) fn merge(&mut self, other: &Self) {
        let (mine, theirs) = (self.counts.as_flattened_mut(), other.counts.as_flattened());
        mine.iter_mut().zip(theirs).for_each(|(m, t)| *m = m.wrapping_add(*t));
    }

    /// Number of values.
    pub(super) fn len(&self) -> u64 {
        (0..BINS).map(|bin| self.count(bin)).sum()
    }

    /// Quantile `share` of the values, as a fraction of the range.
    pub(super) fn quantile(&self, share: f64) -> f32 {
        quantile((0..BINS).map(|bin| self.count(bin)), share)
    }

    /// Number of values in a bin.
    pub(super) fn count(&self, bin: usize) -> u64 {
        // A value may have been counted in one copy and removed from another: only their wrapping sum is meaningful.
        u64::from(self.counts[bin].iter().fold(0_u32, |sum, &count| sum.wrapping_add(count)))
    }
}

/// Quantile `share` of a histogram with these counts, as a fraction of its range.
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
