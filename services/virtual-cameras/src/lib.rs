//! Both virtual cameras in one process: they share the scene and the trigger.

mod camera;
mod trigger;

pub use camera::{Exposed, Shot, Timing, VirtualCamera};
pub use trigger::{CableTriggers, ClockTriggers, Trigger};
