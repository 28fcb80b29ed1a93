//! Distributions of latencies.

use hdrhistogram::Histogram;
use serde::Serialize;

/// Longest latency that is resolved, nanoseconds. Longer ones count as this.
const LONGEST_NS: u64 = 60_000_000_000;
/// Shortest latency that is resolved, nanoseconds.
const SHORTEST_NS: u64 = 1_000;
/// Significant digits of a latency over a whole run, and over a short interval.
const DIGITS: u8 = 2;
const COARSE_DIGITS: u8 = 1;

/// Upper bounds of the histogram buckets in metrics, nanoseconds: six per decade from 0.1 ms to 7 s, and 10 s.
pub const BUCKETS_NS: [u64; 31] = buckets_ns();

const fn buckets_ns() -> [u64; 31] {
    const PER_DECADE: [u64; 6] = [10, 15, 20, 30, 50, 70];
    let mut bounds = [10_000_000_000; 31];
    let (mut index, mut unit) = (0, 10_000);
    while index < 30 {
        bounds[index] = PER_DECADE[index % 6] * unit;
        index += 1;
        if index.is_multiple_of(6) {
            unit *= 10;
        }
    }
    bounds
}

/// Distribution of the latencies of items.
#[derive(Clone, Debug)]
pub struct Latencies {
    digits: u8,
    /// Created with the first latency: in a short interval, most stages have none.
    histogram: Option<Histogram<u32>>,
    /// Counts by bucket. The last bucket is for values above all bounds.
    buckets: [u64; BUCKETS_NS.len() + 1],
    sum_ns: u64,
}

/// Summary of a latency distribution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Latency {
    /// Number of items.
    pub count: u64,
    /// Median.
    pub p50_ms: f64,
    /// 90th percentile.
    pub p90_ms: f64,
    /// 99th percentile.
    pub p99_ms: f64,
    /// Maximum.
    pub max_ms: f64,
}

impl Default for Latencies {
    fn default() -> Self {
        Self::with_digits(DIGITS)
    }
}

impl Latencies {
    /// Creates a distribution for a short interval, which needs less memory. Percentiles are accurate to 6 %.
    #[must_use]
    pub fn coarse() -> Self {
        Self::with_digits(COARSE_DIGITS)
    }

    fn with_digits(digits: u8) -> Self {
        Self { digits, histogram: None, buckets: [0; BUCKETS_NS.len() + 1], sum_ns: 0 }
    }

    /// Records a latency. It counts as 0 if it ends before it begins.
    pub fn record(&mut self, from_ns: u64, to_ns: u64) {
        let latency_ns = to_ns.saturating_sub(from_ns);
        if self.histogram.is_none() {
            // The bounds are valid, so creating the histogram does not fail.
            self.histogram = Histogram::new_with_bounds(SHORTEST_NS, LONGEST_NS, self.digits).ok();
        }
        if let Some(histogram) = &mut self.histogram {
            histogram.saturating_record(latency_ns.clamp(SHORTEST_NS, LONGEST_NS));
        }
        self.buckets[BUCKETS_NS.partition_point(|&bound_ns| bound_ns < latency_ns)] += 1;
        self.sum_ns = self.sum_ns.saturating_add(latency_ns);
    }

    /// Adds all latencies of another distribution.
    pub fn merge(&mut self, other: &Self) {
        match (&mut self.histogram, &other.histogram) {
            // Both have the same bounds, so adding does not fail.
            (Some(histogram), Some(other)) => drop(histogram.add(other)),
            (None, Some(other)) => self.histogram = Some(other.clone()),
            (_, None) => {}
        }
        for (count, other) in self.buckets.iter_mut().zip(&other.buckets) {
            *count += other;
        }
        self.sum_ns = self.sum_ns.saturating_add(other.sum_ns);
    }

    /// Returns the percentiles, or `None` if nothing was recorded.
    #[must_use]
    pub fn brief(&self) -> Option<Latency> {
        let histogram = self.histogram.as_ref()?;
        let at = |quantile| histogram.value_at_quantile(quantile) as f64 * 1e-6;
        Some(Latency {
            count: histogram.len(),
            p50_ms: at(0.5),
            p90_ms: at(0.9),
            p99_ms: at(0.99),
            max_ms: histogram.max() as f64 * 1e-6,
        })
    }

    /// Number of latencies.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.buckets.iter().sum()
    }

    /// Sum of the latencies, nanoseconds.
    #[must_use]
    pub fn sum_ns(&self) -> u64 {
        self.sum_ns
    }

    /// Counts by bucket of [`BUCKETS_NS`], not cumulative. The last bucket is for values above all bounds.
    #[must_use]
    pub fn buckets(&self) -> &[u64; BUCKETS_NS.len() + 1] {
        &self.buckets
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn bounds_rise_and_end_at_ten_seconds() {
        assert!(BUCKETS_NS.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(
            (BUCKETS_NS[0], BUCKETS_NS[6], BUCKETS_NS[29], BUCKETS_NS[30]),
            (100_000, MS, 7_000 * MS, 10_000 * MS)
        );
    }

    #[test]
    fn percentiles_lie_in_the_bucket_that_holds_them() {
        let mut latencies = Latencies::default();
        (1..=1000).for_each(|ms| latencies.record(7, 7 + ms * MS));
        let brief = latencies.brief().unwrap();
        assert_eq!((brief.count, latencies.count(), latencies.sum_ns()), (1000, 1000, 500_500 * MS));
        for (percentile, expected) in [(brief.p50_ms, 500.0), (brief.p90_ms, 900.0), (brief.p99_ms, 990.0)] {
            assert!((percentile / expected - 1.0).abs() < 0.02, "{percentile} for {expected}");
        }
        let up_to_half_a_second: u64 = latencies
            .buckets()
            .iter()
            .zip(BUCKETS_NS)
            .take_while(|(_, bound)| *bound <= 500 * MS)
            .map(|(n, _)| n)
            .sum();
        assert_eq!(up_to_half_a_second, 500);
    }

    #[test]
    fn too_long_or_negative_latencies_count_in_the_outer_buckets() {
        let mut latencies = Latencies::default();
        latencies.record(9, 5);
        latencies.record(0, 3_600_000 * MS);
        assert_eq!((latencies.buckets()[0], latencies.buckets()[31], latencies.count()), (1, 1, 2));
        assert!((latencies.brief().unwrap().max_ms / 60_000.0 - 1.0).abs() < 0.02);
    }

    #[test]
    fn merged_latencies_equal_one_distribution_of_all() {
        let (mut one, mut two, mut both) = (Latencies::coarse(), Latencies::coarse(), Latencies::coarse());
        for ms in 1..50 {
            for (latencies, ns) in [(&mut one, ms * MS), (&mut two, 3 * ms * MS)] {
                latencies.record(0, ns);
                both.record(0, ns);
            }
        }
        let mut merged = Latencies::coarse();
        merged.merge(&one);
        merged.merge(&two);
        assert_eq!((merged.brief(), merged.buckets(), merged.sum_ns()), (both.brief(), both.buckets(), both.sum_ns()));
        assert_eq!(Latencies::default().brief(), None);
    }
}
