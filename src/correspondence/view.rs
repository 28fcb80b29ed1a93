//! The inputs of matching.

use crate::phase::PhaseMap;

use super::epipolar_image::EpipolarImage;
use super::moments::Model;
use super::segment_table::SegmentTable;

/// The phases of both cameras, and the segment table of their rig.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub(super) cam1: &'a PhaseMap,
    /// Phase of C2 in the epipolar frame.
    pub(super) cam2: &'a EpipolarImage,
    pub(super) table: &'a SegmentTable,
    /// Constants of the order decision.
    pub(super) model: &'a Model,
}
