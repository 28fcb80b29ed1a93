//! Plays a recording onto the channels of cameras and projector, and compares the clouds that come of it.
//!
//! It stands where cameras and projector stand, and keeps their accounts. Images keep their sessions, numbers and times, so
//! that a window of the replay is that of the recording; only the numbers of the channels are new.

mod comparison;
mod configuration;
mod pace;
mod player;

pub use comparison::{Compared, Comparison};
pub use configuration::{ConfigurationTextError, replay_configuration};
pub use pace::Pace;
pub use player::Player;
