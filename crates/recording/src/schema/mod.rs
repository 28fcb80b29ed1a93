//! Fringeflow's own messages in a recording: the schema `fringeflow.proto`, its descriptor, and the structs made of it.
//!
//! `fringeflow.desc` is what `protoc --descriptor_set_out` makes of the schema and what a recording carries;
//! `fringeflow.rs` is what `prost-build` makes of that. Both are committed, so that a build needs no `protoc`.

#[rustfmt::skip]
#[allow(missing_docs, unreachable_pub)]
mod fringeflow;

pub(super) use self::fringeflow::{
    CloudHeader, CorrespondenceHeader, CorrespondenceMap, Drift, Fit, FrameHeader, Gauge, MapsHeader, PatternEvent,
    PhaseMaps, PoseReport, Prior, StageReport, TrackedPose, Window, WindowReport,
};

/// Descriptor set of the schema.
pub(super) const DESCRIPTOR: &[u8] = include_bytes!("fringeflow.desc");
