//! Starts, watches and stops the services of an instance, answers `control`, and draws the balance at the end.

mod balance;
mod child;
mod tally;

pub use balance::{Balance, Imbalance};
pub use tally::{Latency, StageTally, Tally};
