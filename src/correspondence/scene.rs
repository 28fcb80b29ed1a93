//! The inputs of the semi-global resolution.

use crate::phase::PhaseMap;

use super::drift::Drift;
use super::epipolar_image::EpipolarImage;
use super::segment_table::SegmentTable;

/// The inputs of a [`View`](super::view::View), and the drift of these images.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub(super) cam1: &'a PhaseMap,
    pub(super) cam2: &'a EpipolarImage,
    pub(super) table: &'a SegmentTable,
    pub(super) drift: &'a Drift,
}
