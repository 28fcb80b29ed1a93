//! All speed ratios that the project promises, measured side by side with their peers in one run:
//! `cargo bench --bench ratios [-- [--quick] [--long] [LINE ...]]`, or `make bench`.
//!
//! Repetitions are interleaved (A B A B …), so changes in the speed of the machine affect both sides. A ratio is the
//! quotient of the medians; its range is that of the repetitions. Times are CPU times of one pinned thread unless a
//! line says otherwise.

// A program for people. It panics if it cannot measure.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout, clippy::print_stderr, missing_docs)]

mod allocations;
mod bench;
mod clock;
mod cloud;
mod counting_allocator;
mod decode;
mod line;
mod live;
mod peers;
mod processors;
mod profile;
mod recording;
mod scalar;
mod scaling;
#[path = "../scenes/mod.rs"]
#[allow(dead_code, reason = "shared with another bench")]
mod scenes;
mod sliding;
mod spans;
mod table;
mod threads;
mod workers;

use bench::Bench;
use line::Report;

#[global_allocator]
static ALLOCATOR: counting_allocator::CountingAllocator = counting_allocator::CountingAllocator;

/// Measures some lines of the table.
type Measure = fn(&mut Bench, &mut Report);

/// The measurements, by their names on the command line.
const LINES: [(&str, Measure); 13] = [
    ("decode", decode::measure),
    ("cloud", cloud::measure),
    ("scalar", scalar::measure),
    ("scaling", scaling::measure),
    ("threads", threads::measure),
    ("workers", workers::measure),
    ("live", live::measure),
    ("sliding", sliding::measure),
    ("spans", spans::measure),
    ("recording", recording::measure),
    ("table", table::measure),
    ("allocations", allocations::measure),
    ("profile", profile::measure),
];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let names = LINES.map(|(name, _)| name);
    let chosen: Vec<&str> = arguments.iter().map(String::as_str).filter(|word| !word.starts_with("--")).collect();
    if let Some(unknown) = chosen.iter().find(|word| !names.contains(word)) {
        eprintln!("unknown line {unknown:?}; known are {}", names.join(", "));
        std::process::exit(2);
    }
    let mut bench = Bench::new(&arguments);
    // Everything that does not create its own threads runs in one.
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global().unwrap();
    processors::pin_to_one();
    let mut report = Report::default();
    for (name, measure) in LINES {
        if chosen.is_empty() || chosen.contains(&name) {
            eprintln!("{name} ...");
            measure(&mut bench, &mut report);
        }
    }
    if !bench.is_measured {
        return println!("all lines work; `cargo bench --bench ratios` measures them");
    }
    report.print();
    let file = scenes::bench_folder().join("ratios.json");
    report.write_json(&file, &bench);
    println!("\n{}", file.display());
}
