//! What runs in the virtual machine, as root, with the drivers at hand; see [`crate::machine`].

mod driver;
mod loopback;
mod vivid;
