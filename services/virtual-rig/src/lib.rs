//! The virtual rig: cameras and projector of an instance without a scanner.
//!
//! ```text
//!  projector ──pattern events──► channel
//!      └──────trigger──────► cameras ──images──► channels
//! ```

#![forbid(unsafe_code)]

pub mod cameras;
mod clock;
pub mod projector;
