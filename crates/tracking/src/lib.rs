//! Tracking: the pose of a moving scanner at each cloud, and one model fused from the clouds.
//!
//! ```text
//!  cloud ─► registration ─► pose ─► fusion ─► model of surfels
//!               ▲                      │
//!               └─── model, sampled ◄──┘
//! ```
//!
//! ```
//! use fringeflow::cloud::Cloud;
//! use fringeflow::geometry::{Camera, Distortion};
//! use fringeflow_tracking::fusion::{FusionSettings, Tracker, Tracking};
//!
//! let camera = Camera::new([900.0, 900.0], [160.0, 128.0], Distortion::from_opencv(&[]), [320, 256]);
//! let mut tracker = Tracker::new(camera, FusionSettings::default());
//! // Clouds come from the reconstruction. One without points cannot be registered.
//! let tracked = tracker.step(Cloud::default().points, 0);
//! assert!(matches!(tracked.tracking, Tracking::Lost(_)));
//! assert_eq!(tracker.model().surfels().len(), 0);
//! ```

#![forbid(unsafe_code)]

pub mod fusion;
pub mod messages;
pub mod registration;
mod stream;

pub use stream::TrackedStream;
