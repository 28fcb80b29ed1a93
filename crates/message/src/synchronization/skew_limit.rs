//! Refuses pairs whose exposures start too far apart, and tells when this begins and ends.
//!
//! In: the skew of each pair. Out: whether the pair is used; a notice with the first refused pair, and another one when
//! the cameras have been together again for some time. So two cameras that run free and drift through each other give
//! a few notices and not one for every pair. The times are those of the exposures; the code reads no clock.

use std::collections::VecDeque;

/// Time without a refused pair after which the cameras count as together again, nanoseconds. Two cameras at 30 and
/// 29.97 images per second are together for about 3 s in every 33 s: for them one notice is enough.
const CALM_NS: u64 = 10_000_000_000;

/// The skew of the cameras began or ceased to exceed its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SkewNotice {
    /// A pair was refused, after a time without refused pairs.
    Began {
        /// Delay of the exposure of camera 2 after that of camera 1, nanoseconds.
        skew_ns: i64,
        /// The limit, nanoseconds.
        max_skew_ns: u64,
    },
    /// No pair was refused for some time, or the run has ended.
    Ended {
        /// Pairs refused since the beginning.
        refused_pairs: u64,
    },
}

/// Judges the skew of pairs.
#[derive(Debug)]
pub(super) struct SkewLimit {
    max_skew_ns: u64,
    refusals: Option<Refusals>,
    notices: VecDeque<SkewNotice>,
}

/// Refused pairs since the last notice that told their beginning.
#[derive(Clone, Copy, Debug)]
struct Refusals {
    pairs: u64,
    /// Exposure of the last one.
    last_ns: u64,
}

impl SkewLimit {
    pub(super) fn new(max_skew_ns: u64) -> Self {
        Self { max_skew_ns, refusals: None, notices: VecDeque::new() }
    }

    /// Whether a pair may be used. `exposure_start_ns` is that of camera 1.
    pub(super) fn admits(&mut self, skew_ns: i64, exposure_start_ns: u64) -> bool {
        let is_admitted = skew_ns.unsigned_abs() <= self.max_skew_ns;
        match &mut self.refusals {
            None if is_admitted => {}
            None => {
                self.refusals = Some(Refusals { pairs: 1, last_ns: exposure_start_ns });
                self.notices.push_back(SkewNotice::Began { skew_ns, max_skew_ns: self.max_skew_ns });
            }
            Some(refusals) if is_admitted => {
                if exposure_start_ns.saturating_sub(refusals.last_ns) >= CALM_NS {
                    self.end();
                }
            }
            Some(refusals) => *refusals = Refusals { pairs: refusals.pairs + 1, last_ns: exposure_start_ns },
        }
        is_admitted
    }

    /// Whether pairs are refused at present.
    pub(super) fn is_refusing(&self) -> bool {
        self.refusals.is_some()
    }

    /// Returns the next notice.
    pub(super) fn next_notice(&mut self) -> Option<SkewNotice> {
        self.notices.pop_front()
    }

    /// Tells the number of refused pairs, if there are any.
    pub(super) fn end(&mut self) {
        let refusals = self.refusals.take();
        self.notices.extend(refusals.map(|refusals| SkewNotice::Ended { refused_pairs: refusals.pairs }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn refusals_are_told_when_they_begin_and_when_they_have_ceased() {
        let mut limit = SkewLimit::new(2 * MS);
        let mut admit = |skew_ms: i64, at_ms: u64| {
            let is_admitted = limit.admits(skew_ms * MS as i64, at_ms * MS);
            (is_admitted, std::iter::from_fn(|| limit.next_notice()).collect::<Vec<_>>())
        };
        let began = |skew_ms: i64| SkewNotice::Began { skew_ns: skew_ms * MS as i64, max_skew_ns: 2 * MS };
        assert_eq!(admit(-2, 1_000), (true, vec![]));
        assert_eq!(admit(-3, 1_100), (false, vec![began(-3)]));
        assert_eq!(admit(3, 1_200), (false, vec![]));
        assert_eq!(admit(2, 1_300), (true, vec![]));
        // A single refused pair within the calm time belongs to the same notice.
        assert_eq!(admit(3, 11_100), (false, vec![]));
        assert_eq!(admit(0, 21_099), (true, vec![]));
        assert_eq!(admit(0, 21_100), (true, vec![SkewNotice::Ended { refused_pairs: 3 }]));
        assert_eq!(admit(4, 21_200), (false, vec![began(4)]));
        limit.end();
        assert_eq!(limit.next_notice(), Some(SkewNotice::Ended { refused_pairs: 1 }));
        assert_eq!(limit.next_notice(), None);
    }
}
