//! When an exposure began: in goes what the driver stamped on its image, out comes a time of `CLOCK_MONOTONIC`.
//!
//! A driver stamps the start of the exposure or the end of the transfer, and says which; on the monotonic clock, or on one
//! that it does not name. Differences between stamps are trusted, their place in time only as far as it can be: an image
//! cannot begin after it came. Stamps that contradict this are moved, and stamps that run back begin a new base.

use fringeflow_config::StampMoment;

/// Flag of V4L2: which clock the stamp is of, and its values.
const CLOCK_MASK: u32 = 0x0000_e000;
const CLOCK_MONOTONIC: u32 = 0x0000_2000;
/// Flag of V4L2: the stamp is of the start of the exposure.
const START_OF_EXPOSURE: u32 = 0x0001_0000;
/// An image is not older than this when the first one of a stream is taken, nanoseconds.
const OLDEST_FIRST_NS: i128 = 10_000_000_000;

/// What is known of the camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timing {
    /// Time from one image to the next, nanoseconds.
    pub(crate) period_ns: u64,
    /// Duration of the exposure, nanoseconds; 0 if unknown.
    pub(crate) exposure_ns: u64,
    /// From the end of the exposure to the end of the transfer, nanoseconds.
    pub(crate) readout_ns: u64,
    /// Which moment stamps are of.
    pub(crate) moment: StampMoment,
}

/// Turns the stamps of one stream into times.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StampClock {
    timing: Timing,
    base: Option<Base>,
}

/// Where stamps lie in time.
#[derive(Clone, Copy, Debug)]
struct Base {
    /// What is added to a stamp.
    shift_ns: i128,
    /// The last stamp, as the driver gave it.
    last_ns: i128,
}

/// A time, and what was wrong with the stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stamped {
    /// Start of the exposure.
    pub(crate) exposure_start_ns: u64,
    /// It was reckoned: from the end of the transfer, or from the arrival.
    pub(crate) is_reckoned: bool,
    /// What was noticed.
    pub(crate) fault: Option<StampFault>,
}

/// What is wrong with a stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StampFault {
    /// It lies after the arrival of the image, by so much; it and those after it count as so much earlier.
    Ahead {
        /// Nanoseconds.
        by_ns: u64,
    },
    /// It has nothing to do with those before: time begins at the arrival of this image.
    Jump,
    /// It is that of the image before.
    Repeated,
}

impl StampClock {
    pub(crate) fn new(timing: Timing) -> Self {
        Self { timing, base: None }
    }

    /// Takes the stamp of the next image, seconds and microseconds, with the flags of its buffer, at its arrival.
    pub(crate) fn take(&mut self, stamp: [i64; 2], flags: u32, now_ns: u64) -> Stamped {
        let stamp_ns = i128::from(stamp[0]) * 1_000_000_000 + i128::from(stamp[1]) * 1_000;
        let back_ns = self.back_ns(flags);
        let (base, fault) = match self.base {
            Some(base) => self.follow(base, stamp_ns, back_ns, now_ns),
            None => first(stamp_ns, back_ns, flags, now_ns),
        };
        self.base = Some(base);
        let start_ns = (stamp_ns + base.shift_ns - back_ns).clamp(0, now_ns.into()) as u64;
        Stamped { exposure_start_ns: start_ns, is_reckoned: back_ns > 0 || base.shift_ns != 0, fault }
    }

    /// From the start of the exposure to the moment that is stamped.
    fn back_ns(&self, flags: u32) -> i128 {
        let Timing { exposure_ns, readout_ns, moment, .. } = self.timing;
        let is_start = match moment {
            StampMoment::Driver => flags & START_OF_EXPOSURE != 0,
            StampMoment::Start => true,
            StampMoment::End => false,
        };
        if is_start { 0 } else { i128::from(exposure_ns) + i128::from(readout_ns) }
    }

    fn follow(&self, base: Base, stamp_ns: i128, back_ns: i128, now_ns: u64) -> (Base, Option<StampFault>) {
        let now_ns = i128::from(now_ns);
        let ahead_ns = stamp_ns + base.shift_ns - back_ns - now_ns;
        let runs_back = stamp_ns < base.last_ns;
        // A stamp far ahead is a leap of the clock; one a little ahead shows that the first was placed too late.
        if runs_back || ahead_ns > i128::from(self.timing.period_ns / 2) {
            let shift_ns = now_ns - stamp_ns + back_ns;
            return (Base { shift_ns, last_ns: stamp_ns }, Some(StampFault::Jump));
        }
        let repeated = (stamp_ns == base.last_ns).then_some(StampFault::Repeated);
        if ahead_ns > 0 {
            let moved = Base { shift_ns: base.shift_ns - ahead_ns, last_ns: stamp_ns };
            return (moved, repeated.or(Some(StampFault::Ahead { by_ns: ahead_ns as u64 })));
        }
        (Base { last_ns: stamp_ns, ..base }, repeated)
    }
}

/// Places the first stamp of a stream.
fn first(stamp_ns: i128, back_ns: i128, flags: u32, now_ns: u64) -> (Base, Option<StampFault>) {
    let age_ns = i128::from(now_ns) - (stamp_ns - back_ns);
    let at_arrival = Base { shift_ns: age_ns, last_ns: stamp_ns };
    let as_stamped = Base { shift_ns: 0, last_ns: stamp_ns };
    let says_monotonic = flags & CLOCK_MASK == CLOCK_MONOTONIC;
    if (0..=OLDEST_FIRST_NS).contains(&age_ns) {
        (as_stamped, None)
    } else if says_monotonic && (-OLDEST_FIRST_NS..0).contains(&age_ns) {
        (at_arrival, Some(StampFault::Ahead { by_ns: age_ns.unsigned_abs() as u64 }))
    } else {
        (at_arrival, Some(StampFault::Jump))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const PERIOD_NS: u64 = 20 * MS;
    const MONOTONIC_END: u32 = CLOCK_MONOTONIC;
    const MONOTONIC_START: u32 = CLOCK_MONOTONIC | START_OF_EXPOSURE;

    fn clock(moment: StampMoment) -> StampClock {
        StampClock::new(Timing { period_ns: PERIOD_NS, exposure_ns: 5 * MS, readout_ns: 2 * MS, moment })
    }

    fn stamp(ns: u64) -> [i64; 2] {
        [(ns / 1_000_000_000) as i64, (ns % 1_000_000_000 / 1_000) as i64]
    }

    fn good(ns: u64, is_reckoned: bool) -> Stamped {
        Stamped { exposure_start_ns: ns, is_reckoned, fault: None }
    }

    #[test]
    fn the_driver_says_what_it_stamped() {
        let (at_ns, now_ns) = (50_000 * MS, 50_012 * MS);
        let taken = |moment, flags| clock(moment).take(stamp(at_ns), flags, now_ns);
        assert_eq!(taken(StampMoment::Driver, MONOTONIC_START), good(at_ns, false));
        assert_eq!(taken(StampMoment::Driver, MONOTONIC_END), good(at_ns - 7 * MS, true));
        assert_eq!(taken(StampMoment::Start, MONOTONIC_END), good(at_ns, false));
        assert_eq!(taken(StampMoment::End, MONOTONIC_START), good(at_ns - 7 * MS, true));
    }

    #[test]
    fn late_arrivals_change_nothing() {
        let mut clock = clock(StampMoment::Start);
        for k in 0..10 {
            let at_ns = 50_000 * MS + k * PERIOD_NS;
            // The reader was stopped for ten minutes: the driver's buffers come all at once.
            let now_ns = if k < 3 { at_ns + MS } else { 650_000 * MS };
            assert_eq!(clock.take(stamp(at_ns), MONOTONIC_START, now_ns), good(at_ns, false));
        }
    }

    #[test]
    fn stamps_in_the_future_are_moved_and_keep_their_distances() {
        let mut clock = clock(StampMoment::Start);
        let arrival_ns = |k: u64| 50_000 * MS + k * PERIOD_NS;
        // Stamped 15 ms after the arrival; the second and the last image come earlier than the others.
        let early_ns = [0, MS, 0, 0, 2 * MS];
        let arrivals_ns: Vec<u64> = (0..).zip(early_ns).map(|(k, early_ns)| arrival_ns(k) - early_ns).collect();
        let stamps = (0..5).map(|k| stamp(arrival_ns(k) + 15 * MS));
        let taken: Vec<Stamped> =
            stamps.zip(&arrivals_ns).map(|(at, &now_ns)| clock.take(at, MONOTONIC_START, now_ns)).collect();
        for (stamped, &now_ns) in taken.iter().zip(&arrivals_ns) {
            assert!(stamped.is_reckoned && stamped.exposure_start_ns <= now_ns, "{stamped:?} at {now_ns}");
        }
        assert_eq!(taken[0].fault, Some(StampFault::Ahead { by_ns: 15 * MS }));
        assert_eq!(taken[1].fault, Some(StampFault::Ahead { by_ns: MS }));
        assert_eq!(taken[2].fault, None);
        assert_eq!(taken[3].exposure_start_ns - taken[2].exposure_start_ns, PERIOD_NS);
        assert_eq!(taken[4].fault, Some(StampFault::Ahead { by_ns: MS }));
    }

    #[test]
    fn a_wrap_begins_a_new_base_at_the_arrival() {
        let mut clock = clock(StampMoment::Start);
        let arrival_ns = |k: u64| 50_000 * MS + k * PERIOD_NS;
        // Just before the end of 64 bits of nanoseconds, then beyond, where a driver's division makes it negative.
        let ends: [[i64; 2]; 4] = [
            [9_223_372_036, 814_000],
            [9_223_372_036, 834_000],
            [-9_223_372_036, -850_000],
            [-9_223_372_036, -830_000],
        ];
        let taken: Vec<Stamped> =
            (0..).zip(ends).map(|(k, end)| clock.take(end, MONOTONIC_START, arrival_ns(k))).collect();
        let faults: Vec<_> = taken.iter().map(|t| t.fault).collect();
        assert_eq!(faults, [Some(StampFault::Jump), None, Some(StampFault::Jump), None]);
        for (k, stamped) in (0..).zip(&taken) {
            assert_eq!(stamped.exposure_start_ns, arrival_ns(k));
        }
    }

    #[test]
    fn a_clock_of_another_kind_is_placed_by_the_first_arrival() {
        let mut clock = clock(StampMoment::Start);
        let wall_ns = 1_800_000_000_000 * MS;
        let at = |k: u64| stamp(wall_ns + k * PERIOD_NS);
        assert_eq!(clock.take(at(0), 0, 5_000 * MS).fault, Some(StampFault::Jump));
        let second = clock.take(at(1), 0, 5_000 * MS + PERIOD_NS + 3 * MS);
        assert_eq!(second, good(5_000 * MS + PERIOD_NS, true));
    }

    #[test]
    fn a_repeated_stamp_is_told() {
        let mut clock = clock(StampMoment::Start);
        clock.take(stamp(100 * MS), MONOTONIC_START, 101 * MS);
        assert_eq!(clock.take(stamp(100 * MS), MONOTONIC_START, 121 * MS).fault, Some(StampFault::Repeated));
    }

    #[test]
    fn any_stamp_gives_a_time_not_after_the_arrival() {
        for stamp in [[i64::MAX, i64::MAX], [i64::MIN, i64::MIN], [0, -1], [-1, 999_999], [i64::MAX, 0]] {
            let mut clock = clock(StampMoment::Driver);
            for now_ns in [0, 1, 5 * MS, u64::MAX] {
                assert!(clock.take(stamp, u32::MAX, now_ns).exposure_start_ns <= now_ns);
            }
        }
    }
}
