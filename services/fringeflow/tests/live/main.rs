//! Live instances from the outside: `fringeflow run`, `status`, `control` and `replay` as a user gives them, faults and
//! killed services, and what is left afterwards. Counts, balances and bytes are asserted, never rates or durations.

// A helper that cannot prepare its test fails it.
#![allow(clippy::unwrap_used, clippy::panic)]
// What a test says when it fails, or why it cannot run here, belongs on standard error.
#![allow(clippy::print_stderr)]

mod check;
mod control;
mod dataset;
mod deep_images;
mod demo;
mod faults;
mod frozen;
mod full_disk;
mod health;
mod killed;
mod monitor;
mod processors;
mod projector;
mod recorded_run;
mod refused;
mod reports;
mod support;
mod tracking;
