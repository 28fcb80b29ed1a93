//! Cameras of the driver vivid: what they send, what can be set, and what they drop.

mod formats;
mod losses;
mod settings;
