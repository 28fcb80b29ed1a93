//! The slowest windows of a run.

use super::Journey;

/// The slowest journeys, the slowest first. Among equals, the first to arrive comes first.
#[derive(Clone, Debug)]
pub struct WorstWindows {
    max_count: usize,
    journeys: Vec<Journey>,
}

impl WorstWindows {
    /// Creates an empty list of at most `max_count` journeys.
    #[must_use]
    pub fn new(max_count: usize) -> Self {
        Self { max_count, journeys: Vec::new() }
    }

    /// Adds a journey.
    pub fn add(&mut self, journey: &Journey) {
        let index = self.journeys.partition_point(|other| other.total_ns() >= journey.total_ns());
        if index < self.max_count {
            self.journeys.truncate(self.max_count - 1);
            self.journeys.insert(index, *journey);
        }
    }

    /// The journeys.
    #[must_use]
    pub fn journeys(&self) -> &[Journey] {
        &self.journeys
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_longest_are_kept_in_their_order() {
        let mut worst = WorstWindows::new(3);
        for (exposure_start_ns, total_ns) in [(0, 5), (10, 9), (20, 1), (30, 7), (40, 9), (50, 2)] {
            let end_ns = exposure_start_ns + total_ns;
            worst.add(&Journey { exposure_start_ns, ends_ns: [end_ns; 7] });
        }
        let kept: Vec<_> = worst.journeys().iter().map(|j| (j.exposure_start_ns, j.total_ns())).collect();
        assert_eq!(kept, [(10, 9), (40, 9), (30, 7)]);
        let mut none = WorstWindows::new(0);
        none.add(&Journey { exposure_start_ns: 0, ends_ns: [1; 7] });
        assert!(none.journeys().is_empty());
    }
}
