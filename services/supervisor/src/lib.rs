//! Starts, watches and stops the services of an instance, answers `control`, and draws the balance at the end.

mod balance;
mod child;
mod control;
mod display;
mod observer;
mod source;
mod supervisor;

pub use balance::{Balance, Imbalance};
pub use display::{headline, stage_line};
pub use observer::observe;
pub use source::{Progress, Source, SourceError};
pub use supervisor::{Outcome, Plan, RunError, run};
