//! Cameras of the driver vivid: all that it can make go wrong, and what the system can do to the capture service.

mod errors;
mod signals;
mod unplugging;
mod wraps;
