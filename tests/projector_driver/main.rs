//! The contract for projector drivers (docs/projector-driver.md): the C header and the Python example.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a missing compiler or interpreter fails the test")]

mod c_header;
mod python_driver;
