//! The capture service: one V4L2 camera in, images in shared memory out.

mod capability;
mod check;
mod controls;
mod find;
mod format;
mod inventory;
mod ioctl;
mod numbering;
mod offer;
mod prepare;
mod queue;
mod rate;
mod setting;
mod stamp;
mod timings;

pub use check::{CameraError, ReadyCamera, check_cameras};
pub use controls::{Control, ControlKind, MenuItem};
pub use find::{FindError, OpenError};
pub use format::FormatError;
pub use inventory::{ListedControl, Listing, VideoSignal, camera, cameras};
pub use ioctl::CallError;
pub use offer::{OfferedFormat, OfferedSize, rates_text};
pub use prepare::PrepareError;
pub use rate::RateError;
pub use setting::{ControlError, ControlProblem};
pub use timings::TimingsError;
