//! What every service of Fringeflow shares: arguments, stopping, accounts, reports.
//!
//! A service is a loop around a worker of the library: take what came, count it, work, count it, put it out, report.

mod account;
mod arguments;
pub mod clock;
pub mod log;
mod stop;

pub use account::{Account, AccountError, SOURCES};
pub use arguments::{ArgumentError, ServiceArgs};
pub use stop::Stop;
