//! Receives the clouds of a running instance from shared memory, without a copy, and counts the clouds that it missed.
//!
//! ```text
//! cargo run --release --example subscribe_clouds -- demo 10       while `fringeflow demo` runs; receives ten clouds
//! ```

#![expect(clippy::print_stdout, reason = "an example prints its results")]

use std::error::Error;
use std::time::{Duration, Instant};

use fringeflow::cloud::{RECORD_BYTES, decode_record};
use fringeflow_transport::{CLOUD, ChannelSizes, Instance, Node, Subscriber, wait_for};

/// Longest wait for the next cloud.
const TIMEOUT: Duration = Duration::from_secs(20);

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, wanted] = &arguments[..] else { return Err("usage: subscribe_clouds INSTANCE CLOUDS".into()) };
    let wanted: u64 = wanted.parse()?;
    let node = Node::open(&Instance::new(name)?, "subscribe-clouds")?;
    // The sizes matter only to a publisher.
    let mut clouds = Subscriber::open(&node, CLOUD, &ChannelSizes::default())?;

    let (mut received, mut lost, mut next_number) = (0, 0, None);
    let mut last_arrival = Instant::now();
    while received < wanted {
        while let Some(cloud) = clouds.receive()? {
            let header = cloud.header();
            // Clouds are numbered without gaps, so a gap is a loss in the channel.
            lost += next_number.map_or(0, |next| header.published.saturating_sub(next));
            next_number = Some(header.published + 1);
            received += 1;
            last_arrival = Instant::now();
            println!("cloud {}: {} points, nearest {:.1} mm", header.published, header.points, nearest_mm(&cloud));
        }
        if last_arrival.elapsed() > TIMEOUT {
            return Err(format!("no cloud of instance {name} for {} s", TIMEOUT.as_secs()).into());
        }
        wait_for(&[&clouds], Duration::from_millis(200))?;
    }
    println!("{received} clouds received, {lost} lost");
    Ok(())
}

/// Depth of the point nearest to camera 1. Reads the payload in place.
fn nearest_mm(cloud: &fringeflow_transport::Received<fringeflow_message::CloudHeader, [u8]>) -> f32 {
    let (records, _) = cloud.payload().as_chunks::<RECORD_BYTES>();
    let depths_m = records.iter().map(|record| decode_record(record).position_m[2]);
    1000.0 * depths_m.fold(f32::INFINITY, f32::min)
}
