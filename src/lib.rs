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
//! | [`atomic_file`] | writing files all or not at all |
//! | [`grey`] | grey levels, and how images of 8 to 16 bits store them |
//! | [`simd`] | instruction sets of kernels, chosen at run time |
//! | [`geometry`] | cameras, distortion, rig, measurement volume, epipolar frame |
//! | [`calibration`] | reading and checking calibration files |
//! | [`dataset`] | dataset folders: images, pattern, volume, truth |
//! | [`phase`] | wrapped phase, modulation, validity |
//! | [`correspondence`] | segment table, candidates, back-projection test, resolution |
//! | [`rig_report`] | what a rig can be expected to do, before it is built |
//! | [`cloud`] | points with provenance, triangulation, file formats |
//! | [`registration`] | how a scanner has moved between two clouds of one surface |
//! | [`prior`] | what the stream knows of a window before its images are looked at |
//! | [`fusion`] | the clouds of a moving scanner in one model of surfels |
//! | [`health`] | whether the scanner measures as it should, watched from window to window |
//! | [`worker`] | the three stages, each as `step(input, &mut output)` |
//! | [`message`] | what crosses a process border |
//! | [`pixels`] | from the formats of cameras to that of the channels |
//! | [`wire`] | phase maps and correspondences as payloads of messages |
//! | [`transport`] | channels between processes |
//! | [`synchronization`] | which images belong together: pairs, pattern steps, windows |
//! | [`reconstruction`] | the chain from images to cloud |
//! | [`preview`] | pictures of phase, depth, decisions and δ for people |
//! | [`evaluation`] | completeness, false correspondences and 3D error against a reference |
//! | [`config`] | configuration files |
//! | [`simulation`] | virtual scanner: rig, scenes, noise, exact truth |
//! | [`telemetry`] | what the stages report, gathered: rates, latencies, where the time of a window went |
//! | [`recording`] | recordings: MCAP files of what the channels carried |

pub mod atomic_file;
pub mod calibration;
pub mod cloud;
pub mod config;
pub mod correspondence;
pub mod dataset;
pub mod evaluation;
pub mod fusion;
pub mod geometry;
pub mod grey;
pub mod health;
pub mod message;
pub mod phase;
pub mod pixels;
mod png_encoding;
pub mod preview;
pub mod prior;
pub mod reconstruction;
pub mod recording;
pub mod registration;
pub mod rig_report;
pub mod simd;
pub mod simulation;
pub mod synchronization;
pub mod telemetry;
pub mod transport;
pub mod wire;
pub mod worker;
