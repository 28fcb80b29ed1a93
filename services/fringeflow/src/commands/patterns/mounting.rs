//! How the projector hangs.

use fringeflow_patterns::{Flip, Orientation, Rotation};

use crate::values::one_of;

/// Mounting of the projector.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct MountingArgs {
    /// Rotate the images clockwise, degrees. 180 is for a projector that hangs upside down; 90 and 270 exchange width
    /// and height.
    #[arg(long, value_name = "DEG", default_value = "0", value_parser = one_of(&Rotation::ALL, Rotation::name))]
    rotate: Rotation,
    /// Mirror the images, after the rotation. horizontal is for a projector behind a mirror or a screen.
    #[arg(long, value_name = "FLIP", default_value = "none", value_parser = one_of(&Flip::ALL, Flip::name))]
    flip: Flip,
}

impl MountingArgs {
    pub(crate) fn orientation(self) -> Orientation {
        Orientation { rotation: self.rotate, flip: self.flip }
    }
}
