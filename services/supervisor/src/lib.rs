//! Starts, watches and stops the services of an instance, answers control requests, and checks the counts at the end.

mod balance;
mod control;
mod display;
mod observer;
mod output_names;
mod plan;
mod ports;
mod process;
mod reports;
mod service;
mod source;
mod supervisor;

pub use balance::{Balance, Imbalance};
pub use display::{headline, read_startup_status, stage_line};
pub use observer::{Observed, observe};
pub use output_names::timestamped_path;
pub use plan::{Outcome, Plan, RunError};
pub use source::{Progress, Source, SourceError};
pub use supervisor::run;
