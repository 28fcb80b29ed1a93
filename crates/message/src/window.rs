//! The images of one measurement.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use fringeflow_base::limits::MAX_IMAGES;

/// The image pairs behind one phase map, one set of correspondences and one cloud.
///
/// The arrays are in the order of the exposures. Their entries from `images` on are zero.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.Window.3")]
pub struct Window {
    /// Session of camera 1.
    pub cam1_session: u64,
    /// Session of camera 2.
    pub cam2_session: u64,
    /// Driver sequence of the images of camera 1.
    pub cam1_sequence: [u64; MAX_IMAGES],
    /// Driver sequence of the images of camera 2.
    pub cam2_sequence: [u64; MAX_IMAGES],
    /// Start of the first exposure.
    pub first_exposure_ns: u64,
    /// Start of the last exposure.
    pub last_exposure_ns: u64,
    /// Midpoint of both, which is the time of the cloud.
    pub centre_ns: u64,
    /// Arrival of the last image on this computer.
    pub received_ns: u64,
    /// 1 + the number of the prior (message on `tracking/prior`) that was used to decode the images; 0 for none.
    pub prior: u64,
    /// Number of image pairs: N for a cycle, or more if motion is compensated.
    pub images: u32,
    /// Step of the first pair. The next pairs have the next steps.
    pub first_step: u32,
}

impl Window {
    /// Returns the number of the prior that was used to decode the images.
    #[must_use]
    pub fn prior_number(&self) -> Option<u64> {
        self.prior.checked_sub(1)
    }

    /// Driver sequences of both cameras in the order of the exposures.
    pub fn pairs(&self) -> impl Iterator<Item = [u64; 2]> + '_ {
        let pairs = self.cam1_sequence.iter().zip(&self.cam2_sequence).map(|(&a, &b)| [a, b]);
        pairs.take(self.images as usize)
    }
}
