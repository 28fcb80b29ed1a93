//! The capture service: one V4L2 camera in, images in shared memory out.

mod ioctl;
mod numbering;
mod queue;
mod stamp;
