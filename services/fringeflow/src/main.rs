//! The fringeflow command.
fn main() {}
