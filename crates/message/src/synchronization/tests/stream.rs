//! Random streams of three channels: the exposures, what happens to each, and the expected windows.

use proptest::prelude::*;

use crate::{FrameHeader, PATTERN_FRINGES, PatternEvent};

use crate::synchronization::{Settings, StepSource};

pub(super) const PERIOD_NS: u64 = 10_000_000;
pub(super) const PERIOD_PX: f64 = 16.0;
const START_NS: u64 = 5_000_000_000;
/// Above the skew and the jitter of all plans, below half of their shortest period.
const MAX_SKEW_NS: u64 = PERIOD_NS * 45 / 100;

/// The true properties of an image, used in place of its pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Truth {
    pub(super) camera: u32,
    pub(super) exposure: usize,
    pub(super) step: usize,
}

#[derive(Clone, Debug)]
pub(super) enum Message {
    Frame(FrameHeader, Truth),
    Refused(FrameHeader),
    Pattern(PatternEvent),
}

/// What happens to one exposure in one channel.
#[derive(Clone, Debug)]
pub(super) struct Fate {
    pub(super) kind: Kind,
    pub(super) jitter_ns: i64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Fine,
    /// Lost by the sender: its number is missing.
    Lost,
    /// Lost in the channel.
    Overrun,
    Twice,
    /// Arrives after this many later messages.
    Behind(usize),
    /// The first message of a restarted sender.
    Restart,
    /// Arrives but cannot be used: a damaged image, or an event without a valid step.
    Useless(u8),
    /// An event followed by another one for the same exposure with different content.
    Contradicted,
}

#[derive(Clone)]
pub(super) struct Plan {
    pub(super) steps: usize,
    pub(super) images: usize,
    pub(super) window_stride: usize,
    pub(super) cycle: bool,
    pub(super) period_error: f64,
    pub(super) skew_ns: i64,
    pub(super) pauses: Vec<bool>,
    /// For camera 1, camera 2 and the projector.
    pub(super) fates: [Vec<Fate>; 3],
}

/// The messages of each channel, and the expected result.
#[derive(Clone, Debug, Default)]
pub(super) struct Stream {
    pub(super) channels: [Vec<Message>; 3],
    /// Exposures that have a pair and a step.
    pub(super) stepped: Vec<usize>,
    /// The last exposure of each expected window.
    pub(super) windows: Vec<usize>,
    /// Images sent, including lost ones that a later message reveals.
    pub(super) images: u64,
    /// Events, counted in the same way.
    pub(super) events: u64,
}

fn kind() -> impl Strategy<Value = Kind> {
    prop_oneof![
        24 => Just(Kind::Fine),
        1 => Just(Kind::Lost),
        1 => Just(Kind::Overrun),
        1 => Just(Kind::Twice),
        1 => prop_oneof![Just(1_usize), Just(2), Just(6)].prop_map(Kind::Behind),
        1 => Just(Kind::Restart),
        1 => (0..4_u8).prop_map(Kind::Useless),
        1 => Just(Kind::Contradicted),
    ]
}

/// Random fates. The last exposures arrive normally, so that no gap stays open at the end.
fn fates(exposures: usize) -> impl Strategy<Value = Vec<Fate>> {
    let jitter = -(PERIOD_NS as i64) * 8 / 100..PERIOD_NS as i64 * 8 / 100;
    let fates =
        prop::collection::vec((kind(), jitter).prop_map(|(kind, jitter_ns)| Fate { kind, jitter_ns }), exposures);
    fates.prop_map(|mut fates| {
        fates.iter_mut().rev().take(9).for_each(|fate| fate.kind = Kind::Fine);
        fates
    })
}

pub(super) fn plan() -> impl Strategy<Value = Plan> {
    (3..6_usize, 0..4_usize, 1..6_usize, prop::bool::weighted(0.2), -0.05..0.05, -0.25..0.25, 20..50_usize)
        .prop_flat_map(|(steps, extra, window_stride, cycle, period_error, skew, exposures)| {
            let pauses = prop::collection::vec(prop::bool::weighted(0.03), exposures);
            let fates = [fates(exposures), fates(exposures), fates(exposures)];
            (pauses, fates).prop_map(move |(pauses, fates)| Plan {
                steps,
                images: steps + extra,
                window_stride,
                cycle,
                period_error,
                skew_ns: (skew * PERIOD_NS as f64) as i64,
                pauses,
                fates,
            })
        })
}

/// Shows only the pauses and the exposures that do not arrive normally.
impl std::fmt::Debug for Plan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { steps, images, window_stride, cycle, skew_ns, .. } = self;
        write!(
            f,
            "{images} images of {steps} steps, stride {window_stride}, cycle {cycle}, skew {skew_ns} ns, {} exposures",
            self.exposures()
        )?;
        for k in (0..self.exposures()).filter(|&k| self.pauses[k]) {
            write!(f, "; pause before {k}")?;
        }
        for (channel, fates) in self.fates.iter().enumerate() {
            for (k, fate) in fates.iter().enumerate().filter(|(_, fate)| fate.kind != Kind::Fine) {
                write!(f, "; {channel}: {k} {:?}", fate.kind)?;
            }
        }
        Ok(())
    }
}

/// One channel: its messages in the order of sending, and which of them the receiver must accept as usable.
struct Channel {
    messages: Vec<Message>,
    usable: Vec<bool>,
    session: Vec<u64>,
    sequence: Vec<u64>,
    contradictions: Vec<u64>,
    counted: u64,
}

impl Plan {
    pub(super) fn settings(&self) -> Settings {
        Settings {
            steps: self.steps,
            images: self.images,
            frame_period_ns: (PERIOD_NS as f64 * (1.0 + self.period_error)) as u64,
            max_skew_ns: MAX_SKEW_NS,
            source: if self.cycle { StepSource::Cycle } else { StepSource::Events { period_px: PERIOD_PX } },
            window_stride: self.window_stride,
            max_waiting: 10_000,
        }
    }

    pub(super) fn stream(&self) -> Stream {
        let [first, second, projector] = [0, 1, 2].map(|channel| self.channel(channel));
        let stepped: Vec<usize> = (0..self.exposures())
            .filter(|&k| first.usable[k] && second.usable[k] && (self.cycle || projector.usable[k]))
            .collect();
        let together = |k: usize| {
            let cameras = [&first, &second]
                .iter()
                .all(|c| c.session[k] == c.session[k - 1] && c.sequence[k] == c.sequence[k - 1] + 1);
            let driver = projector.session[k] == projector.session[k - 1]
                && projector.contradictions[k] == projector.contradictions[k - 1];
            stepped.contains(&(k - 1)) && cameras && (self.cycle || driver) && !self.pauses[k]
        };
        let mut windows = Vec::new();
        let (mut run, mut place) = (0, 0);
        for &k in &stepped {
            (run, place) = if run > 0 && together(k) { (run + 1, place + 1) } else { (1, self.step(k)) };
            if run >= self.images && (place + 1) % self.window_stride == 0 {
                windows.push(k);
            }
        }
        let events = projector.counted;
        let images = first.counted + second.counted;
        let channels = [first.messages, second.messages, projector.messages];
        Stream { channels, stepped, windows, images, events }
    }

    fn exposures(&self) -> usize {
        self.pauses.len()
    }

    fn step(&self, exposure: usize) -> usize {
        if self.cycle { self.numbers(0)[exposure].1 as usize % self.steps } else { exposure % self.steps }
    }

    /// Session and number of every exposure.
    fn numbers(&self, channel: usize) -> Vec<(u64, u64)> {
        let (mut session, mut next) = (100 * (channel as u64 + 1), 0);
        let fates = self.fates[channel].iter();
        fates
            .map(|fate| {
                if fate.kind == Kind::Restart {
                    (session, next) = (session + 1, 0);
                }
                next += 1;
                (session, next - 1)
            })
            .collect()
    }

    fn time_ns(&self, channel: usize, exposure: usize) -> u64 {
        let pauses = self.pauses[..=exposure].iter().filter(|&&pause| pause).count();
        let skew_ns = if channel == 1 { self.skew_ns } else { 0 };
        let due_ns = START_NS + PERIOD_NS * (exposure + 3 * pauses) as u64;
        due_ns.saturating_add_signed(skew_ns + self.fates[channel][exposure].jitter_ns)
    }

    fn channel(&self, channel: usize) -> Channel {
        let numbers = self.numbers(channel);
        let sent = self.order_sent(channel, &numbers);
        let mut out = Channel {
            messages: Vec::new(),
            usable: vec![false; self.exposures()],
            session: numbers.iter().map(|number| number.0).collect(),
            sequence: numbers.iter().map(|number| number.1).collect(),
            contradictions: vec![0; self.exposures()],
            counted: 0,
        };
        let arrived: Vec<usize> = sent.iter().copied().filter(|&k| self.is_put_in_order(channel, k)).collect();
        for (index, &k) in arrived.iter().enumerate() {
            out.usable[k] = self.is_useful(channel, k) && is_in_time(k, &arrived[..index], &numbers);
        }
        if channel < 2 {
            self.send_images(channel, &sent, &numbers, &mut out);
        } else {
            self.send_events(&sent, &numbers, &mut out);
        }
        out
    }

    /// Returns the exposures that the sender did not lose, in the order of sending. Sessions do not mix.
    fn order_sent(&self, channel: usize, numbers: &[(u64, u64)]) -> Vec<usize> {
        let kind = |k: usize| self.fates[channel][k].kind;
        let mut sent: Vec<usize> = (0..self.exposures()).filter(|&k| kind(k) != Kind::Lost).collect();
        // Four late items in a row would be mistaken for a restart.
        let behind = |k: usize| match kind(k) {
            Kind::Behind(later) if later < 3 || k.is_multiple_of(5) => 2 * later + 1,
            _ => 0,
        };
        sent.sort_by_key(|&k| (numbers[k].0, 2 * k + behind(k)));
        sent
    }

    /// Whether the message reaches the reorder buffer.
    fn is_put_in_order(&self, channel: usize, exposure: usize) -> bool {
        match self.fates[channel][exposure].kind {
            Kind::Lost | Kind::Overrun => false,
            Kind::Useless(how) => channel == 2 && how > 0,
            _ => true,
        }
    }

    fn is_useful(&self, channel: usize, exposure: usize) -> bool {
        !matches!(self.fates[channel][exposure].kind, Kind::Useless(_))
    }

    fn send_images(&self, channel: usize, sent: &[usize], numbers: &[(u64, u64)], out: &mut Channel) {
        let mut published = 0;
        for &k in sent {
            let exposure_start_ns = self.time_ns(channel, k);
            let (session, sequence) = numbers[k];
            let header = FrameHeader {
                session,
                sequence,
                published,
                exposure_start_ns,
                received_ns: exposure_start_ns + 3_000_000,
                camera: channel as u32 + 1,
                ..FrameHeader::default()
            };
            published += 1;
            let truth = Truth { camera: header.camera, exposure: k, step: self.step(k) };
            match self.fates[channel][k].kind {
                Kind::Overrun => continue,
                Kind::Useless(0) => {
                    out.messages.push(Message::Frame(FrameHeader { exposure_start_ns: 0, ..header }, truth));
                }
                Kind::Useless(1) => {
                    let late = FrameHeader { received_ns: exposure_start_ns - 1, ..header };
                    out.messages.push(Message::Frame(late, truth));
                }
                Kind::Useless(_) => out.messages.push(Message::Refused(header)),
                Kind::Twice => {
                    out.messages.push(Message::Frame(header, truth));
                    out.messages.push(Message::Frame(FrameHeader { published, ..header }, truth));
                    published += 1;
                }
                _ => out.messages.push(Message::Frame(header, truth)),
            }
            out.counted = published;
        }
    }

    fn send_events(&self, sent: &[usize], numbers: &[(u64, u64)], out: &mut Channel) {
        let (mut contradictions, mut session, mut counted) = (0, 0, 0);
        for &k in sent {
            let fine = PatternEvent {
                session: numbers[k].0,
                sequence: numbers[k].1,
                exposure_start_ns: self.time_ns(2, k),
                duration_ns: PERIOD_NS / 2,
                period_px: PERIOD_PX,
                step: self.step(k) as u32,
                steps: self.steps as u32,
                kind: PATTERN_FRINGES,
                reserved: 0,
            };
            out.contradictions[k] = contradictions;
            let kind = self.fates[2][k].kind;
            if kind == Kind::Overrun {
                continue;
            }
            out.messages.push(Message::Pattern(match kind {
                Kind::Useless(0) => PatternEvent { exposure_start_ns: 0, ..fine },
                Kind::Useless(1) => PatternEvent { kind: 2, ..fine },
                Kind::Useless(2) => PatternEvent { steps: fine.steps + 1, ..fine },
                Kind::Useless(_) => PatternEvent { period_px: f64::NAN, ..fine },
                _ => fine,
            }));
            if session != fine.session {
                (session, out.counted, counted) = (fine.session, out.counted + counted, 0);
            }
            counted = counted.max(fine.sequence + 1);
            if kind == Kind::Twice {
                out.messages.push(Message::Pattern(fine));
                out.counted += 1;
            }
            if kind == Kind::Contradicted {
                let step = (fine.step + 1) % fine.steps;
                out.messages.push(Message::Pattern(PatternEvent { step, ..fine }));
                out.counted += 1;
                contradictions += 1;
            }
        }
        out.counted += counted;
    }
}

/// Whether an exposure that arrives after `before` is still accepted.
fn is_in_time(exposure: usize, before: &[usize], numbers: &[(u64, u64)]) -> bool {
    let same_session = || before.iter().filter(|&&k| numbers[k].0 == numbers[exposure].0);
    let later = same_session().filter(|&&k| k > exposure).count();
    let began_before = same_session().next().is_some_and(|&first| first < exposure);
    later == 0 || (later <= 2 && began_before)
}
