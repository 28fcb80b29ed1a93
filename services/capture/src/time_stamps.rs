//! Converts the time stamps of a driver.
//!
//! In: the time stamp of an image, its flags, and the arrival of the image. Out: the start of the exposure on
//! `CLOCK_MONOTONIC`.
//!
//! A driver stamps the start of the exposure or the end of the transfer, and reports which. Its clock is the monotonic
//! one, or one that it does not name. Differences between stamps are trusted. Absolute times are trusted only if they
//! are possible: no exposure starts after the arrival of its image. Impossible stamps are shifted, and stamps that run
//! back start a new base.

use fringeflow_config::StampMoment;

/// V4L2 flags of the clock of a stamp, and their value for the monotonic clock.
const CLOCK_MASK: u32 = 0x0000_e000;
const CLOCK_MONOTONIC: u32 = 0x0000_2000;
/// V4L2 flag: the stamp marks the start of the exposure.
const START_OF_EXPOSURE: u32 = 0x0001_0000;
/// Greatest age of the first image of a stream on arrival, nanoseconds.
const MAX_FIRST_AGE_NS: i128 = 10_000_000_000;

/// Whether the flags of a buffer declare stamps of the start of the exposure.
pub(crate) fn is_start_of_exposure(flags: u32) -> bool {
    flags & START_OF_EXPOSURE != 0
}

/// Whether the flags of a buffer name the monotonic clock.
pub(crate) fn is_monotonic(flags: u32) -> bool {
    flags & CLOCK_MASK == CLOCK_MONOTONIC
}

/// Timing of a camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timing {
    /// Frame period, nanoseconds.
    pub(crate) period_ns: u64,
    /// Exposure time, nanoseconds; 0 if unknown.
    pub(crate) exposure_ns: u64,
    /// From the end of the exposure to the end of the transfer, nanoseconds.
    pub(crate) readout_ns: u64,
    /// The moment that stamps mark.
    pub(crate) moment: StampMoment,
}

/// Converts the stamps of one stream into times.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StampClock {
    timing: Timing,
    base: Option<Base>,
}

/// Relation of the stamps to `CLOCK_MONOTONIC`.
#[derive(Clone, Copy, Debug)]
struct Base {
    /// Added to each stamp.
    shift_ns: i128,
    /// The last stamp, unshifted.
    last_ns: i128,
}

/// Start of an exposure, and the fault of its stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stamped {
    /// Start of the exposure.
    pub(crate) exposure_start_ns: u64,
    /// Whether the start is an estimate, from the end of the transfer or from an arrival.
    pub(crate) is_estimated: bool,
    /// Fault of the stamp, if it has one.
    pub(crate) fault: Option<StampFault>,
}

/// Fault of a stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StampFault {
    /// The stamp is later than the arrival of the image. It and later stamps are shifted back by the difference.
    Ahead {
        /// Difference, nanoseconds.
        by_ns: u64,
    },
    /// The stamp is unrelated to those before. Times are now relative to the arrival of this image.
    Jump,
    /// The stamp equals that of the image before.
    Repeated,
}

impl StampClock {
    pub(crate) fn new(timing: Timing) -> Self {
        Self { timing, base: None }
    }

    /// Converts the stamp of the next image: seconds and microseconds, the flags of its buffer, and its arrival.
    pub(crate) fn convert(&mut self, stamp: [i64; 2], flags: u32, now_ns: u64) -> Stamped {
        let stamp_ns = i128::from(stamp[0]) * 1_000_000_000 + i128::from(stamp[1]) * 1_000;
        let delay_ns = self.delay_ns(flags);
        let (base, fault) = match self.base {
            Some(base) => self.place_next(base, stamp_ns, delay_ns, now_ns),
            None => place_first(stamp_ns, delay_ns, flags, now_ns),
        };
        self.base = Some(base);
        let start_ns = (stamp_ns + base.shift_ns - delay_ns).clamp(0, now_ns.into()) as u64;
        Stamped { exposure_start_ns: start_ns, is_estimated: delay_ns > 0 || base.shift_ns != 0, fault }
    }

    /// Returns the time from the start of the exposure to the stamped moment.
    fn delay_ns(&self, flags: u32) -> i128 {
        let Timing { exposure_ns, readout_ns, moment, .. } = self.timing;
        let is_start = match moment {
            StampMoment::Driver => is_start_of_exposure(flags),
            StampMoment::Start => true,
            StampMoment::End => false,
        };
        if is_start { 0 } else { i128::from(exposure_ns) + i128::from(readout_ns) }
    }

    fn place_next(&self, base: Base, stamp_ns: i128, delay_ns: i128, now_ns: u64) -> (Base, Option<StampFault>) {
        let now_ns = i128::from(now_ns);
        let ahead_ns = stamp_ns + base.shift_ns - delay_ns - now_ns;
        let runs_back = stamp_ns < base.last_ns;
        // A stamp far ahead means that the clock has jumped; one slightly ahead means that the base is too late.
        if runs_back || ahead_ns > i128::from(self.timing.period_ns / 2) {
            let shift_ns = now_ns - stamp_ns + delay_ns;
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
fn place_first(stamp_ns: i128, delay_ns: i128, flags: u32, now_ns: u64) -> (Base, Option<StampFault>) {
    let age_ns = i128::from(now_ns) - (stamp_ns - delay_ns);
    let at_arrival = Base { shift_ns: age_ns, last_ns: stamp_ns };
    let as_stamped = Base { shift_ns: 0, last_ns: stamp_ns };
    // A plausible age means the monotonic clock, even if the driver does not name it.
    if (0..=MAX_FIRST_AGE_NS).contains(&age_ns) {
        (as_stamped, None)
    } else if is_monotonic(flags) && (-MAX_FIRST_AGE_NS..0).contains(&age_ns) {
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

    fn good(ns: u64, is_estimated: bool) -> Stamped {
        Stamped { exposure_start_ns: ns, is_estimated, fault: None }
    }

    #[test]
    fn the_stamped_moment_comes_from_the_driver_or_the_configuration() {
        let (at_ns, now_ns) = (50_000 * MS, 50_012 * MS);
        let converted = |moment, flags| clock(moment).convert(stamp(at_ns), flags, now_ns);
        assert_eq!(converted(StampMoment::Driver, MONOTONIC_START), good(at_ns, false));
        assert_eq!(converted(StampMoment::Driver, MONOTONIC_END), good(at_ns - 7 * MS, true));
        assert_eq!(converted(StampMoment::Start, MONOTONIC_END), good(at_ns, false));
        assert_eq!(converted(StampMoment::End, MONOTONIC_START), good(at_ns - 7 * MS, true));
    }

    #[test]
    fn late_arrivals_change_nothing() {
        let mut clock = clock(StampMoment::Start);
        for k in 0..10 {
            let at_ns = 50_000 * MS + k * PERIOD_NS;
            // The reader was stopped for ten minutes, and then gets all buffers at once.
            let now_ns = if k < 3 { at_ns + MS } else { 650_000 * MS };
            assert_eq!(clock.convert(stamp(at_ns), MONOTONIC_START, now_ns), good(at_ns, false));
        }
    }

    #[test]
    fn stamps_in_the_future_are_shifted_and_keep_their_differences() {
        let mut clock = clock(StampMoment::Start);
        let arrival_ns = |k: u64| 50_000 * MS + k * PERIOD_NS;
        // The stamps are 15 ms later than the arrivals; the second and the last image arrive earlier than the others.
        let early_ns = [0, MS, 0, 0, 2 * MS];
        let arrivals_ns: Vec<u64> = (0..).zip(early_ns).map(|(k, early_ns)| arrival_ns(k) - early_ns).collect();
        let stamps = (0..5).map(|k| stamp(arrival_ns(k) + 15 * MS));
        let converted: Vec<Stamped> =
            stamps.zip(&arrivals_ns).map(|(at, &now_ns)| clock.convert(at, MONOTONIC_START, now_ns)).collect();
        for (stamped, &now_ns) in converted.iter().zip(&arrivals_ns) {
            assert!(stamped.is_estimated && stamped.exposure_start_ns <= now_ns, "{stamped:?} at {now_ns}");
        }
        assert_eq!(converted[0].fault, Some(StampFault::Ahead { by_ns: 15 * MS }));
        assert_eq!(converted[1].fault, Some(StampFault::Ahead { by_ns: MS }));
        assert_eq!(converted[2].fault, None);
        assert_eq!(converted[3].exposure_start_ns - converted[2].exposure_start_ns, PERIOD_NS);
        assert_eq!(converted[4].fault, Some(StampFault::Ahead { by_ns: MS }));
    }

    #[test]
    fn a_wrap_starts_a_new_base_at_the_arrival() {
        let mut clock = clock(StampMoment::Start);
        let arrival_ns = |k: u64| 50_000 * MS + k * PERIOD_NS;
        // Just before 64 bits of nanoseconds overflow, and after it, where the division in a driver yields negative
        // parts.
        let ends: [[i64; 2]; 4] = [
            [9_223_372_036, 814_000],
            [9_223_372_036, 834_000],
            [-9_223_372_036, -850_000],
            [-9_223_372_036, -830_000],
        ];
        let converted: Vec<Stamped> =
            (0..).zip(ends).map(|(k, end)| clock.convert(end, MONOTONIC_START, arrival_ns(k))).collect();
        let faults: Vec<_> = converted.iter().map(|t| t.fault).collect();
        assert_eq!(faults, [Some(StampFault::Jump), None, Some(StampFault::Jump), None]);
        for (k, stamped) in (0..).zip(&converted) {
            assert_eq!(stamped.exposure_start_ns, arrival_ns(k));
        }
    }

    #[test]
    fn stamps_of_another_clock_are_placed_by_the_first_arrival() {
        let mut clock = clock(StampMoment::Start);
        let wall_ns = 1_800_000_000_000 * MS;
        let at = |k: u64| stamp(wall_ns + k * PERIOD_NS);
        assert_eq!(clock.convert(at(0), 0, 5_000 * MS).fault, Some(StampFault::Jump));
        let second = clock.convert(at(1), 0, 5_000 * MS + PERIOD_NS + 3 * MS);
        assert_eq!(second, good(5_000 * MS + PERIOD_NS, true));
    }

    #[test]
    fn a_repeated_stamp_is_reported() {
        let mut clock = clock(StampMoment::Start);
        clock.convert(stamp(100 * MS), MONOTONIC_START, 101 * MS);
        assert_eq!(clock.convert(stamp(100 * MS), MONOTONIC_START, 121 * MS).fault, Some(StampFault::Repeated));
    }

    #[test]
    fn any_stamp_gives_a_time_not_after_the_arrival() {
        for stamp in [[i64::MAX, i64::MAX], [i64::MIN, i64::MIN], [0, -1], [-1, 999_999], [i64::MAX, 0]] {
            let mut clock = clock(StampMoment::Driver);
            for now_ns in [0, 1, 5 * MS, u64::MAX] {
                assert!(clock.convert(stamp, u32::MAX, now_ns).exposure_start_ns <= now_ns);
            }
        }
    }
}
