//! Plays a recording onto the channels of cameras and projector, and compares the resulting clouds with the recorded
//! ones.
//!
//! The replayer takes the place of cameras and projector, and keeps their accounts. Images keep their sessions, numbers
//! and times, so the windows of the replay are those of the recording. Only the numbers in the channels are new.

mod comparison;
mod configuration;
mod pace;
mod player;

pub use comparison::{Compared, Comparison};
pub use configuration::{ConfigurationTextError, replay_configuration};
pub use pace::Pace;
pub use player::Player;
