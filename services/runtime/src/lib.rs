//! What every service of Fringeflow shares: arguments, stopping, accounts, reports.
//!
//! A service is a loop around a worker of the library: take what came, count it, work, count it, put it out, report.

mod account;
mod arguments;
pub mod clock;
mod host;
pub mod log;
mod preparation;
pub mod processors;
mod receive;
mod services;
mod stop;
mod transform;

pub use account::{Account, AccountError, Arrivals, SOURCES, Source, messages, sources};
pub use arguments::{ArgumentError, ServiceArgs};
pub use host::{BEAT, Host, ItemTimes, PAUSE, ServiceError, accounts_folder, channel_sizes, dashboard_file};
pub use preparation::{Preparation, Preparing};
pub use receive::{ensure_connected, receive};
pub use services::{ServiceKind, live_services, workers};
pub use stop::Stop;
pub use transform::{Dropped, Transform, run_transform};
