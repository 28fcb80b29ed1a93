//! The contract for projector drivers (docs/projector-driver.md): the C header, and the example in Python.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a compiler or an interpreter that is missing fails the test")]

mod c_header;
mod python_driver;
