//! Faults of vivid cameras, and what the operating system can do to the capture service.

mod errors;
mod killed;
mod signals;
mod unplugging;
mod wraps;
