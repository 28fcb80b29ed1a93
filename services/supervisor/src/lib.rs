//! Starts, watches and stops the services of an instance, answers `control`, and draws the balance at the end.

mod balance;
mod child;
mod control;
mod display;
mod naming;
mod observer;
mod plan;
mod ports;
mod process;
mod reports;
mod source;
mod supervisor;

pub use balance::{Balance, Imbalance};
pub use display::{headline, stage_line, waiting_from_outside};
pub use naming::named_by_time;
pub use observer::{Observed, observe};
pub use plan::{Outcome, Plan, RunError};
pub use source::{Progress, Source, SourceError};
pub use supervisor::run;
