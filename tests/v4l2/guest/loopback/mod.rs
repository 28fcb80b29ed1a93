//! Cameras of the driver v4l2loopback.
