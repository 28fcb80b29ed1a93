//! Cameras of the driver vivid: all that it can make go wrong, and what the system can do to the capture service.

mod errors;
mod killed;
mod signals;
mod unplugging;
mod wraps;
