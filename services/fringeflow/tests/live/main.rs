//! Tests of live instances by the command line: `fringeflow run`, `status`, `control` and `replay`, with faults and
//! killed services. They assert counts, balances and bytes, and that nothing is left behind; never rates or durations.

// A test fails if its preparation fails.
#![allow(clippy::unwrap_used, clippy::panic)]
// Details of a failure, and the reason of a skipped test, go to standard error.
#![allow(clippy::print_stderr)]

mod check;
mod control;
mod dataset;
mod deep_images;
mod demo;
mod faults;
mod full_disk;
mod health;
mod killed;
mod monitor;
mod monitor_projector;
mod processors;
mod projector;
mod recorded_run;
mod refused;
mod reports;
mod rigs;
mod spans;
mod stopped_services;
mod support;
mod tracking;
