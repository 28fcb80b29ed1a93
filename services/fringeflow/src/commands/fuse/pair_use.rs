//! How many image pairs of a recording the clouds of a fused scan use, and why others are left out.

use std::fmt;
use std::ops::Range;

use serde::Serialize;

/// Image pairs of the chosen range. `given = used + skipped + alone`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct PairUse {
    given: usize,
    /// Pairs in the window of a cloud.
    used: usize,
    /// Pairs that only windows between the chosen ones would use, as `--every` demands.
    skipped: usize,
    /// Pairs in no complete window, because an image or a step beside them is missing.
    alone: usize,
}

impl PairUse {
    /// Counts the pairs `within` that the chosen `windows` use. `all` are all windows that are possible.
    pub(super) fn new(within: &Range<usize>, windows: &[Range<usize>], all: &[Range<usize>]) -> Self {
        let count = |windows: &[Range<usize>]| {
            let mut next = within.start;
            windows.iter().fold(0, |sum, window| {
                let added = window.end.saturating_sub(window.start.max(next));
                next = next.max(window.end);
                sum + added
            })
        };
        let (given, used, possible) = (within.len(), count(windows), count(all));
        Self { given, used, skipped: possible - used, alone: given - possible }
    }
}

impl fmt::Display for PairUse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { given, used, skipped, alone } = self;
        write!(f, "{given}: {used} used, {skipped} between the clouds, {alone} beside a missing image or step")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pair_is_used_skipped_or_alone() {
        // Pairs 0 to 9 and 12 to 18 follow each other, and a window has 6 pairs.
        let all: Vec<_> = (0..=4).chain(12..=13).map(|start| start..start + 6).collect();
        let pairs = PairUse::new(&(0..20), &[0..6, 4..10, 12..18], &all);
        assert_eq!(pairs, PairUse { given: 20, used: 16, skipped: 1, alone: 3 });
        let pairs = PairUse::new(&(0..20), &[0..6, 12..18], &all);
        assert_eq!(pairs, PairUse { given: 20, used: 12, skipped: 5, alone: 3 });
        assert_eq!(pairs.given, pairs.used + pairs.skipped + pairs.alone);
    }
}
