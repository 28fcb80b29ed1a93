//! A projector that is a second monitor.
//!
//! ```text
//!  PatternSet ──► Window (full screen, images in the X server) ──► monitor
//!                   ▲ target refresh      │ refresh at which an image was shown, and its time
//!                 Schedule ◄──────────────┘
//!                   └──► PatternEvent ──► channel projector/pattern
//! ```
//!
//! Images are shown through the Present extension of X11: each is handed over with the number of the refresh at which it
//! shall appear, and the server tells at which one it did, with the time of that vertical blank on `CLOCK_MONOTONIC`. No
//! other interface of a desktop tells this without OpenGL or Vulkan.

#![forbid(unsafe_code)]

mod check;
mod error;
mod monitor;
mod schedule;
mod show;
mod window;

pub use check::{Steadiness, check};
pub use error::ProjectorError;
pub use monitor::{Monitor, Screen};
pub use show::{Announced, Cycle, ShownCounts, announce, show};
