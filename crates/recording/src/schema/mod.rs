//! The schema `fringeflow.proto` of the messages of Fringeflow, its descriptor, and its structs.
//!
//! `protoc --descriptor_set_out` created `fringeflow.desc` from the schema; every recording contains it. `prost-build`
//! generated `fringeflow.rs` from the descriptor. Both files are committed, so that a build does not need `protoc`.

#[rustfmt::skip]
#[allow(missing_docs, unreachable_pub)]
mod fringeflow;

pub(super) use self::fringeflow::{
    CloudHeader, CorrespondenceHeader, CorrespondenceMap, Drift, Fit, FrameHeader, Gauge, MapsHeader, PatternEvent,
    PhaseMaps, PoseReport, Prior, StageReport, TrackedPose, Window, WindowReport,
};

/// Descriptor set of the schema.
pub(super) const DESCRIPTOR: &[u8] = include_bytes!("fringeflow.desc");
