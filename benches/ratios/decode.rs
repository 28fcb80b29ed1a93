//! Decoding, relative to reading the same images, and to decoding four images with other libraries.

use std::cell::RefCell;
use std::hint::black_box;

use fringeflow::phase::{PhaseMap, Validity, decode_into};
use fringeflow_base::grey::PixelFormat;
use fringeflow_dataset::GreyImage;

use super::bench::{Bench, STEPS};
use super::clock::{contender, interleave};
use super::line::{Report, Target, Time};
use super::scenes::shifts;

/// Steps, and the largest time of decoding relative to reading.
const TARGETS: [(usize, f64); 3] = [(4, 3.0), (8, 2.0), (16, 2.1)];
/// Bytes of all images: more than a last-level cache holds, so each image is read from memory.
const COLD_BYTES: usize = 384 << 20;
/// Peers, and the promised speed-up over each.
const PEERS: [(&str, &str, f64); 3] = [
    ("opencv_decode", "OpenCV subtract + cartToPolar", 2.5),
    ("numpy_decode", "numpy", 30.0),
    ("fringes_decode", "fringes", 200.0),
];

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    compare_with_reading(bench, report);
    compare_with_peers(bench, report);
}

fn compare_with_reading(bench: &Bench, report: &mut Report) {
    let (easy, [width, height], validity) = (bench.easy(), bench.size_px, Validity::default());
    for format in [PixelFormat::Grey, PixelFormat::Y12] {
        for (steps, limit) in TARGETS {
            let images = easy.scene.images(steps, format);
            let (window, shifts) = (&images.cameras[0], shifts(steps));
            let bytes: usize = window.iter().map(|image| image.pixels.len()).sum();
            let copies = if bench.is_measured { COLD_BYTES.div_ceil(bytes) } else { 1 };
            // A repetition goes through all copies, so the others have displaced each one from the caches.
            let windows: Vec<Vec<GreyImage>> = vec![window.clone(); copies];
            // Like a worker, reuse the memory of one map for every window.
            let mut map = PhaseMap::default();
            let mut contenders = [
                contender(|| {
                    for window in &windows {
                        decode_into(&mut map, &GreyImage::levels_of(window), width, height, &shifts, &validity)
                            .unwrap();
                        black_box(&map);
                    }
                }),
                contender(|| {
                    for window in &windows {
                        _ = black_box(window.iter().map(|image| sum(&image.pixels)).fold(0, u64::wrapping_add));
                    }
                }),
            ];
            let spent = interleave(bench.repetitions.min(9), &mut contenders);
            let name = format!("decode ÷ reading the images cold, {}, N = {steps}", format.name());
            let units = copies as f64;
            let (ours, reading) = ((spent[0].as_slice(), units), (spent[1].as_slice(), units));
            report.scaled_ratio(&name, [ours, reading], Time::Cpu, Target::AtMost(limit));
        }
    }
}

/// Sums the words of an image, eight at a time, so that only memory limits the speed.
fn sum(bytes: &[u8]) -> u64 {
    let (blocks, rest) = bytes.as_chunks::<64>();
    let mut sums = [0_u64; 8];
    for block in blocks {
        for (sum, word) in sums.iter_mut().zip(block.as_chunks::<8>().0) {
            *sum = sum.wrapping_add(u64::from_le_bytes(*word));
        }
    }
    let rest = rest.iter().map(|&byte| u64::from(byte)).sum::<u64>();
    sums.iter().fold(rest, |all, &sum| all.wrapping_add(sum))
}

fn compare_with_peers(bench: &mut Bench, report: &mut Report) {
    let (easy, [width, height], validity) = (bench.easy(), bench.size_px, Validity::default());
    let (window, shifts) = (GreyImage::levels_of(&easy.images.cameras[0]), shifts(STEPS));
    let repetitions = bench.repetitions;
    let name = |peer: &str| format!("decode N = {STEPS} against {peer}");
    let peers = match bench.peers() {
        Ok(peers) => RefCell::new(peers),
        Err(why) => return PEERS.iter().for_each(|(_, peer, _)| report.skipped(&name(peer), &why)),
    };
    let mut map = PhaseMap::default();
    let mut contenders = vec![contender(|| {
        decode_into(&mut map, &window, width, height, &shifts, &validity).unwrap();
        black_box(&map);
    })];
    for (peer, ..) in PEERS {
        let peers = &peers;
        contenders.push(Box::new(move || peers.borrow_mut().run(peer)));
    }
    let spent = interleave(repetitions, &mut contenders);
    for ((_, peer, factor), taken) in PEERS.into_iter().zip(&spent[1..]) {
        report.ratio(&name(peer), taken, &spent[0], Time::Cpu, Target::AtLeast(factor));
    }
}
