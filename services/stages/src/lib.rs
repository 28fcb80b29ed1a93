//! The services of the measurement, one after the other: each takes messages of one channel and puts out those of the next.
//!
//! ```text
//!  images, pattern events ─► phase ─maps─► correspondence ─correspondences─► cloud ─clouds─► tracking ─► poses, model
//!                              ▲                                                                │
//!                              └───────────────────────────── prior ────────────────────────────┘
//! ```
//!
//! Each is thin: it opens its ports, asks a worker of the library, and accounts for what it took, passed and dropped.

#![forbid(unsafe_code)]

pub mod cloud;
pub mod correspondence;
pub mod phase;
pub mod tracking;
