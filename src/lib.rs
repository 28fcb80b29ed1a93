//! Point clouds from the fringe images of two cameras and a projector, without Gray code.
//!
//! ```text
//!  images of C1 ─► phase ─┐
//!                         ├─► correspondence ─► cloud ─► PLY, PCD, NPZ
//!  images of C2 ─► phase ─┘   (segment table,   (triangulation,
//!                              candidates,       sigma)
//!                              back-projection,
//!                              resolution)
//! ```
//!
//! The method is that of Bräuer-Burchardt, Möller, Munkelt, Heinze, Kühmstedt and Notni (2011), "Using Geometric
//! Constraints to Solve the Point Correspondence Problem in Fringe Projection Based 3D Measuring Systems"; "the paper"
//! in these pages.
//!
//! # Frames and units
//! | what | frame | unit |
//! |---|---|---|
//! | 3D points | camera 1: x right, y down, z forward | metres |
//! | exported clouds | camera 1 | millimetres unless asked otherwise |
//! | image points | raw (distorted) image, pixel centres at integers | pixels |
//! | epipolar frame | virtual camera at C2 whose rows are epipolar lines ([`geometry::EpipolarFrame`]) | pixels |
//! | wrapped phase | – | turns (1 turn = 2π), as `u16` fractions: 65536 = one turn |
//! | angles elsewhere | – | radians |
//!
//! # Modules
//! | module | what it holds |
//! |---|---|
//! | [`geometry`] | cameras, distortion, rig, measurement volume, epipolar frame |
//! | [`calibration`] | reading and checking calibration files |
//! | [`phase`] | wrapped phase, modulation, validity |
//! | [`correspondence`] | segment table, candidates, back-projection test, resolution |
//! | [`cloud`] | points with provenance, triangulation, file formats |
//! | [`prior`] | what the stream knows of a window before its images are decoded |
//! | [`worker`] | the three stages, each as `step(input, &mut output)` |
//! | [`reconstruction`] | the chain from images to cloud |
//!
//! Everything else stands in crates of its own, see ARCHITECTURE.md.

#![forbid(unsafe_code)]

pub mod calibration;
pub mod cloud;
pub mod correspondence;
pub mod geometry;
pub mod phase;
pub mod prior;
pub mod reconstruction;
pub mod worker;
