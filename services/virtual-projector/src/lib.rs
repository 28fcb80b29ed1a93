//! The virtual projector: announces the patterns that it would show.

mod projector;

pub use projector::{Shown, VirtualProjector};
