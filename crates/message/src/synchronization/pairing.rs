//! Pairs the images of both cameras that show the same exposure.
//!
//! Two images are partners if their exposures start within half a frame period. A pair whose exposures start farther
//! apart than the limit of the skew shows two moments, and is dropped. The difference of the sequence numbers is
//! constant in a session. If the times contradict it, the new difference is accepted, but the pair that shows it is
//! dropped. An image waits until the other camera has delivered a later one.

use crate::{Counts, DropReason, FrameHeader, Incident, Skew};

use super::gaps::{Arrival, GapCounter};
use super::reorder::{Place, Placed, ReorderBuffer};
use super::settings::Settings;
use super::skew_limit::{SkewLimit, SkewNotice};

/// Longest time from the exposure of an image to its arrival on this machine, nanoseconds.
const MAX_LATENCY_NS: u64 = 3_600_000_000_000;

/// An image and the handle of its pixels.
#[derive(Clone, Debug)]
pub(super) struct Image<F> {
    pub(super) header: FrameHeader,
    pub(super) handle: F,
}

/// The images of camera 1 and camera 2 of one exposure.
#[derive(Clone, Debug)]
pub(super) struct Pair<F>(pub(super) [Image<F>; 2]);

/// Pairs the images of two cameras.
#[derive(Debug)]
pub(super) struct Pairing<F> {
    half_period_ns: u64,
    cameras: [ReorderBuffer<Image<F>>; 2],
    gaps: [GapCounter; 2],
    offset: Option<Offset>,
    limit: SkewLimit,
    /// Skew of the pairs, the refused ones included: it tells why they are refused.
    skew: Skew,
}

/// Sequence number of camera 2 minus that of camera 1, for two sessions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Offset {
    sessions: [u64; 2],
    sequence: u64,
}

impl<F> Pair<F> {
    /// Start of the exposure of camera 1, whose pixels become the points.
    pub(super) fn exposure_start_ns(&self) -> u64 {
        self.0[0].header.exposure_start_ns
    }

    /// Delay of the exposure of camera 2 after that of camera 1.
    pub(super) fn skew_ns(&self) -> i64 {
        let [cam1_ns, cam2_ns] = [0, 1].map(|camera| self.0[camera].header.exposure_start_ns as i64);
        cam2_ns - cam1_ns
    }

    /// Whether the sequence numbers of both cameras follow those of `before`.
    pub(super) fn follows(&self, before: &Self) -> bool {
        self.has_same_sessions(before)
            && self
                .0
                .iter()
                .zip(&before.0)
                .all(|(image, before)| before.header.sequence.checked_add(1) == Some(image.header.sequence))
    }

    /// Whether no camera was restarted since `before`.
    pub(super) fn has_same_sessions(&self, before: &Self) -> bool {
        self.0.iter().zip(&before.0).all(|(image, before)| image.header.session == before.header.session)
    }
}

impl<F> Pairing<F> {
    pub(super) fn new(settings: &Settings) -> Self {
        Self {
            half_period_ns: settings.half_period_ns(),
            cameras: [ReorderBuffer::new(), ReorderBuffer::new()],
            gaps: [GapCounter::new(0), GapCounter::new(0)],
            offset: None,
            limit: SkewLimit::new(settings.max_skew_ns),
            skew: Skew::default(),
        }
    }

    /// Sets the next number that a camera publishes.
    pub(super) fn set_next(&mut self, camera: usize, published: u64) {
        if let Some(gaps) = self.gaps.get_mut(camera) {
            gaps.set_next(Some(published));
        }
    }

    /// Takes an image.
    pub(super) fn push(&mut self, camera: usize, image: Image<F>, counts: &mut Counts) {
        if !self.count_arrival(camera, &image.header, counts) {
            return;
        }
        let Some(reorder) = self.cameras.get_mut(camera) else {
            return counts.drop_one(DropReason::Malformed);
        };
        let header = image.header;
        if !has_possible_times(&header) {
            return counts.drop_one(DropReason::BadTime);
        }
        let place = Place { session: header.session, sequence: header.sequence, time_ns: header.exposure_start_ns };
        reorder.push(Placed { place, item: image });
        reorder.take_dropped().for_each(|(_, reason)| counts.drop_one(reason));
    }

    /// Counts an image that its receiver drops.
    pub(super) fn refuse(&mut self, camera: usize, header: &FrameHeader, reason: DropReason, counts: &mut Counts) {
        if self.count_arrival(camera, header, counts) {
            counts.drop_one(reason);
        }
    }

    /// The next pair, once both images are known.
    pub(super) fn next_pair(&mut self, counts: &mut Counts) -> Option<Pair<F>> {
        loop {
            let [first, second] = &mut self.cameras;
            let places = [first.next_place()?, second.next_place()?];
            let [first_ns, second_ns] = places.map(|place| place.time_ns);
            if first_ns.abs_diff(second_ns) >= self.half_period_ns {
                // Each channel is in order, so the partner of the earlier image cannot come any more.
                let earlier = if first_ns < second_ns { first } else { second };
                drop(earlier.take_next());
                counts.drop_one(DropReason::Unpaired);
                continue;
            }
            let pair = Pair([first.take_next()?, second.take_next()?]);
            let has_known_offset = self.has_known_offset(places);
            let reason = match self.is_within_limit(&pair, counts) {
                true if has_known_offset => return Some(pair),
                true => DropReason::BadTime,
                false => DropReason::Skewed,
            };
            counts.drop_many(reason, 2);
        }
    }

    /// Returns the next notice about the skew of the cameras.
    pub(super) fn next_skew_notice(&mut self) -> Option<SkewNotice> {
        self.limit.next_notice()
    }

    /// Skew of the pairs since the last call.
    pub(super) fn take_skew(&mut self) -> Skew {
        std::mem::take(&mut self.skew)
    }

    /// Number of images of a camera that wait for their partner.
    pub(super) fn waiting(&self, camera: usize) -> usize {
        self.cameras.get(camera).map_or(0, ReorderBuffer::waiting)
    }

    /// Drops the oldest image of a camera; `false` if none is in order.
    pub(super) fn drop_oldest(&mut self, camera: usize, counts: &mut Counts) -> bool {
        let is_dropped = self.cameras.get_mut(camera).and_then(ReorderBuffer::take_next).is_some();
        if is_dropped {
            counts.drop_one(DropReason::Unpaired);
        }
        is_dropped
    }

    /// Drops all waiting images as stopped.
    pub(super) fn end(&mut self, counts: &mut Counts) {
        for reorder in &mut self.cameras {
            counts.drop_many(DropReason::Stopped, reorder.take_waiting().count() as u64);
        }
        self.limit.end();
    }

    /// Counts the image and the lost images before it; `false` if the image itself was already counted as lost.
    fn count_arrival(&mut self, camera: usize, header: &FrameHeader, counts: &mut Counts) -> bool {
        let arrival = self.gaps.get_mut(camera).map_or(Arrival::New { lost: 0 }, |gaps| gaps.arrive(header.published));
        let Arrival::New { lost } = arrival else { return false };
        counts.taken += lost + 1;
        counts.drop_many(DropReason::Overrun, lost);
        true
    }

    /// Whether the exposures of a pair start close enough together. The begin of refusals counts as an incident.
    fn is_within_limit(&mut self, pair: &Pair<F>, counts: &mut Counts) -> bool {
        let skew_ns = pair.skew_ns();
        self.skew.add(skew_ns);
        let was_refusing = self.limit.is_refusing();
        let is_within = self.limit.admits(skew_ns, pair.exposure_start_ns());
        if self.limit.is_refusing() && !was_refusing {
            counts.note(Incident::Skewed, 1);
        }
        is_within
    }

    /// Whether the numbers of a pair have the offset of the pairs before it. The offset of this pair is known from then
    /// on.
    fn has_known_offset(&mut self, [first, second]: [Place; 2]) -> bool {
        let sessions = [first.session, second.session];
        let found = Offset { sessions, sequence: second.sequence.wrapping_sub(first.sequence) };
        let known = self.offset.replace(found);
        known.is_none_or(|known| known.sessions != sessions || known == found)
    }
}

/// Whether the image was exposed before its arrival, and not too long before.
fn has_possible_times(header: &FrameHeader) -> bool {
    let latency_ns = header.received_ns.checked_sub(header.exposure_start_ns);
    header.exposure_start_ns > 0 && latency_ns.is_some_and(|latency_ns| latency_ns <= MAX_LATENCY_NS)
}
