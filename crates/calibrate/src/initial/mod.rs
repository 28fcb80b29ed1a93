//! A first state from measurements alone: each device by itself from homographies, then their arrangement.

mod arrangement;
mod homography;
mod intrinsics;
mod single;

pub use arrangement::{Arrangement, ViewPose};
pub(crate) use arrangement::Devices;
pub use single::{DeviceViews, PlaneImage, SingleDevice, calibrate_device};
