//! Point clouds: triangulation, provenance of every point, normals, export to PLY, PCD and NPZ (paper, sections 2.1
//! and 3).
//!
//! In: correspondences. Out: [`Cloud`], and files of it. Cost: some hundred operations and 41 bytes per point;
//! normals, for files alone, cost about 0.08 µs per point.

mod export;
mod exported_points;
mod normals;
mod npz;
mod pcd;
mod ply;
mod record;
mod reference;
mod triangulate;

pub use export::{CloudFormat, CloudWriteError};
pub use normals::{MeasuredPixel, Normals, PointImage};
pub use ply::ply_header;
pub use record::{CloudExport, FIELDS, RECORD_BYTES, Record, Scalar, decode_record, read_records, write_records};
pub use reference::reference_cloud;
pub use triangulate::{PointForm, TriangulationInput, Triangulator};

/// One measured point: one pixel of C1 and its correspondence in C2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CloudPoint {
    /// Position, frame of C1, metres.
    pub position_m: [f32; 3],
    /// Mean grey level of the pixel of C1.
    pub intensity: u8,
    /// Pixel of C1: column, row.
    pub cam1_px: [u16; 2],
    /// Corresponding raw image point in C2: column, row; sub-pixel.
    pub cam2_px: [f32; 2],
    /// Fringe order: number of whole periods in the absolute phase.
    pub order: i16,
    /// Back-projection phase minus wrapped phase, rad.
    pub delta_rad: f32,
    /// Number of fringe orders in the volume that the surface around the point leaves possible; with the paper's method,
    /// of candidates that passed the back-projection test.
    pub candidates: u8,
    /// How the correspondence was decided (see [`crate::correspondence::Outcome`]).
    pub stage: u8,
    /// Predicted standard deviation of the point along its ray, metres.
    pub sigma_m: f32,
    /// Probability that the correspondence is correct, 0 to 1; 0 from methods that estimate none (Gray code, the
    /// paper's).
    pub confidence: f32,
}

/// Points in the order of their pixels in C1, row by row; at most one per pixel, all numbers finite.
///
/// [`Cloud::write`] exports to a file. The records of channels and recordings are read and written in memory:
///
/// ```
/// use fringeflow::cloud::{Cloud, CloudPoint, RECORD_BYTES, read_records, write_records};
///
/// let point = CloudPoint { position_m: [0.01, -0.02, 0.3], cam1_px: [320, 256], ..CloudPoint::default() };
/// let cloud = Cloud { points: vec![point] };
/// let mut records = Vec::new();
/// write_records(&mut records, &cloud.points)?;
/// assert_eq!(records.len(), RECORD_BYTES);
/// assert_eq!(read_records(&records), Some(cloud.points));
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// The points.
    pub points: Vec<CloudPoint>,
}

impl Cloud {
    /// Candidates for each point that passed the back-projection test besides the chosen one: efc (paper, Eq. 1), as
    /// counted. 0 without points.
    #[must_use]
    pub fn false_candidates_per_point(&self) -> f64 {
        let false_candidates: u64 = self.points.iter().map(|point| u64::from(point.candidates.saturating_sub(1))).sum();
        false_candidates as f64 / self.points.len().max(1) as f64
    }
}
