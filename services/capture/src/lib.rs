//! The capture service: one V4L2 camera in, images in shared memory out.

mod capability;
mod controls;
mod find;
mod format;
mod ioctl;
mod numbering;
mod offer;
mod prepare;
mod queue;
mod rate;
mod setting;
mod stamp;
mod timings;
