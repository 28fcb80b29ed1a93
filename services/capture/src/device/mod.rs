//! Finds a device and prepares it for streaming.
//!
//! In: the name of the device in the configuration, and the wanted images. Out: an open device that has taken all its
//! settings as written, or the reason why not.
//!
//! ```text
//!  name ─► find ─► capability ─► video timings, format, rate, controls ─► read back ─► ready to stream
//! ```

mod capability;
mod controls;
mod extension_units;
mod file_kind;
mod find;
mod format;
mod inventory;
mod offer;
mod prepare;
mod rate;
mod ready;
mod setting;
mod stamp_source;
mod timings;
mod wanted;

pub use controls::{Control, ControlKind, MenuItem};
pub use extension_units::{ExtensionUnitError, ExtensionUnitProblem};
pub use find::{FindError, OpenError};
pub use format::FormatError;
pub use inventory::{ListedControl, Listing, VideoSignal, cameras, describe};
pub use offer::{OfferedFormat, OfferedSize, rates_text};
pub use prepare::PrepareError;
pub(crate) use prepare::Prepared;
pub use rate::RateError;
pub(crate) use ready::open;
pub use ready::{CameraError, ReadyCamera, check_cameras, check_stereo_camera};
pub use setting::{ControlError, ControlProblem};
pub use timings::TimingsError;
pub use wanted::Wanted;
