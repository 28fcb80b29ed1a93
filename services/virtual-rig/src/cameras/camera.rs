//! A virtual camera, which delivers each image when a real camera would have transferred it.
//!
//! In: triggers and the time. Out: the images that are due, each by the number of its exposure. No pixels pass through
//! here.
//!
//! The configured faults happen here. A hidden fault leaves no trace in the headers: an image shows another exposure
//! than the number and time in its header say. So contents (what images show) and slots (numbers and times of headers)
//! wait in two queues.

use std::collections::VecDeque;

use fringeflow_dataset::CameraId;
use fringeflow_lab::simulation::{Faults, ImageFault};
use fringeflow_message::{FrameHeader, PixelFormat};

use crate::cameras::trigger::Trigger;

/// Timing of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Frame period, nanoseconds.
    pub period_ns: u64,
    /// Exposure time, nanoseconds.
    pub exposure_ns: u64,
    /// From the end of the exposure to the arrival of the image, nanoseconds.
    pub readout_ns: u64,
    /// From the trigger to the start of the exposure, nanoseconds.
    pub skew_ns: u64,
}

/// An image on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shot {
    /// Number of the exposure that the image shows.
    pub number: u64,
    /// Phase step that the image shows.
    pub step: Option<u32>,
    /// Number of the exposure in the header.
    pub header_number: u64,
    /// Start of the exposure in the header.
    pub exposure_start_ns: u64,
    /// Arrival time.
    due_ns: u64,
    /// Whether the image waits until the next one has arrived.
    is_swapped: bool,
}

/// Result of an exposure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExposureResult {
    /// Number of images that will arrive.
    pub images: u64,
    /// Number of images lost because the camera was still exposing.
    pub lost: u64,
    /// Number of images lost by a configured fault.
    pub injected: u64,
}

/// A virtual camera.
#[derive(Clone, Debug)]
pub struct VirtualCamera {
    id: CameraId,
    session: u64,
    size_px: [u32; 2],
    format: PixelFormat,
    timing: Timing,
    faults: Faults,
    /// Images on their way, in the order of arrival.
    in_transit: VecDeque<Shot>,
    /// Swapped image that waits until the next one has arrived.
    held: Option<Shot>,
    /// Whether the image after the held one has arrived.
    releases_held: bool,
    /// End of the last exposure.
    exposure_end_ns: u64,
    /// Contents without a slot: number and step of the exposure.
    contents: VecDeque<(u64, Option<u32>)>,
    /// Slots without content: number and start of the exposure.
    slots: VecDeque<(u64, u64)>,
    /// Content that changes slots with the next one.
    exchanged: Option<(u64, Option<u32>)>,
}

/// Maximum number of slots that wait for contents. A camera that is further behind gives them up, which leaves a gap in
/// the numbers.
const MAX_SLOTS: usize = 2;
/// Maximum number of contents that wait for slots. A camera that is further behind drops them, which also leaves no
/// trace.
const MAX_CONTENTS: usize = 2;

/// Longest time that a swapped image waits for the next one, periods.
const MAX_HELD_PERIODS: u64 = 3;

impl Timing {
    /// Returns the usual timing at a rate: exposure for half a period, at most 5 ms, then 3 ms of transfer. C2 starts
    /// 40 µs late.
    #[must_use]
    pub fn usual(camera: CameraId, period_ns: u64) -> Self {
        let skew_ns = if camera == CameraId::Cam2 { 40_000 } else { 0 };
        Self { period_ns, exposure_ns: (period_ns / 2).min(5_000_000), readout_ns: 3_000_000, skew_ns }
    }
}

impl VirtualCamera {
    /// Creates a camera; `session` identifies this start.
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
            in_transit: VecDeque::new(),
            held: None,
            releases_held: false,
            exposure_end_ns: 0,
            contents: VecDeque::new(),
            slots: VecDeque::new(),
            exchanged: None,
        }
    }

    /// Exposes an image. A trigger during the previous exposure is lost, as in a real camera.
    pub fn expose(&mut self, trigger: &Trigger) -> ExposureResult {
        let Timing { period_ns, exposure_ns, readout_ns, skew_ns } = self.timing;
        let exposure_start_ns = trigger.start_ns.saturating_add(skew_ns);
        if exposure_start_ns < self.exposure_end_ns {
            return ExposureResult { lost: 1, ..ExposureResult::default() };
        }
        self.exposure_end_ns = exposure_start_ns.saturating_add(exposure_ns);
        let due_ns = self.exposure_end_ns.saturating_add(readout_ns);
        let fault = self.faults.image_fault(self.id, trigger.number);
        if fault == Some(ImageFault::Lost) {
            return ExposureResult { injected: 1, ..ExposureResult::default() };
        }
        let injected = self.queue_content((trigger.number, trigger.step), fault);
        self.slots.push_back((trigger.number, exposure_start_ns));
        let mut images = 0;
        while let Some(shot) = self.next_shot(due_ns) {
            images += match fault {
                Some(ImageFault::Duplicated) => self.schedule(&[shot, shot]),
                Some(ImageFault::Swapped) => self.schedule(&[Shot { is_swapped: true, ..shot }]),
                Some(ImageFault::Late) => self.schedule(&[Shot { due_ns: due_ns.saturating_add(period_ns), ..shot }]),
                _ => self.schedule(&[shot]),
            };
        }
        ExposureResult { images, lost: 0, injected }
    }

    /// Queues the content of an exposure, subject to hidden faults. Returns the number of slots that are given up
    /// before it.
    fn queue_content(&mut self, content: (u64, Option<u32>), fault: Option<ImageFault>) -> u64 {
        let exchanged = self.exchanged.take();
        let mut given_up = 0;
        match fault {
            Some(ImageFault::HiddenLost) if exchanged.is_none() => {
                if self.slots.len() >= MAX_SLOTS {
                    given_up = self.slots.drain(..).count() as u64;
                }
                return given_up;
            }
            Some(ImageFault::HiddenSwapped) if exchanged.is_none() => self.exchanged = Some(content),
            Some(ImageFault::HiddenDuplicated) if self.contents.len() < MAX_CONTENTS => {
                self.contents.extend([content, content]);
            }
            // The camera catches up and drops the contents that wait.
            Some(ImageFault::HiddenDuplicated) => self.contents = [content].into(),
            _ => self.contents.push_back(content),
        }
        self.contents.extend(exchanged);
        given_up
    }

    /// Joins the next content and the next slot to an image, if both exist.
    fn next_shot(&mut self, due_ns: u64) -> Option<Shot> {
        if self.slots.is_empty() {
            return None;
        }
        let (number, step) = self.contents.pop_front()?;
        let (header_number, exposure_start_ns) = self.slots.pop_front()?;
        Some(Shot { number, step, header_number, exposure_start_ns, due_ns, is_swapped: false })
    }

    /// Adds images to those on their way. Returns their number.
    fn schedule(&mut self, shots: &[Shot]) -> u64 {
        for shot in shots {
            let position = self.in_transit.partition_point(|other| other.due_ns <= shot.due_ns);
            self.in_transit.insert(position, *shot);
        }
        shots.len() as u64
    }

    /// Takes the next image that has arrived by `now_ns`. Call this until it returns `None`.
    pub fn take_arrived(&mut self, now_ns: u64) -> Option<Shot> {
        if self.releases_held || self.held.is_some_and(|held| self.held_until_ns(&held) <= now_ns) {
            self.releases_held = false;
            return self.held.take();
        }
        let shot = self.take_due(now_ns)?;
        if shot.is_swapped && self.held.is_none() {
            self.held = Some(shot);
            return self.take_arrived(now_ns);
        }
        self.releases_held = self.held.is_some();
        Some(shot)
    }

    fn take_due(&mut self, now_ns: u64) -> Option<Shot> {
        if self.in_transit.front()?.due_ns <= now_ns { self.in_transit.pop_front() } else { None }
    }

    fn held_until_ns(&self, held: &Shot) -> u64 {
        held.due_ns.saturating_add(MAX_HELD_PERIODS.saturating_mul(self.timing.period_ns))
    }

    /// Returns the number of the oldest exposure whose image is on its way; `None` if there is none.
    #[must_use]
    pub fn oldest_exposure(&self) -> Option<u64> {
        let shots = self.in_transit.iter().chain(&self.held).map(|shot| shot.number);
        shots.chain(self.contents.iter().chain(&self.exchanged).map(|&(number, _)| number)).min()
    }

    /// Returns the arrival time of the next image; `None` if none is on its way.
    #[must_use]
    pub fn next_ns(&self) -> Option<u64> {
        let held_ns = self.held.map(|held| if self.releases_held { 0 } else { self.held_until_ns(&held) });
        let due_ns = self.in_transit.front().map(|shot| shot.due_ns);
        held_ns.into_iter().chain(due_ns).min()
    }

    /// Returns the header of an image that arrived at `received_ns`; `published` is its number in the channel.
    #[must_use]
    pub fn header(&self, shot: &Shot, received_ns: u64, published: u64) -> FrameHeader {
        let [width_px, height_px] = self.size_px;
        FrameHeader {
            session: self.session,
            sequence: shot.header_number,
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

    /// Returns the numbers of the images of 2000 exposures in the order of arrival, and how many were promised and
    /// lost.
    fn run(camera: &mut VirtualCamera) -> (Vec<u64>, ExposureResult) {
        let (mut numbers, mut sum) = (Vec::new(), ExposureResult::default());
        for k in 0..2000 {
            let exposed = camera.expose(&trigger(k));
            sum.lost += exposed.lost;
            sum.images += exposed.images;
            sum.injected += exposed.injected;
            while let Some(shot) = camera.take_arrived((k + 1) * PERIOD_NS - 1) {
                numbers.push(shot.number);
            }
        }
        numbers.extend(std::iter::from_fn(|| camera.take_arrived(u64::MAX)).map(|shot| shot.number));
        assert_eq!(camera.next_ns(), None);
        (numbers, sum)
    }

    #[test]
    fn an_image_arrives_after_exposure_and_transfer() {
        let mut camera = camera(FaultOptions::default());
        assert_eq!(camera.expose(&trigger(3)), ExposureResult { images: 1, ..ExposureResult::default() });
        let due_ns = 3 * PERIOD_NS + 40_000 + 5_000_000 + 3_000_000;
        assert_eq!(camera.next_ns(), Some(due_ns));
        assert_eq!(camera.take_arrived(due_ns - 1), None);
        let shot = camera.take_arrived(due_ns).unwrap();
        let header = camera.header(&shot, due_ns + 9, 12);
        assert_eq!((header.session, header.sequence, header.published, header.camera), (5, 3, 12, 2));
        assert_eq!((header.exposure_start_ns, header.received_ns), (3 * PERIOD_NS + 40_000, due_ns + 9));
        assert_eq!((header.width_px, header.height_px, header.stride_bytes), (64, 48, 128));
        assert_eq!((shot.step, camera.take_arrived(u64::MAX)), (Some(3), None));
    }

    #[test]
    fn a_trigger_during_an_exposure_is_lost() {
        let mut camera = camera(FaultOptions::default());
        camera.expose(&trigger(3));
        for start_ns in [0, 3 * PERIOD_NS, 3 * PERIOD_NS + 4_999_999] {
            let expected = ExposureResult { lost: 1, ..ExposureResult::default() };
            assert_eq!(camera.expose(&Trigger { start_ns, ..trigger(4) }), expected);
        }
        assert_eq!(camera.expose(&trigger(4)).images, 1);
    }

    #[test]
    fn a_lost_image_leaves_a_gap_in_the_numbers() {
        let (numbers, sum) = run(&mut camera(FaultOptions { lost: 0.1, ..FaultOptions::default() }));
        assert!((150..250).contains(&sum.injected), "{sum:?}");
        assert_eq!((numbers.len() as u64, sum.images + sum.injected), (sum.images, 2000));
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

    /// Returns the exposure that each image shows, and the number and time in its header.
    fn deliver(options: FaultOptions) -> Vec<(u64, u64, u64)> {
        let mut camera = camera(options);
        let mut shots = Vec::new();
        for k in 0..2000 {
            camera.expose(&trigger(k));
            let arrived = std::iter::from_fn(|| camera.take_arrived((k + 1) * PERIOD_NS - 1));
            shots.extend(arrived.map(|shot| (shot.number, shot.header_number, shot.exposure_start_ns)));
        }
        shots
    }

    fn headers_are_in_order(shots: &[(u64, u64, u64)]) -> bool {
        let in_time = |&(_, header_number, start_ns): &(u64, u64, u64)| start_ns == header_number * PERIOD_NS + 40_000;
        shots.windows(2).all(|pair| pair[0].1 + 1 == pair[1].1) && shots.iter().all(in_time)
    }

    #[test]
    fn a_hidden_duplicate_takes_the_next_number() {
        let shots = deliver(FaultOptions { hidden_duplicated: 0.02, ..FaultOptions::default() });
        assert!(headers_are_in_order(&shots) && shots.len() == 2000, "{}", shots.len());
        let again = shots.windows(2).filter(|pair| pair[0].0 == pair[1].0).count();
        assert!((15..60).contains(&again), "{again}");
        assert!(shots.iter().all(|&(number, header, _)| number <= header && number + 2 >= header));
        assert!(shots.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    }

    #[test]
    fn images_with_a_hidden_swap_exchange_numbers() {
        let shots = deliver(FaultOptions { hidden_swapped: 0.02, ..FaultOptions::default() });
        assert!(headers_are_in_order(&shots));
        let swapped = shots.windows(2).filter(|pair| pair[0].0 == pair[0].1 + 1 && pair[1].0 + 1 == pair[1].1).count();
        assert!((20..60).contains(&swapped), "{swapped}");
        let moved = shots.iter().filter(|&&(number, header, _)| number != header).count();
        assert_eq!(moved, 2 * swapped);
    }

    #[test]
    fn a_hidden_loss_leaves_its_number_to_the_next_image() {
        let mut camera = camera(FaultOptions { hidden_lost: 0.02, ..FaultOptions::default() });
        let (mut lost, mut images, mut shots) = (0, 0, Vec::new());
        for k in 0..2000 {
            let exposed = camera.expose(&trigger(k));
            (lost, images) = (lost + exposed.injected, images + exposed.images);
            shots.extend(std::iter::from_fn(|| camera.take_arrived((k + 1) * PERIOD_NS - 1)));
        }
        assert_eq!(shots.len() as u64, images);
        // Numbers are missing only where the camera was too far behind and gave up its slots.
        let gaps: u64 = shots.windows(2).map(|pair| pair[1].header_number - pair[0].header_number - 1).sum();
        let hidden = shots.windows(2).filter(|pair| pair[1].number > pair[0].number + 1).count() as u64;
        assert_eq!(gaps, lost);
        assert!((20..60).contains(&hidden) && lost < hidden && 2000 - images - lost <= 2, "{hidden} {lost} {images}");
        assert!(shots.iter().all(|shot| (shot.header_number..=shot.header_number + 2).contains(&shot.number)));
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
        assert_eq!(camera.take_arrived(PERIOD_NS), None);
        assert_eq!(camera.next_ns(), Some(8_040_000 + 3 * PERIOD_NS));
        assert_eq!(camera.take_arrived(8_040_000 + 3 * PERIOD_NS).map(|shot| shot.number), Some(0));
    }
}
