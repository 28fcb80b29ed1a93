//! One virtual camera: exposures in, images out when a real one would have transferred them.
//!
//! In: triggers and the time. Out: which image is due, of which exposure; the pixels stay where they are until then.
//! Faults that the configuration asks for happen here. Those without a trace part what an image shows from the number and
//! the time that it is said to have: the images wait in one queue and the places that they take in another.

use std::collections::VecDeque;

use fringeflow_dataset::CameraId;
use fringeflow_lab::simulation::{Faults, ImageFault};
use fringeflow_message::{FrameHeader, PixelFormat};

use crate::cameras::trigger::Trigger;

/// How long a camera takes for what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// From one image to the next, nanoseconds.
    pub period_ns: u64,
    /// Duration of the exposure, nanoseconds.
    pub exposure_ns: u64,
    /// From the end of the exposure to the arrival of the image, nanoseconds.
    pub readout_ns: u64,
    /// From the trigger to the start of the exposure, nanoseconds.
    pub skew_ns: u64,
}

/// An image on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shot {
    /// Number of the exposure that it shows.
    pub number: u64,
    /// Step that it shows.
    pub step: Option<u32>,
    /// Number of the exposure that it is said to show.
    pub said_number: u64,
    /// Start of the exposure that it is said to show.
    pub exposure_start_ns: u64,
    /// When it arrives.
    due_ns: u64,
    /// It waits for the next one to arrive.
    swapped: bool,
}

/// What an exposure yields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exposed {
    /// Images that will arrive.
    pub images: u64,
    /// Images lost in the camera.
    pub lost: u64,
}

/// A camera.
#[derive(Clone, Debug)]
pub struct VirtualCamera {
    id: CameraId,
    session: u64,
    size_px: [u32; 2],
    format: PixelFormat,
    timing: Timing,
    faults: Faults,
    /// In the order of their arrival.
    waiting: VecDeque<Shot>,
    /// Let past by the next one.
    held: Option<Shot>,
    /// The one that let it past has arrived.
    release: bool,
    /// End of the last exposure.
    free_ns: u64,
    /// Images that have no place yet: number and step of what they show.
    shown: VecDeque<(u64, Option<u32>)>,
    /// Places that have no image yet: number and start of the exposure.
    places: VecDeque<(u64, u64)>,
    /// The image that the next one changes places with.
    exchanged: Option<(u64, Option<u32>)>,
}

/// Most places that may wait for an image: a camera that is further behind begins anew with the numbers.
const MAX_PLACES: usize = 2;
/// Most images that may wait for a place: a camera that is further behind leaves them out, without a trace too.
const MAX_SHOWN: usize = 2;

/// How long a swapped image waits for the next one, periods.
const MAX_HELD_PERIODS: u64 = 3;

impl Timing {
    /// Usual times at a rate: half a period of exposure, at most 5 ms, and 3 ms of transfer; C2 starts 40 µs late.
    #[must_use]
    pub fn usual(camera: CameraId, period_ns: u64) -> Self {
        let skew_ns = if camera == CameraId::Cam2 { 40_000 } else { 0 };
        Self { period_ns, exposure_ns: (period_ns / 2).min(5_000_000), readout_ns: 3_000_000, skew_ns }
    }
}

impl VirtualCamera {
    /// A camera; `session` tells this start from others.
    #[must_use]
    pub fn new(
        id: CameraId,
        session: u64,
        size_px: [u32; 2],
        format: PixelFormat,
        timing: Timing,
        faults: Faults,
    ) -> Self {
        Self {
            id,
            session,
            size_px,
            format,
            timing,
            faults,
            waiting: VecDeque::new(),
            held: None,
            release: false,
            free_ns: 0,
            shown: VecDeque::new(),
            places: VecDeque::new(),
            exchanged: None,
        }
    }

    /// Exposes. A trigger during the exposure before is lost, as in a real camera.
    pub fn expose(&mut self, trigger: &Trigger) -> Exposed {
        let Timing { period_ns, exposure_ns, readout_ns, skew_ns } = self.timing;
        let exposure_start_ns = trigger.start_ns.saturating_add(skew_ns);
        if exposure_start_ns < self.free_ns {
            return Exposed { images: 0, lost: 1 };
        }
        self.free_ns = exposure_start_ns.saturating_add(exposure_ns);
        let due_ns = self.free_ns.saturating_add(readout_ns);
        let fault = self.faults.of_image(self.id, trigger.number);
        if fault == Some(ImageFault::Lost) {
            return Exposed { images: 0, lost: 1 };
        }
        let lost = self.show((trigger.number, trigger.step), fault);
        self.places.push_back((trigger.number, exposure_start_ns));
        let mut images = 0;
        while let Some(shot) = self.next_shot(due_ns) {
            images += match fault {
                Some(ImageFault::Duplicated) => self.send(&[shot, shot]),
                Some(ImageFault::Swapped) => self.send(&[Shot { swapped: true, ..shot }]),
                Some(ImageFault::Late) => self.send(&[Shot { due_ns: due_ns.saturating_add(period_ns), ..shot }]),
                _ => self.send(&[shot]),
            };
        }
        Exposed { images, lost }
    }

    /// Puts what an exposure shows in the queue, as far as it is not lost or exchanged; how many places before it are given up.
    fn show(&mut self, image: (u64, Option<u32>), fault: Option<ImageFault>) -> u64 {
        let exchanged = self.exchanged.take();
        let mut given_up = 0;
        match fault {
            Some(ImageFault::HiddenLost) if exchanged.is_none() => {
                if self.places.len() >= MAX_PLACES {
                    given_up = self.places.drain(..).count() as u64;
                }
                return given_up;
            }
            Some(ImageFault::HiddenSwapped) if exchanged.is_none() => self.exchanged = Some(image),
            Some(ImageFault::HiddenDuplicated) if self.shown.len() < MAX_SHOWN => self.shown.extend([image, image]),
            // It catches up, which loses those that waited.
            Some(ImageFault::HiddenDuplicated) => self.shown = [image].into(),
            _ => self.shown.push_back(image),
        }
        self.shown.extend(exchanged);
        given_up
    }

    /// The next image that has a place.
    fn next_shot(&mut self, due_ns: u64) -> Option<Shot> {
        if self.places.is_empty() {
            return None;
        }
        let (number, step) = self.shown.pop_front()?;
        let (said_number, exposure_start_ns) = self.places.pop_front()?;
        Some(Shot { number, step, said_number, exposure_start_ns, due_ns, swapped: false })
    }

    /// How many images it are.
    fn send(&mut self, shots: &[Shot]) -> u64 {
        for shot in shots {
            let place = self.waiting.partition_point(|other| other.due_ns <= shot.due_ns);
            self.waiting.insert(place, *shot);
        }
        shots.len() as u64
    }

    /// The next image that has arrived by `now_ns`; to be asked until there is none.
    pub fn arrived(&mut self, now_ns: u64) -> Option<Shot> {
        if self.release || self.held.is_some_and(|held| self.held_until_ns(&held) <= now_ns) {
            self.release = false;
            return self.held.take();
        }
        let shot = self.next_waiting(now_ns)?;
        if shot.swapped && self.held.is_none() {
            self.held = Some(shot);
            return self.arrived(now_ns);
        }
        self.release = self.held.is_some();
        Some(shot)
    }

    fn next_waiting(&mut self, now_ns: u64) -> Option<Shot> {
        if self.waiting.front()?.due_ns <= now_ns { self.waiting.pop_front() } else { None }
    }

    fn held_until_ns(&self, held: &Shot) -> u64 {
        held.due_ns.saturating_add(MAX_HELD_PERIODS.saturating_mul(self.timing.period_ns))
    }

    /// Number of the oldest exposure whose image is on its way; `None` if none is.
    #[must_use]
    pub fn oldest(&self) -> Option<u64> {
        let on_their_way = self.waiting.iter().chain(&self.held).map(|shot| shot.number);
        on_their_way.chain(self.shown.iter().chain(&self.exchanged).map(|&(number, _)| number)).min()
    }

    /// When the next image arrives; `None` if none is on its way.
    #[must_use]
    pub fn next_ns(&self) -> Option<u64> {
        let held_ns = self.held.map(|held| if self.release { 0 } else { self.held_until_ns(&held) });
        let waiting_ns = self.waiting.front().map(|shot| shot.due_ns);
        held_ns.into_iter().chain(waiting_ns).min()
    }

    /// The header of an image that arrived at `received_ns` and is number `published` of its channel.
    #[must_use]
    pub fn header(&self, shot: &Shot, received_ns: u64, published: u64) -> FrameHeader {
        let [width_px, height_px] = self.size_px;
        FrameHeader {
            session: self.session,
            sequence: shot.said_number,
            published,
            exposure_start_ns: shot.exposure_start_ns,
            received_ns,
            exposure_ns: self.timing.exposure_ns,
            width_px,
            height_px,
            stride_bytes: width_px * self.format.bytes() as u32,
            pixel_format: self.format.code(),
            flags: 0,
            camera: self.id as u32 + 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_lab::simulation::FaultOptions;

    const PERIOD_NS: u64 = 20_000_000;

    fn camera(options: FaultOptions) -> VirtualCamera {
        let timing = Timing::usual(CameraId::Cam2, PERIOD_NS);
        VirtualCamera::new(CameraId::Cam2, 5, [64, 48], PixelFormat::Y10, timing, Faults::new(options).unwrap())
    }

    fn trigger(number: u64) -> Trigger {
        Trigger { number, start_ns: number * PERIOD_NS, step: Some((number % 4) as u32) }
    }

    /// Numbers of the images in the order of arrival, and how many were promised and lost, over 2000 exposures.
    fn run(camera: &mut VirtualCamera) -> (Vec<u64>, Exposed) {
        let (mut numbers, mut sum) = (Vec::new(), Exposed { images: 0, lost: 0 });
        for k in 0..2000 {
            let exposed = camera.expose(&trigger(k));
            sum = Exposed { images: sum.images + exposed.images, lost: sum.lost + exposed.lost };
            while let Some(shot) = camera.arrived((k + 1) * PERIOD_NS - 1) {
                numbers.push(shot.number);
            }
        }
        numbers.extend(std::iter::from_fn(|| camera.arrived(u64::MAX)).map(|shot| shot.number));
        assert_eq!(camera.next_ns(), None);
        (numbers, sum)
    }

    #[test]
    fn an_image_arrives_after_exposure_and_transfer() {
        let mut camera = camera(FaultOptions::default());
        assert_eq!(camera.expose(&trigger(3)), Exposed { images: 1, lost: 0 });
        let due_ns = 3 * PERIOD_NS + 40_000 + 5_000_000 + 3_000_000;
        assert_eq!(camera.next_ns(), Some(due_ns));
        assert_eq!(camera.arrived(due_ns - 1), None);
        let shot = camera.arrived(due_ns).unwrap();
        let header = camera.header(&shot, due_ns + 9, 12);
        assert_eq!((header.session, header.sequence, header.published, header.camera), (5, 3, 12, 2));
        assert_eq!((header.exposure_start_ns, header.received_ns), (3 * PERIOD_NS + 40_000, due_ns + 9));
        assert_eq!((header.width_px, header.height_px, header.stride_bytes), (64, 48, 128));
        assert_eq!((shot.step, camera.arrived(u64::MAX)), (Some(3), None));
    }

    #[test]
    fn a_trigger_during_an_exposure_is_lost() {
        let mut camera = camera(FaultOptions::default());
        camera.expose(&trigger(3));
        for start_ns in [0, 3 * PERIOD_NS, 3 * PERIOD_NS + 4_999_999] {
            assert_eq!(camera.expose(&Trigger { start_ns, ..trigger(4) }), Exposed { images: 0, lost: 1 });
        }
        assert_eq!(camera.expose(&trigger(4)).images, 1);
    }

    #[test]
    fn a_lost_image_leaves_a_gap_in_the_numbers() {
        let (numbers, sum) = run(&mut camera(FaultOptions { lost: 0.1, ..FaultOptions::default() }));
        assert!((150..250).contains(&sum.lost), "{sum:?}");
        assert_eq!((numbers.len() as u64, sum.images + sum.lost), (sum.images, 2000));
        assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]));
    }

    #[test]
    fn a_duplicated_image_comes_twice_in_a_row() {
        let (numbers, sum) = run(&mut camera(FaultOptions { duplicated: 0.1, ..FaultOptions::default() }));
        assert_eq!(numbers.len() as u64, sum.images);
        let twice = numbers.windows(2).filter(|pair| pair[0] == pair[1]).count() as u64;
        assert!((150..250).contains(&twice) && sum.images == 2000 + twice, "{twice} of {sum:?}");
        assert!(numbers.windows(2).all(|pair| pair[1] - pair[0] <= 1));
    }

    #[test]
    fn a_swapped_image_comes_right_after_the_next_one() {
        let (numbers, sum) = run(&mut camera(FaultOptions { swapped: 0.1, ..FaultOptions::default() }));
        assert_eq!((numbers.len(), sum.images), (2000, 2000));
        let swapped = numbers.windows(2).filter(|pair| pair[0] == pair[1] + 1).count();
        assert!((120..250).contains(&swapped), "{swapped}");
        assert!((0..).zip(&numbers).all(|(i, &number)| number.abs_diff(i) <= 1));
    }

    /// What the images show, and what their headers say.
    fn shown(options: FaultOptions) -> Vec<(u64, u64, u64)> {
        let mut camera = camera(options);
        let mut shots = Vec::new();
        for k in 0..2000 {
            camera.expose(&trigger(k));
            let arrived = std::iter::from_fn(|| camera.arrived((k + 1) * PERIOD_NS - 1));
            shots.extend(arrived.map(|shot| (shot.number, shot.said_number, shot.exposure_start_ns)));
        }
        shots
    }

    fn said_in_turn(shots: &[(u64, u64, u64)]) -> bool {
        let in_time = |&(_, said, start_ns): &(u64, u64, u64)| start_ns == said * PERIOD_NS + 40_000;
        shots.windows(2).all(|pair| pair[0].1 + 1 == pair[1].1) && shots.iter().all(in_time)
    }

    #[test]
    fn an_image_duplicated_without_a_trace_is_shown_under_the_next_number() {
        let shots = shown(FaultOptions { hidden_duplicated: 0.02, ..FaultOptions::default() });
        assert!(said_in_turn(&shots) && shots.len() == 2000, "{}", shots.len());
        let again = shots.windows(2).filter(|pair| pair[0].0 == pair[1].0).count();
        assert!((15..60).contains(&again), "{again}");
        assert!(shots.iter().all(|&(number, said, _)| number <= said && number + 2 >= said));
        assert!(shots.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    }

    #[test]
    fn images_swapped_without_a_trace_change_numbers() {
        let shots = shown(FaultOptions { hidden_swapped: 0.02, ..FaultOptions::default() });
        assert!(said_in_turn(&shots));
        let swapped = shots.windows(2).filter(|pair| pair[0].0 == pair[0].1 + 1 && pair[1].0 + 1 == pair[1].1).count();
        assert!((20..60).contains(&swapped), "{swapped}");
        let elsewhere = shots.iter().filter(|&&(number, said, _)| number != said).count();
        assert_eq!(elsewhere, 2 * swapped);
    }

    #[test]
    fn an_image_lost_without_a_trace_leaves_its_number_to_the_next() {
        let mut camera = camera(FaultOptions { hidden_lost: 0.02, ..FaultOptions::default() });
        let (mut lost, mut images, mut shots) = (0, 0, Vec::new());
        for k in 0..2000 {
            let exposed = camera.expose(&trigger(k));
            (lost, images) = (lost + exposed.lost, images + exposed.images);
            shots.extend(std::iter::from_fn(|| camera.arrived((k + 1) * PERIOD_NS - 1)));
        }
        assert_eq!(shots.len() as u64, images);
        // Numbers are missing only where the camera was too far behind and began anew with them.
        let gaps: u64 = shots.windows(2).map(|pair| pair[1].said_number - pair[0].said_number - 1).sum();
        let hidden = shots.windows(2).filter(|pair| pair[1].number > pair[0].number + 1).count() as u64;
        assert_eq!(gaps, lost);
        assert!((20..60).contains(&hidden) && lost < hidden && 2000 - images - lost <= 2, "{hidden} {lost} {images}");
        assert!(shots.iter().all(|shot| shot.number >= shot.said_number && shot.number <= shot.said_number + 2));
    }

    #[test]
    fn a_late_image_comes_a_period_late() {
        let mut camera = camera(FaultOptions { late: 1.0, ..FaultOptions::default() });
        camera.expose(&trigger(0));
        assert_eq!(camera.next_ns(), Some(8_040_000 + PERIOD_NS));
        assert_eq!(run(&mut camera).1.lost, 1);
    }

    #[test]
    fn the_last_image_is_not_held_for_ever() {
        let mut camera = camera(FaultOptions { swapped: 1.0, ..FaultOptions::default() });
        camera.expose(&trigger(0));
        assert_eq!(camera.arrived(PERIOD_NS), None);
        assert_eq!(camera.next_ns(), Some(8_040_000 + 3 * PERIOD_NS));
        assert_eq!(camera.arrived(8_040_000 + 3 * PERIOD_NS).map(|shot| shot.number), Some(0));
    }
}
