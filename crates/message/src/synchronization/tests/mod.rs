//! Compares the windows of random streams with the expected ones, and tests single cases.

mod cameras;
mod cases;
mod stream;

use proptest::prelude::*;
use proptest::test_runner::Config;

use super::*;
use stream::{Message, PERIOD_NS, Plan, Truth, plan};

const STAGES: [Stage; 3] = [Stage::Pattern, Stage::Pairing, Stage::Windowing];

/// The exposures of a window.
fn exposures(window: &WindowImages<Truth>) -> Vec<usize> {
    window.cam1.iter().map(|truth| truth.exposure).collect()
}

fn feed(sync: &mut Synchronizer<Truth>, message: &Message, out: &mut Vec<WindowImages<Truth>>) {
    match message {
        Message::Frame(header, truth) => sync.push_frame(*header, *truth),
        Message::Refused(header) => sync.refuse_frame(header, DropReason::BadImage),
        Message::Pattern(event) => sync.push_pattern(*event),
    }
    assert!(STAGES.iter().all(|&stage| sync.counts(stage).unwrap().in_work().is_some()), "{:?}", sync.counts);
    out.extend(std::iter::from_fn(|| sync.next_window()));
}

fn synchronizer(settings: Settings) -> Synchronizer<Truth> {
    let mut sync = Synchronizer::new(settings).unwrap();
    sync.expect_frame(1, 0);
    sync.expect_frame(2, 0);
    sync.expect_pattern(300, 0);
    sync
}

/// Feeds the messages of three channels, each in its order. `choices` selects the channel of the next message.
fn interleave(
    sync: &mut Synchronizer<Truth>,
    channels: &[Vec<Message>; 3],
    choices: &[u8],
) -> Vec<WindowImages<Truth>> {
    let mut out = Vec::new();
    let mut rest = channels.each_ref().map(|messages| messages.iter());
    let mut choices = choices.iter().cycle();
    while rest.iter().any(|messages| messages.len() > 0) {
        let choice = usize::from(*choices.next().unwrap_or(&0));
        if let Some(message) = rest[choice % 3].next().or_else(|| rest.iter_mut().find_map(Iterator::next)) {
            feed(sync, message, &mut out);
        }
    }
    sync.end();
    out
}

/// Asserts that each pair shows the same exposure in both cameras and the expected step, and that the exposures are
/// consecutive.
fn assert_not_mixed(window: &WindowImages<Truth>, plan: &Plan) {
    let (cam1, cam2) = (&window.cam1, &window.cam2);
    assert_eq!((cam1.len(), cam2.len()), (plan.images, plan.images));
    let first = window.window.first_step as usize;
    for (place, (a, b)) in cam1.iter().zip(cam2).enumerate() {
        assert_eq!((a.camera, b.camera), (1, 2));
        assert_eq!((a.step, a.exposure), ((first + place) % plan.steps, b.exposure), "{window:?}");
    }
    let exposures = exposures(window);
    assert!(exposures.windows(2).all(|two| two[1] == two[0] + 1), "{window:?}");
}

fn assert_nothing_left(sync: &Synchronizer<Truth>) {
    for stage in STAGES {
        let counts = sync.counts(stage).unwrap();
        assert_eq!(counts.in_work(), Some(0), "{stage:?}: {counts:?}");
    }
}

fn choices() -> impl Strategy<Value = Vec<u8>> {
    prop::collection::vec(0..3_u8, 1..200)
}

/// Corrupts one field of at most every third exposure, so that no corrupted image agrees with a corrupted neighbour.
fn corrupt(channels: &mut [Vec<Message>; 3], corruptions: &[(u8, i64)], max_shift_ns: i64) {
    for (message, &(field, amount)) in channels.iter_mut().flatten().zip(corruptions.iter().cycle()) {
        let shift_ns = amount % max_shift_ns;
        match message {
            Message::Frame(header, truth) if truth.exposure % 3 == 0 => match field {
                0 => header.session = header.session.wrapping_add_signed(amount % 3),
                1 => header.sequence = header.sequence.wrapping_add_signed(amount % 5),
                2 => header.sequence = header.sequence.wrapping_add_signed(amount),
                3 => header.exposure_start_ns = header.exposure_start_ns.saturating_add_signed(shift_ns),
                4 => {
                    header.exposure_start_ns = header.exposure_start_ns.saturating_add_signed(shift_ns);
                    header.received_ns = header.exposure_start_ns;
                }
                5 => header.published = header.published.wrapping_add_signed(amount),
                6 => header.camera = header.camera.wrapping_add_signed(amount as i32),
                _ => {}
            },
            Message::Pattern(event) if event.sequence % 3 == 0 => match field {
                0 => event.session = event.session.wrapping_add_signed(amount % 3),
                1 => event.sequence = event.sequence.wrapping_add_signed(amount % 5),
                2 => event.sequence = event.sequence.wrapping_add_signed(amount),
                3 | 4 => event.exposure_start_ns = event.exposure_start_ns.saturating_add_signed(shift_ns),
                5 => event.step = (event.step + 1) % event.steps,
                6 => event.period_px = f64::from_bits(amount.cast_unsigned()),
                _ => {}
            },
            _ => {}
        }
    }
}

fn corruptions() -> impl Strategy<Value = Vec<(u8, i64)>> {
    prop::collection::vec((0..16_u8, any::<i64>()), 50..200)
}

proptest! {
    #![proptest_config(Config { cases: 600, failure_persistence: None, ..Config::default() })]

    #[test]
    fn windows_are_as_expected_and_counts_add_up(plan in plan(), choices in choices()) {
        let stream = plan.stream();
        let mut sync = synchronizer(plan.settings());
        let windows = interleave(&mut sync, &stream.channels, &choices);
        windows.iter().for_each(|window| assert_not_mixed(window, &plan));
        let last: Vec<usize> = windows.iter().filter_map(|window| exposures(window).into_iter().max()).collect();
        prop_assert_eq!(&last, &stream.windows);
        assert_nothing_left(&sync);
        let (pairing, windowing) = (sync.counts.pairing, sync.counts.windowing);
        prop_assert_eq!((pairing.taken, pairing.passed), (stream.images, 2 * stream.stepped.len() as u64));
        prop_assert_eq!((windowing.taken, windowing.passed), (stream.stepped.len() as u64, stream.windows.len() as u64));
        let passed = if plan.cycle { 0 } else { stream.stepped.len() as u64 };
        prop_assert_eq!((sync.counts.pattern.taken, sync.counts.pattern.passed), (stream.events, passed));
    }

    #[test]
    fn if_channels_are_read_in_turn_no_image_exceeds_the_waiting_limit(plan in plan()) {
        let stream = plan.stream();
        let settings = Settings { max_waiting: plan.images + 3, ..plan.settings() };
        let mut sync = synchronizer(settings);
        let mut out = Vec::new();
        for message in in_order_of_arrival(&stream.channels) {
            feed(&mut sync, &message, &mut out);
        }
        let last: Vec<usize> = out.iter().filter_map(|window| exposures(window).into_iter().max()).collect();
        prop_assert_eq!(&last, &stream.windows);
    }

    #[test]
    fn corrupted_messages_never_mix_windows(
        plan in plan(), corruptions in corruptions(), choices in choices(), max_waiting in 4..12_usize,
    ) {
        let mut stream = plan.stream();
        corrupt(&mut stream.channels, &corruptions, i64::MAX);
        let mut sync = synchronizer(Settings { max_waiting, ..plan.settings() });
        let windows = interleave(&mut sync, &stream.channels, &choices);
        windows.iter().for_each(|window| assert_not_mixed(window, &plan));
        assert_nothing_left(&sync);
    }

    #[test]
    fn windows_do_not_depend_on_the_interleaving_of_the_channels(
        plan in plan(), corruptions in corruptions(), one in choices(), other in choices(),
    ) {
        let mut stream = plan.stream();
        corrupt(&mut stream.channels, &corruptions, PERIOD_NS as i64 * 3 / 2);
        let [first, second] = [one, other].map(|choices| {
            let mut sync = synchronizer(plan.settings());
            let windows = interleave(&mut sync, &stream.channels, &choices);
            windows.into_iter().map(|window| (window.window, window.cam1, window.cam2)).collect::<Vec<_>>()
        });
        prop_assert_eq!(first, second);
    }
}

/// Returns the messages in the order of arrival: each channel in its order, images 1.5 periods after the start of their
/// exposure.
fn in_order_of_arrival(channels: &[Vec<Message>; 3]) -> Vec<Message> {
    let mut timed = Vec::new();
    for messages in channels {
        let mut newest_ns = 0;
        for message in messages {
            newest_ns = newest_ns.max(match message {
                Message::Frame(header, _) | Message::Refused(header) => header.exposure_start_ns + PERIOD_NS * 3 / 2,
                Message::Pattern(event) => event.exposure_start_ns,
            });
            timed.push((newest_ns, message.clone()));
        }
    }
    timed.sort_by_key(|&(time_ns, _)| time_ns);
    timed.into_iter().map(|(_, message)| message).collect()
}
