//! Which images belong together.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use fringeflow_base::limits::MAX_IMAGES;

/// The image pairs that one phase map, one set of correspondences and one cloud are made of: its provenance.
///
/// Entries of the arrays are in the order of the exposures; those from `images` on are zero.
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
    /// Middle between both: the time of the cloud.
    pub centre_ns: u64,
    /// When the last image had reached this machine.
    pub received_ns: u64,
    /// 1 more than the number of the message on `tracking/prior` that the images were decoded with; 0 for none.
    pub prior: u64,
    /// Number of image pairs: N of a cycle, and more where motion is compensated.
    pub images: u32,
    /// Step of the first pair; the others follow in turn.
    pub first_step: u32,
}

impl Window {
    /// Number of the message on `tracking/prior` that the images were decoded with.
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
