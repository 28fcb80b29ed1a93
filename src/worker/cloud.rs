//! Third stage. In: correspondences. Out: the point cloud. Cost: see [`crate::cloud`].

use std::sync::Arc;

use crate::cloud::{Cloud, TriangulationInput, Triangulator};
use crate::correspondence::SegmentTable;
use crate::geometry::{EpipolarError, EpipolarFrame, Rig};

use super::Correspondences;

/// Triangulates the correspondences of one rig.
#[derive(Clone, Debug)]
pub struct CloudWorker {
    table: Arc<SegmentTable>,
    triangulator: Triangulator,
}

impl CloudWorker {
    /// A worker for a rig and its segment table.
    ///
    /// # Errors
    /// The rig has no epipolar frame.
    pub fn new(rig: &Rig, table: Arc<SegmentTable>) -> Result<Self, EpipolarError> {
        Ok(Self { table, triangulator: Triangulator::new(&EpipolarFrame::new(rig)?) })
    }

    /// Triangulates the points, in the order of their pixels in C1. A match whose rays do not intersect in front of the
    /// cameras has no point.
    pub fn step(&mut self, correspondences: &Correspondences, out: &mut Cloud) {
        let input = TriangulationInput {
            width: correspondences.width,
            mean: &correspondences.mean,
            modulation: &correspondences.modulation,
            phase_noise_grey: correspondences.phase_noise_grey,
            table: &self.table,
        };
        self.triangulator.triangulate(&correspondences.matches, input, out);
    }
}
