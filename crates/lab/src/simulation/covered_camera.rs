//! A dark flap in front of the right half of a camera. That half is black in every image and has no correspondences.

use fringeflow_dataset::{CameraId, RenderedTruth};

use super::view::{Centre, Sample, View};

/// Column of the first covered pixel.
fn first_covered(width: usize) -> usize {
    width.div_ceil(2)
}

impl View {
    /// Returns the view with the flap: nothing in the right half.
    #[must_use]
    pub(super) fn half_covered(mut self) -> Self {
        let first = first_covered(self.width);
        for centres in self.centres.chunks_exact_mut(self.width) {
            centres[first..].fill(Centre::default());
        }
        for samples in self.samples.chunks_exact_mut(self.width * self.per_pixel) {
            samples[first * self.per_pixel..].fill(Sample::default());
        }
        self
    }
}

/// Removes from a truth the points that C2 does not see behind its flap. A flap in front of C1 needs no change: the
/// view, and so the truth, is already empty there.
pub(super) fn hide(truth: &mut RenderedTruth, covered: CameraId, cam2_width_px: usize) {
    if covered == CameraId::Cam1 {
        return;
    }
    // Pixel centres are at integers, so a pixel begins half a pixel earlier.
    let border_px = first_covered(cam2_width_px) as f32 - 0.5;
    for (i, _) in truth.cam2_px.iter().enumerate().filter(|(_, cam2_px)| cam2_px[0] >= border_px) {
        truth.seen_by_cam2[i] = false;
        truth.measurable[i] = false;
        truth.reference[i] = false;
    }
}
