//! The virtual rig: simulated cameras and projector for an instance without a scanner.
//!
//! ```text
//!  projector ──pattern events──► channel
//!      └──────trigger──────► cameras ──images──► channels
//! ```

#![forbid(unsafe_code)]

pub mod cameras;
mod clock;
pub mod projector;
