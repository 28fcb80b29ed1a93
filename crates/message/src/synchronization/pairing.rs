//! Images of both cameras, paired: in go the images of each camera as they come, out come pairs of one exposure.
//!
//! Two images are of one exposure if their exposures begin within half a frame period. The difference of their driver
//! numbers stays the same for a session; where times contradict it, the times are believed, but not by the pair that
//! shows it. An image waits until the other camera has delivered a later one.

use crate::{Counts, DropReason, FrameHeader, Skew};

use super::lane::{Lane, Place, Placed};
use super::numbering::{Arrival, Numbering};

/// Longest way of an image from its exposure to this machine, nanoseconds.
const LONGEST_WAY_NS: u64 = 3_600_000_000_000;

/// An image and what holds its pixels.
#[derive(Clone, Debug)]
pub(super) struct Image<F> {
    pub(super) header: FrameHeader,
    pub(super) handle: F,
}

/// Images of camera 1 and camera 2 of one exposure.
#[derive(Clone, Debug)]
pub(super) struct Pair<F>(pub(super) [Image<F>; 2]);

/// Pairs the images of two cameras.
#[derive(Debug)]
pub(super) struct Pairing<F> {
    half_period_ns: u64,
    cameras: [Lane<Image<F>>; 2],
    published: [Numbering; 2],
    offset: Option<Offset>,
    skew: Skew,
}

/// What camera 2 adds to the driver number of camera 1.
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

    /// By how much the exposure of camera 2 begins later.
    pub(super) fn skew_ns(&self) -> i64 {
        let [cam1_ns, cam2_ns] = [0, 1].map(|camera| self.0[camera].header.exposure_start_ns as i64);
        cam2_ns - cam1_ns
    }

    /// Whether this pair's driver numbers follow those of `before` in both cameras.
    pub(super) fn follows(&self, before: &Self) -> bool {
        self.of_sessions_of(before)
            && self
                .0
                .iter()
                .zip(&before.0)
                .all(|(image, before)| before.header.sequence.checked_add(1) == Some(image.header.sequence))
    }

    /// Whether no camera was started anew since `before`.
    pub(super) fn of_sessions_of(&self, before: &Self) -> bool {
        self.0.iter().zip(&before.0).all(|(image, before)| image.header.session == before.header.session)
    }
}

impl<F> Pairing<F> {
    pub(super) fn new(half_period_ns: u64) -> Self {
        let published = [Numbering::new(0), Numbering::new(0)];
        Self { half_period_ns, cameras: [Lane::new(), Lane::new()], published, offset: None, skew: Skew::default() }
    }

    pub(super) fn expect(&mut self, camera: usize, published: u64) {
        if let Some(numbering) = self.published.get_mut(camera) {
            numbering.expect(Some(published));
        }
    }

    /// Takes an image.
    pub(super) fn admit(&mut self, camera: usize, image: Image<F>, counts: &mut Counts) {
        if !self.arrives(camera, &image.header, counts) {
            return;
        }
        let Some(lane) = self.cameras.get_mut(camera) else {
            return counts.drop_one(DropReason::Malformed);
        };
        let header = image.header;
        if !can_be(&header) {
            return counts.drop_one(DropReason::BadTime);
        }
        let place = Place { session: header.session, sequence: header.sequence, time_ns: header.exposure_start_ns };
        lane.admit(Placed { place, item: image });
        lane.take_dropped().for_each(|(_, reason)| counts.drop_one(reason));
    }

    /// Counts an image that is dropped before it is looked at.
    pub(super) fn refuse(&mut self, camera: usize, header: &FrameHeader, reason: DropReason, counts: &mut Counts) {
        if self.arrives(camera, header, counts) {
            counts.drop_one(reason);
        }
    }

    /// The next two images of one exposure, once they are known.
    pub(super) fn next(&mut self, counts: &mut Counts) -> Option<Pair<F>> {
        loop {
            let [first, second] = &mut self.cameras;
            let (a, b) = (first.next_place()?, second.next_place()?);
            if a.time_ns.abs_diff(b.time_ns) >= self.half_period_ns {
                let earlier = if a.time_ns < b.time_ns { first } else { second };
                drop(earlier.take_next());
                counts.drop_one(DropReason::Unpaired);
                continue;
            }
            let pair = Pair([first.take_next()?, second.take_next()?]);
            if self.agrees(a, b) {
                self.skew.add(pair.skew_ns());
                return Some(pair);
            }
            counts.drop_many(DropReason::BadTime, 2);
        }
    }

    /// Skew of the pairs since this was asked last.
    pub(super) fn take_skew(&mut self) -> Skew {
        std::mem::take(&mut self.skew)
    }

    /// Images of a camera that wait for their partner.
    pub(super) fn waiting(&self, camera: usize) -> usize {
        self.cameras.get(camera).map_or(0, Lane::waiting)
    }

    /// Gives up the image of a camera that has waited longest; `false` if none can be.
    pub(super) fn give_up_first(&mut self, camera: usize, counts: &mut Counts) -> bool {
        let given_up = self.cameras.get_mut(camera).and_then(Lane::take_next).is_some();
        if given_up {
            counts.drop_one(DropReason::Unpaired);
        }
        given_up
    }

    /// Counts everything that waits as stopped.
    pub(super) fn end(&mut self, counts: &mut Counts) {
        for lane in &mut self.cameras {
            counts.drop_many(DropReason::Stopped, lane.take_waiting().count() as u64);
        }
    }

    /// Counts the image and those lost before it; `false` if it was itself counted as lost.
    fn arrives(&mut self, camera: usize, header: &FrameHeader, counts: &mut Counts) -> bool {
        let arrival = self.published.get_mut(camera).map_or(Arrival::New { lost: 0 }, |n| n.arrive(header.published));
        let Arrival::New { lost } = arrival else { return false };
        counts.taken += lost + 1;
        counts.drop_many(DropReason::Overrun, lost);
        true
    }

    fn agrees(&mut self, a: Place, b: Place) -> bool {
        let sessions = [a.session, b.session];
        let found = Offset { sessions, sequence: b.sequence.wrapping_sub(a.sequence) };
        let known = self.offset.replace(found);
        known.is_none_or(|known| known.sessions != sessions || known == found)
    }
}

/// Whether the image was exposed before it came, and not too long before.
fn can_be(header: &FrameHeader) -> bool {
    let way_ns = header.received_ns.checked_sub(header.exposure_start_ns);
    header.exposure_start_ns > 0 && way_ns.is_some_and(|way_ns| way_ns <= LONGEST_WAY_NS)
}
