//! Third stage. In: correspondences. Out: the point cloud. Cost: see [`crate::cloud`].

use std::sync::Arc;

use crate::cloud::{Cloud, CloudPoint, Record, TriangulationInput, Triangulator};
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
        let input = correspondences.triangulation_input();
        let matches = self.triangulator.count_matches(&input);
        out.points.resize(matches, CloudPoint::default());
        let points = self.triangulator.triangulate(&input, &self.table, &mut out.points);
        out.points.truncate(points);
    }

    /// Prepares [`Self::write`]. Returns the number of matches.
    pub fn count_matches(&mut self, input: &TriangulationInput<'_>) -> usize {
        self.triangulator.count_matches(input)
    }

    /// Writes the points of the matches that were counted last as records, into memory for so many. Returns the number
    /// of points.
    pub fn write(&mut self, input: &TriangulationInput<'_>, records: &mut [Record]) -> usize {
        self.triangulator.triangulate(input, &self.table, records)
    }
}
