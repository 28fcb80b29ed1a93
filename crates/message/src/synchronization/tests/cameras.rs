//! Pairs and skew of two cameras that start at different times, run freely, or share a trigger.

use crate::Incident;

use super::*;

const STEPS: usize = 4;
/// The default limit of the skew: a twentieth of the period.
const MAX_SKEW_NS: u64 = PERIOD_NS / 20;

/// Feeds the images of both cameras in the order of their times, each with the number of its own camera. Pairs are
/// admitted up to a skew of `max_skew_ns`.
fn run(
    starts_ns: [u64; 2],
    periods_ns: [u64; 2],
    max_skew_ns: u64,
    images: u64,
) -> (Synchronizer<u64>, Vec<WindowImages<u64>>) {
    let settings = Settings {
        steps: STEPS,
        images: STEPS,
        frame_period_ns: PERIOD_NS,
        max_skew_ns,
        source: StepSource::Cycle,
        window_stride: 1,
        max_waiting: STEPS + 3,
    };
    let mut sync = Synchronizer::new(settings).unwrap();
    let header = |camera: u32, sequence: u64| {
        let index = camera as usize - 1;
        let exposure_start_ns = starts_ns[index] + sequence * periods_ns[index];
        let received_ns = exposure_start_ns + PERIOD_NS;
        let session = 7 + u64::from(camera);
        FrameHeader {
            session,
            sequence,
            published: sequence,
            exposure_start_ns,
            received_ns,
            camera,
            ..FrameHeader::default()
        }
    };
    let mut headers: Vec<FrameHeader> = (0..images).flat_map(|k| [header(1, k), header(2, k)]).collect();
    headers.sort_by_key(|header| header.exposure_start_ns);
    let mut windows = Vec::new();
    for header in headers {
        sync.push_frame(header, header.sequence);
        windows.extend(std::iter::from_fn(|| sync.next_window()));
    }
    sync.end();
    (sync, windows)
}

fn dropped(sync: &Synchronizer<u64>, reason: DropReason) -> u64 {
    let counts = sync.counts(Stage::Pairing).unwrap();
    assert_eq!(counts.in_work(), Some(0));
    counts.dropped(reason)
}

#[test]
fn images_before_the_start_of_the_other_camera_have_no_partner() {
    let second_ns = 1_000_000_000;
    let (mut sync, windows) = run([second_ns, second_ns + 7 * PERIOD_NS + 40_000], [PERIOD_NS; 2], 40_000, 30);
    assert_eq!(dropped(&sync, DropReason::Unpaired), 7);
    // The last seven images of camera 2 wait for partners that never arrive.
    assert_eq!(dropped(&sync, DropReason::Stopped), 7);
    assert_eq!(windows.len(), 23 - (STEPS - 1));
    // The partner in camera 2 has a number that is lower by seven.
    assert!(windows.iter().all(|window| window.cam1.iter().zip(&window.cam2).all(|(a, b)| a - b == 7)));
    let skew = sync.take_skew();
    assert_eq!((skew.pairs, skew.mean_ns(), skew.least_ns, skew.greatest_ns), (23, Some(40_000.0), 40_000, 40_000));
    assert_eq!(sync.take_skew().pairs, 0);
}

#[test]
fn without_a_narrower_limit_free_running_cameras_are_paired_until_they_slip_by_an_image() {
    // The period of camera 2 is longer by 0.31 %, so that it slips by an image every 323 images.
    let half_ns = PERIOD_NS / 2;
    let (mut sync, windows) = run([1_000_000_000; 2], [PERIOD_NS, PERIOD_NS + 31_000], half_ns, 2000);
    let skew = sync.take_skew();
    assert!(skew.least_ns > -(half_ns as i64) && skew.greatest_ns < half_ns as i64, "{skew:?}");
    // At each slip one image of camera 1 is left over, and the next pair has a new offset of its numbers.
    let slips = 6;
    assert_eq!(dropped(&sync, DropReason::Unpaired), slips);
    assert_eq!(dropped(&sync, DropReason::BadTime), 2 * slips);
    assert_eq!((dropped(&sync, DropReason::Skewed), sync.next_skew_notice()), (0, None));
    // The gap starts a new run of pairs and costs the windows that would cross it.
    let admitted = skew.pairs - slips;
    assert_eq!(skew.pairs, 2000 - slips);
    assert_eq!(windows.len() as u64, admitted - (slips + 1) * (STEPS as u64 - 1));
}

#[test]
fn pairs_of_free_running_cameras_beyond_the_limit_are_refused_and_told_once() {
    let slower_ns = 31_000;
    let (mut sync, windows) = run([1_000_000_000; 2], [PERIOD_NS, PERIOD_NS + slower_ns], MAX_SKEW_NS, 2000);
    // Both cameras start together seven times, and about 16 pairs before and after it are within the limit.
    for (first, second) in windows.iter().flat_map(|window| window.cam1.iter().zip(&window.cam2)) {
        assert!((second * (PERIOD_NS + slower_ns)).abs_diff(first * PERIOD_NS) <= MAX_SKEW_NS, "{first}, {second}");
    }
    let counts = *sync.counts(Stage::Pairing).unwrap();
    let refused_pairs = dropped(&sync, DropReason::Skewed) / 2;
    // No other reason: the slips are among the refused pairs.
    assert_eq!(dropped(&sync, DropReason::BadTime), 0);
    assert_eq!(counts.passed / 2 + refused_pairs, sync.take_skew().pairs);
    assert_eq!(counts.passed / 2, windows.len() as u64 + 7 * (STEPS as u64 - 1));
    let began = SkewNotice::Began { skew_ns: 17 * slower_ns as i64, max_skew_ns: MAX_SKEW_NS };
    assert_eq!(sync.next_skew_notice(), Some(began));
    assert_eq!(sync.next_skew_notice(), Some(SkewNotice::Ended { refused_pairs }));
    assert_eq!(sync.next_skew_notice(), None);
    assert_eq!(counts.incidents().collect::<Vec<_>>(), [(Incident::Skewed, 1)]);
}

#[test]
fn all_images_of_cameras_with_a_shared_trigger_are_paired() {
    let (mut sync, windows) = run([1_000_000_000, 1_000_012_000], [PERIOD_NS; 2], MAX_SKEW_NS, 500);
    let skew = sync.take_skew();
    assert_eq!((skew.pairs, skew.least_ns, skew.greatest_ns), (500, 12_000, 12_000));
    assert_eq!(windows.len(), 500 - (STEPS - 1));
}
