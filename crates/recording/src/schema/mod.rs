//! The schema `fringeflow.proto` of our own messages, its descriptor, and its structs.
//!
//! `protoc --descriptor_set_out` made `fringeflow.desc` of the schema; every recording contains it. `prost-build` made
//! `fringeflow.rs` of the descriptor. Both are committed, so that a build needs no `protoc`.

#[rustfmt::skip]
#[allow(missing_docs, unreachable_pub)]
mod fringeflow;

pub(super) use self::fringeflow::{
    CloudHeader, CorrespondenceHeader, CorrespondenceMap, Drift, Fit, FrameHeader, Gauge, MapsHeader, PatternEvent,
    PhaseMaps, PoseReport, Prior, StageReport, TrackedPose, Window, WindowReport,
};

/// Descriptor set of the schema.
pub(super) const DESCRIPTOR: &[u8] = include_bytes!("fringeflow.desc");
