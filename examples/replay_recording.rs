//! A recording goes through the workers again: what is in it, and whether every cloud comes out the same to the byte.
//!
//! ```text
//! cargo run --release --example replay_recording -- recordings/tooth.mcap
//! ```

#![expect(clippy::print_stdout, reason = "an example prints what it did")]

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

    // Images and priors are those of the recording, so the number of threads and the machine make no difference.
    let clouds = verify(&recording, |cloud| println!("cloud {}: {} points", cloud.published, cloud.points))?;
    let same = clouds.iter().filter(|cloud| cloud.outcome == VerifyOutcome::Same).count();
    println!("{same} of {} clouds are the same to the byte", clouds.len());
    if same == clouds.len() { Ok(()) } else { Err("a cloud differs from the recorded one".into()) }
}
