//! Replays a recording through the workers: prints its contents, and checks that every cloud is the same, byte by byte.
//!
//! ```text
//! cargo run --release --example replay_recording -- recordings/tooth.mcap
//! ```

#![expect(clippy::print_stdout, reason = "an example prints its results")]

use std::error::Error;
use std::path::PathBuf;

use fringeflow_recording::{Recording, Topic};
use fringeflow_replay::{VerifyOutcome, verify};

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args_os().nth(1).map(PathBuf::from).ok_or("usage: replay_recording FILE.mcap")?;
    let recording = Recording::open(&file)?;
    let setup = recording.setup();
    let [width, height] = setup.image_size_px;
    println!("{}: {width} x {height} pixels, {} phase shifts", setup.name, setup.steps);
    for topic in [Topic::Cam1Frame, Topic::Cam2Frame, Topic::Pattern, Topic::Cloud] {
        println!("{:<20} {:>6} messages", topic.name(), recording.count(topic));
    }

    // Images and priors come from the recording, so neither the number of threads nor the machine matters.
    let clouds = verify(&recording, |cloud| println!("cloud {}: {} points", cloud.published, cloud.points))?;
    let same = clouds.iter().filter(|cloud| cloud.outcome == VerifyOutcome::Same).count();
    println!("{same} of {} clouds are the same to the byte", clouds.len());
    if same == clouds.len() { Ok(()) } else { Err("a cloud differs from the recorded one".into()) }
}
