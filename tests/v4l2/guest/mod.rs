//! Tests that run in the virtual machine, as root and with the drivers; see [`crate::machine`].

mod capture;
mod driver;
mod faults;
mod images;
mod long_run;
mod loopback;
mod scanner;
mod vivid;
mod witness;

pub(crate) use long_run::LongRuns;
pub(crate) use loopback::{SIZE_OF_CAMERAS, SIZE_OF_JPEG};
