//! Single cases, written by hand.

use std::rc::Rc;

use crate::PATTERN_FRINGES;

use super::stream::PERIOD_PX;
use super::*;

const STEPS: usize = 4;
const START_NS: u64 = 1_000_000_000;

fn settings() -> Settings {
    let source = StepSource::Events { period_px: PERIOD_PX };
    Settings {
        steps: STEPS,
        images: STEPS,
        frame_period_ns: PERIOD_NS,
        max_skew_ns: PERIOD_NS / 2,
        source,
        window_stride: 1,
        max_waiting: STEPS + 3,
    }
}

fn header(camera: u32, exposure: u64) -> FrameHeader {
    let exposure_start_ns = START_NS + exposure * PERIOD_NS;
    FrameHeader {
        session: 7 + u64::from(camera),
        sequence: exposure + 10 * u64::from(camera),
        published: exposure,
        exposure_start_ns,
        received_ns: exposure_start_ns + u64::from(camera),
        camera,
        ..FrameHeader::default()
    }
}

fn event(exposure: u64) -> PatternEvent {
    PatternEvent {
        session: 3,
        sequence: exposure,
        exposure_start_ns: START_NS + exposure * PERIOD_NS,
        duration_ns: PERIOD_NS,
        period_px: PERIOD_PX,
        step: (exposure % STEPS as u64) as u32,
        steps: STEPS as u32,
        kind: PATTERN_FRINGES,
        reserved: 0,
    }
}

/// Feeds one exposure, changed by `change`, to all three channels.
fn expose(sync: &mut Synchronizer<u64>, exposure: u64, change: impl Fn(&mut FrameHeader)) {
    sync.push_pattern(event(exposure));
    for camera in [1, 2] {
        let mut header = header(camera, exposure);
        change(&mut header);
        sync.push_frame(header, exposure);
    }
}

fn take_all<F: Clone>(sync: &mut Synchronizer<F>) -> Vec<WindowImages<F>> {
    std::iter::from_fn(|| sync.next_window()).collect()
}

fn dropped<F: Clone>(sync: &Synchronizer<F>, stage: Stage) -> Vec<(DropReason, u64)> {
    sync.counts(stage).unwrap().reasons().collect()
}

#[test]
fn disjoint_windows_contain_one_cycle_each_and_the_last_one_is_not_delayed() {
    let mut sync = Synchronizer::new(Settings { window_stride: STEPS, ..settings() }).unwrap();
    (2..12).for_each(|exposure| expose(&mut sync, exposure, |_| {}));
    let windows = take_all(&mut sync);
    let images: Vec<_> = windows.iter().map(|window| window.cam1.clone()).collect();
    assert_eq!(images, [[4, 5, 6, 7], [8, 9, 10, 11]]);
    let window = windows[0].window;
    assert_eq!((window.cam1_session, window.cam2_session, window.images, window.first_step), (8, 9, 4, 0));
    assert_eq!((window.cam1_sequence[..5].to_vec(), window.cam2_sequence[3]), (vec![14, 15, 16, 17, 0], 27));
    let after_ns = |periods: u64| START_NS + periods * PERIOD_NS;
    assert_eq!((window.first_exposure_ns, window.last_exposure_ns), (after_ns(4), after_ns(7)));
    assert_eq!((window.centre_ns, window.received_ns), (after_ns(4) + PERIOD_NS * 3 / 2, after_ns(7) + 2));
    assert_eq!(dropped(&sync, Stage::Windowing), [(DropReason::BetweenWindows, 5), (DropReason::Beginning, 3)]);
}

#[test]
fn a_sliding_window_keeps_the_order_of_the_exposures_and_states_its_first_step() {
    let mut sync = Synchronizer::new(settings()).unwrap();
    (0..6).for_each(|exposure| expose(&mut sync, exposure, |_| {}));
    let windows = take_all(&mut sync);
    let images: Vec<_> = windows.iter().map(|window| window.cam2.clone()).collect();
    assert_eq!(images, [[0, 1, 2, 3], [1, 2, 3, 4], [2, 3, 4, 5]]);
    assert_eq!(windows.iter().map(|window| window.window.first_step).collect::<Vec<_>>(), [0, 1, 2]);
}

#[test]
fn a_longer_window_needs_more_pairs_in_a_row() {
    let mut sync = Synchronizer::new(Settings { images: STEPS + 2, ..settings() }).unwrap();
    (0..8).for_each(|exposure| expose(&mut sync, exposure, |_| {}));
    let images: Vec<_> = take_all(&mut sync).into_iter().map(|window| window.cam1).collect();
    assert_eq!(images, [[0, 1, 2, 3, 4, 5], [1, 2, 3, 4, 5, 6], [2, 3, 4, 5, 6, 7]]);
    assert_eq!(dropped(&sync, Stage::Windowing), [(DropReason::Beginning, 5)]);
}

#[test]
fn if_a_camera_is_silent_no_more_images_are_held_than_may_wait() {
    let mut sync = Synchronizer::new(settings()).unwrap();
    let pixels = Rc::new(());
    for exposure in 0..100 {
        sync.push_frame(header(1, exposure), Rc::clone(&pixels));
        assert!(Rc::strong_count(&pixels) <= 1 + STEPS + 3);
    }
    assert_eq!(dropped(&sync, Stage::Pairing), [(DropReason::Unpaired, 93)]);
    sync.end();
    assert_eq!(Rc::strong_count(&pixels), 1);
    assert_eq!(dropped(&sync, Stage::Pairing), [(DropReason::Unpaired, 93), (DropReason::Stopped, 7)]);
}

#[test]
fn a_silent_projector_leaves_pairs_without_pattern() {
    let mut sync = Synchronizer::new(settings()).unwrap();
    let pixels = Rc::new(());
    for exposure in 0..100 {
        [1, 2].into_iter().for_each(|camera| sync.push_frame(header(camera, exposure), Rc::clone(&pixels)));
        assert!(Rc::strong_count(&pixels) <= 1 + 2 * (STEPS + 3));
    }
    assert_eq!(dropped(&sync, Stage::Pairing), [(DropReason::NoPattern, 2 * 93)]);
}

#[test]
fn events_without_images_do_not_pile_up() {
    let mut sync = Synchronizer::<()>::new(settings()).unwrap();
    (0..1000).for_each(|exposure| sync.push_pattern(event(exposure)));
    assert_eq!(dropped(&sync, Stage::Pattern), [(DropReason::Unpaired, 1000 - 64)]);
}

#[test]
fn images_of_an_ended_session_never_join_the_next() {
    let mut sync = Synchronizer::new(settings()).unwrap();
    (0..4).for_each(|exposure| expose(&mut sync, exposure, |_| {}));
    let restarted = |header: &mut FrameHeader| (header.session, header.sequence) = (50, header.sequence - 4);
    (4..6).for_each(|exposure| expose(&mut sync, exposure, restarted));
    sync.push_frame(FrameHeader { published: 6, sequence: 99, ..header(1, 3) }, 3);
    (6..9).for_each(|exposure| {
        expose(&mut sync, exposure, |header| {
            restarted(header);
            header.published += u64::from(header.camera == 1);
        });
    });
    let images: Vec<_> = take_all(&mut sync).into_iter().map(|window| window.cam1).collect();
    assert_eq!(images, [[0, 1, 2, 3], [4, 5, 6, 7], [5, 6, 7, 8]]);
    assert_eq!(dropped(&sync, Stage::Pairing), [(DropReason::NewSession, 1)]);
    assert_eq!(dropped(&sync, Stage::Windowing), [(DropReason::NewSession, 1), (DropReason::Beginning, 5)]);
}

#[test]
fn a_driver_number_that_contradicts_the_time_costs_its_pair_and_breaks_the_window() {
    let mut sync = Synchronizer::new(settings()).unwrap();
    (0..5).for_each(|exposure| expose(&mut sync, exposure, |_| {}));
    // From here on the driver of camera 1 counts one image too many.
    let skipped = |header: &mut FrameHeader| header.sequence += u64::from(header.camera == 1);
    (5..10).for_each(|exposure| expose(&mut sync, exposure, skipped));
    let images: Vec<_> = take_all(&mut sync).into_iter().map(|window| window.cam1).collect();
    assert_eq!(images, [[0, 1, 2, 3], [1, 2, 3, 4], [6, 7, 8, 9]]);
    assert_eq!(dropped(&sync, Stage::Pairing), [(DropReason::BadTime, 2)]);
}

#[test]
fn a_number_skipped_by_both_cameras_breaks_the_window_although_the_times_are_regular() {
    let mut sync = Synchronizer::new(settings()).unwrap();
    (0..5).for_each(|exposure| expose(&mut sync, exposure, |_| {}));
    (5..12).for_each(|exposure| expose(&mut sync, exposure, |header| header.sequence += 1));
    let images: Vec<_> = take_all(&mut sync).into_iter().map(|window| window.cam1).collect();
    assert_eq!(images, [[0, 1, 2, 3], [1, 2, 3, 4], [5, 6, 7, 8], [6, 7, 8, 9], [7, 8, 9, 10], [8, 9, 10, 11]]);
    assert_eq!(dropped(&sync, Stage::Windowing), [(DropReason::Incomplete, 3), (DropReason::Beginning, 3)]);
}

#[test]
fn a_step_out_of_turn_breaks_the_window() {
    let mut sync = Synchronizer::new(settings()).unwrap();
    for exposure in 0..12 {
        let late = u32::from(exposure >= 5);
        sync.push_pattern(PatternEvent { step: (event(exposure).step + late) % 4, ..event(exposure) });
        [1, 2].into_iter().for_each(|camera| sync.push_frame(header(camera, exposure), exposure));
    }
    assert_eq!(
        dropped(&sync, Stage::Windowing),
        [(DropReason::PatternConflict, 1), (DropReason::Incomplete, 2), (DropReason::Beginning, 3)]
    );
    assert_eq!(take_all(&mut sync).len(), 6);
}

#[test]
fn windows_continue_when_a_recording_is_replayed_a_second_time() {
    let mut sync = Synchronizer::new(settings()).unwrap();
    for _ in 0..2 {
        (0..40).for_each(|exposure| expose(&mut sync, exposure, |_| {}));
    }
    let windows = take_all(&mut sync);
    assert!(windows.len() > 37 + 10, "{} windows", windows.len());
    assert_eq!(windows.last().unwrap().cam1, [36, 37, 38, 39]);
}

#[test]
fn a_restarted_service_counts_what_it_missed() {
    let mut sync = Synchronizer::new(settings()).unwrap();
    sync.expect_frame(1, 90);
    sync.expect_frame(2, 95);
    sync.expect_pattern(3, 80);
    (100..104).for_each(|exposure| expose(&mut sync, exposure, |_| {}));
    assert_eq!(dropped(&sync, Stage::Pairing), [(DropReason::Overrun, 10 + 5)]);
    sync.end();
    assert_eq!(dropped(&sync, Stage::Pattern), [(DropReason::Overrun, 20)]);
    assert_eq!(sync.counts(Stage::Pattern).unwrap().taken, 24);
}

#[test]
fn lost_first_events_of_a_restarted_driver_are_counted() {
    let mut sync = Synchronizer::<()>::new(settings()).unwrap();
    sync.push_pattern(event(100));
    sync.push_pattern(PatternEvent { session: 4, sequence: 3, ..event(101) });
    sync.end();
    assert_eq!(dropped(&sync, Stage::Pattern), [(DropReason::Overrun, 3), (DropReason::Stopped, 2)]);
}

#[test]
fn an_image_of_an_unknown_camera_is_malformed_and_an_unused_event_is_counted() {
    let mut sync = Synchronizer::new(Settings { source: StepSource::Cycle, ..settings() }).unwrap();
    for camera in [0, 3, u32::MAX] {
        sync.push_frame(FrameHeader { camera, ..header(1, 0) }, ());
    }
    sync.push_pattern(event(0));
    assert_eq!(dropped(&sync, Stage::Pairing), [(DropReason::Malformed, 3)]);
    assert_eq!(dropped(&sync, Stage::Pattern), [(DropReason::Unpaired, 1)]);
}

#[test]
fn settings_out_of_range_are_refused() {
    let refused = |settings: Settings| Synchronizer::<()>::new(settings).unwrap_err();
    assert_eq!(refused(Settings { steps: 2, ..settings() }), SettingsError::Steps { steps: 2 });
    assert_eq!(refused(Settings { steps: 17, ..settings() }), SettingsError::Steps { steps: 17 });
    assert_eq!(refused(Settings { images: 3, ..settings() }), SettingsError::Images { images: 3, steps: STEPS });
    let frame_period_ns = 999;
    assert_eq!(refused(Settings { frame_period_ns, ..settings() }), SettingsError::FramePeriod { frame_period_ns });
    let half_period_ns = PERIOD_NS / 2;
    for max_skew_ns in [0, half_period_ns + 1, u64::MAX] {
        let error = SettingsError::MaxSkew { max_skew_ns, half_period_ns };
        assert_eq!(refused(Settings { max_skew_ns, ..settings() }), error);
    }
    let source = StepSource::Events { period_px: f64::NAN };
    assert!(matches!(refused(Settings { source, ..settings() }), SettingsError::FringePeriod { .. }));
    assert_eq!(refused(Settings { window_stride: 0, ..settings() }), SettingsError::WindowStride);
    assert_eq!(refused(Settings { max_waiting: 3, ..settings() }), SettingsError::MaxWaiting { max_waiting: 3 });
}
