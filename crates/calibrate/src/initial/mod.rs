//! A first state from measurements alone: each device by itself from homographies, then their arrangement.

mod arrangement;
mod homography;
mod intrinsics;
mod single;

pub(crate) use arrangement::Devices;
pub use arrangement::{Arrangement, ViewPose};
pub(crate) use homography::smallest_direction;
pub use single::{DeviceViews, PlaneImage, SingleDevice, calibrate_device};
