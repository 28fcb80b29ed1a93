//! Cost of unpacking an image, relative to a copy of the result: `cargo bench --bench unpack`.

// A program for people.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

use fringeflow::geometry::Readout;
use fringeflow_pixels::{BayerGrey, BayerOrder, DeviceImages, ImageReader, SourceFormat};

const SIZE_PX: [usize; 2] = [1280, 1024];
const ROUNDS: usize = 300;

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "{} × {} pixels; median of {ROUNDS} rounds; copies: time relative to a copy of the result",
        SIZE_PX[0], SIZE_PX[1]
    );
    // The order of the colours does not change the cost.
    let is_measured = |format: &SourceFormat| {
        !format.is_compressed() && format.bayer_order().is_none_or(|order| order == BayerOrder::Rggb)
    };
    for format in SourceFormat::ALL.into_iter().filter(is_measured) {
        let greys = if format.bayer_order().is_some() { BayerGrey::ALL.map(Some).to_vec() } else { vec![None] };
        for grey in greys {
            let [unpack_us, copy_us] = measure(DeviceImages::new(format, grey, None)?)?;
            let name = format!("{format} {}", grey.map_or("", BayerGrey::name));
            println!("{name:<20}{unpack_us:8.0} µs {:6.2} copies", unpack_us / copy_us);
        }
    }
    Ok(())
}

/// Medians of unpacking and of copying, microseconds.
fn measure(images: DeviceImages) -> Result<[f64; 2], Box<dyn Error>> {
    let format = images.format();
    let mut reader = ImageReader::new(images, Readout::whole(SIZE_PX))?;
    let stride_bytes = format.least_stride_bytes(SIZE_PX[0]);
    let source: Vec<u8> = (0..SIZE_PX[1] * stride_bytes).map(|i| ((i * 7919) >> 3) as u8).collect();
    let mut out = vec![0; reader.image_bytes()];
    let copied = out.clone();
    let mut times_us = [Vec::new(), Vec::new()];
    for _ in 0..ROUNDS {
        let start = Instant::now();
        reader.read(0, black_box(&source), stride_bytes, black_box(&mut out))?;
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
