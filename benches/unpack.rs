//! Cost of unpacking an image, relative to a copy of the result: `cargo bench --bench unpack`.

// A program for people.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use fringeflow_pixels::{SourceFormat, unpack};

const SIZE_PX: [usize; 2] = [1280, 1024];
const ROUNDS: usize = 300;

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "{} × {} pixels; median of {ROUNDS} rounds; copies: time relative to a copy of the result",
        SIZE_PX[0], SIZE_PX[1]
    );
    for format in SourceFormat::ALL.into_iter().filter(|format| !format.is_compressed()) {
        let [unpack_us, copy_us] = measure(format)?;
        println!("{:<8}{unpack_us:8.0} µs {:6.2} copies", format.name(), unpack_us / copy_us);
    }
    Ok(())
}

/// Medians of unpacking and of copying, microseconds.
fn measure(format: SourceFormat) -> Result<[f64; 2], Box<dyn Error>> {
    let stride_bytes = format.least_stride_bytes(SIZE_PX[0]);
    let source: Vec<u8> = (0..SIZE_PX[1] * stride_bytes).map(|i| ((i * 7919) >> 3) as u8).collect();
    let mut out = vec![0; SIZE_PX[0] * SIZE_PX[1] * format.pixel_format().bytes()];
    let copied = out.clone();
    let mut times_us = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        let start = Instant::now();
        unpack(format, black_box(&source), stride_bytes, SIZE_PX, black_box(&mut out))?;
        times_us[0].push(start.elapsed().as_secs_f64() * 1e6);
        let start = Instant::now();
        black_box(&mut out).copy_from_slice(black_box(&copied));
        times_us[1].push(start.elapsed().as_secs_f64() * 1e6);
    }
    Ok(times_us.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[ROUNDS / 2]
    }))
}
