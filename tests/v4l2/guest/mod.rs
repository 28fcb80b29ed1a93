//! What runs in the virtual machine, as root, with the drivers at hand; see [`crate::machine`].

mod capture;
mod driver;
mod faults;
mod images;
mod loopback;
mod scanner;
mod vivid;
mod witness;

pub(crate) use loopback::{SIZE_OF_CAMERAS, SIZE_OF_JPEG};
