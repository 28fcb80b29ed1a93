//! The laboratory: a virtual scanner with exact truth, and what measures the results of a real or virtual one.
//!
//! ```text
//!  simulation ─► dataset, images, truth ─► (the method) ─► cloud ─► evaluation ─► com, miss, fpc, 3D error
//!  rig_report: what a rig can be expected to do       preview: pictures of phase, depth, decisions and δ
//! ```

#![forbid(unsafe_code)]

pub mod evaluation;
pub mod preview;
pub mod rig_report;
pub mod simulation;
