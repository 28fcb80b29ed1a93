//! Shared parts of all services: arguments, stop requests, accounts, reports, logs.
//!
//! A service is a loop around a worker of the library: take a message, count it, work, count the result, send it,
//! report.

mod account;
mod arguments;
pub mod clock;
mod host;
pub mod log;
mod preparation;
pub mod processors;
mod receive;
mod recorder_status;
mod services;
mod status_file;
mod stop;
mod transform;
mod virtual_images;
mod window_span;

pub use account::{Account, AccountError, Arrivals, Source, accounts_folder, sent_messages, sources};
pub use arguments::{ArgumentError, ServiceArgs};
pub use host::{Host, ItemTimes, MAX_WAIT, POLL_INTERVAL, ServiceError, channel_sizes, dashboard_file};
pub use preparation::{Preparation, PreparationReporter};
pub use receive::{ensure_connected, receive};
pub use recorder_status::{RecorderStatus, RecordingRate, free_bytes};
pub use services::{ServiceKind, live_services, measurement_services};
pub use stop::Stop;
pub use transform::{Dropped, Transform, run_transform};
pub use virtual_images::{has_virtual_images, note_virtual_images};
pub use window_span::WindowSpan;
