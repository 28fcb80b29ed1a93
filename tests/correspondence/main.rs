//! Tests of correspondences: the segment table, the search for candidates, and the whole chain on simulated scenes.

#![expect(clippy::unwrap_used, reason = "a rig that cannot be built fails the test")]

mod chain;
mod random;
mod search;
mod table;
