//! Cameras of the driver vivid: what they send, what can be set, what they drop, and what an image costs.

mod cost;
mod formats;
mod losses;
mod settings;
