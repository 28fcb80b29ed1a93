//! The services of the measurement. Each receives messages of one channel and sends messages of the next.
//!
//! ```text
//!  images, pattern events ─► phase ─maps─► correspondence ─correspondences─► cloud ─clouds─► tracking ─► poses, model
//!                              ▲                                                                │
//!                              └───────────────────────────── prior ────────────────────────────┘
//! ```
//!
//! Each service is thin: it warms its worker up, opens its ports, calls a worker of the library, and counts the items
//! that it takes, passes on and drops.

#![forbid(unsafe_code)]

pub mod cloud;
pub mod correspondence;
pub mod phase;
pub mod tracking;
mod warm_up;
