//! How a scanner has moved, and one model of what it saw.
//!
//! ```text
//!  cloud ─► registration ─► pose ─► fusion ─► model of surfels
//!               ▲                      │
//!               └──── model, drawn ◄───┘
//! ```

#![forbid(unsafe_code)]

pub mod fusion;
pub mod messages;
pub mod registration;
mod stream;

pub use stream::TrackedStream;
