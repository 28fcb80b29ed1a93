//! Receives the clouds of a running instance from shared memory, without a copy, and counts what it did not get.
//!
//! ```text
//! cargo run --release --example subscribe_clouds -- demo 10       while `fringeflow demo` runs: ten clouds
//! ```

#![expect(clippy::print_stdout, reason = "an example prints what it did")]

use std::error::Error;
use std::time::{Duration, Instant};

use fringeflow::cloud::{RECORD_BYTES, decode_record};
use fringeflow_transport::{CLOUD, ChannelSizes, Instance, Node, Subscriber, wait_for};

/// How long it waits for the first cloud or the next one.
const PATIENCE: Duration = Duration::from_secs(20);

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, wanted] = &arguments[..] else { return Err("usage: subscribe_clouds INSTANCE CLOUDS".into()) };
    let wanted: u64 = wanted.parse()?;
    let node = Node::open(&Instance::new(name)?, "subscribe-clouds")?;
    // Only a publisher needs to know how large its messages may be.
    let mut clouds = Subscriber::open(&node, CLOUD, &ChannelSizes::default())?;

    let (mut received, mut lost, mut next) = (0, 0, None);
    let mut last = Instant::now();
    while received < wanted {
        while let Some(cloud) = clouds.receive()? {
            let header = cloud.header();
            // Clouds are numbered without gaps: a gap is a loss in the channel.
            lost += next.map_or(0, |next| header.published.saturating_sub(next));
            next = Some(header.published + 1);
            received += 1;
            last = Instant::now();
            println!("cloud {}: {} points, nearest {:.1} mm", header.published, header.points, nearest_mm(&cloud));
        }
        if last.elapsed() > PATIENCE {
            return Err(format!("no cloud of instance {name} for {} s", PATIENCE.as_secs()).into());
        }
        wait_for(&[&clouds], Duration::from_millis(200))?;
    }
    println!("{received} clouds received, {lost} lost");
    Ok(())
}

/// Depth of the point nearest to camera 1. The payload is read where it lies.
fn nearest_mm(cloud: &fringeflow_transport::Received<fringeflow_message::CloudHeader, [u8]>) -> f32 {
    let (records, _) = cloud.payload().as_chunks::<RECORD_BYTES>();
    let depths_m = records.iter().map(|record| decode_record(record).position_m[2]);
    1000.0 * depths_m.fold(f32::INFINITY, f32::min)
}
