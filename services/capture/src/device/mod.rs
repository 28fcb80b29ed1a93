//! What a device is, and how it is made ready: in goes its name in the configuration and the images that are wanted of it,
//! out comes an open device that takes its settings as written, or the reason why not.
//!
//! ```text
//!  name ─► find ─► capability ─► video timings, format, rate, controls ─► read back ─► ready to stream
//! ```

mod capability;
mod controls;
mod find;
mod format;
mod inventory;
mod offer;
mod prepare;
mod rate;
mod ready;
mod setting;
mod timings;

pub use controls::{Control, ControlKind, MenuItem};
pub use find::{FindError, OpenError};
pub use format::FormatError;
pub use inventory::{ListedControl, Listing, VideoSignal, cameras, describe};
pub use offer::{OfferedFormat, OfferedSize, rates_text};
pub(crate) use prepare::Prepared;
pub use prepare::{PrepareError, Wanted};
pub use rate::RateError;
pub(crate) use ready::open;
pub use ready::{CameraError, ReadyCamera, check_cameras};
pub use setting::{ControlError, ControlProblem};
pub use timings::TimingsError;
