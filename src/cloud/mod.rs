//! Point clouds with the provenance of every point, and the files they are exported to.

mod export;
mod npz;
mod pcd;
mod ply;
mod record;
mod reference;

pub use export::{CloudExport, CloudFormat, CloudWriteError};
pub use ply::ply_header;
pub use record::{FIELDS, RECORD_BYTES, Scalar, decode_record, fill_with_records, read_records, write_records};
pub use reference::reference_cloud;

mod triangulate;

pub use triangulate::{TriangulationInput, Triangulator};

/// One measured point: one pixel of C1 and its correspondence in C2.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CloudPoint {
    /// Position, frame of C1, metres.
    pub position_m: [f32; 3],
    /// Mean grey level of the pixel of C1.
    pub intensity: u8,
    /// Pixel of C1: column, row.
    pub cam1_px: [u16; 2],
    /// Corresponding raw sub-pixel point in C2.
    pub cam2_px: [f32; 2],
    /// Fringe order: whole periods in the absolute phase.
    pub order: i16,
    /// Back-projection phase minus wrapped phase, rad.
    pub delta_rad: f32,
    /// Candidates that passed the back-projection test.
    pub candidates: u8,
    /// How the correspondence was decided (see [`crate::correspondence::Outcome`]).
    pub stage: u8,
    /// Predicted standard deviation of the point along its ray, metres.
    pub sigma_m: f32,
    /// Probability that the correspondence is the true one, 0 to 1; 0 by methods that state none (Gray code, the paper's).
    pub confidence: f32,
}

/// Points in the order of their pixels in C1, row by row; at most one a pixel, all numbers finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// The points.
    pub points: Vec<CloudPoint>,
}
