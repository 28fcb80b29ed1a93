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
//! Cameras C1 and C2 and a projector are calibrated. A segment table, computed once per rig, holds the epipolar segment
//! of every pixel of C1 within the measurement volume. [`reconstruction::Reconstructor`] runs the chain above; its
//! example goes from images to points.
//!
//! "The paper" in these pages is Bräuer-Burchardt, Möller, Munkelt, Heinze, Kühmstedt and Notni (2011), "Using
//! Geometric Constraints to Solve the Point Correspondence Problem in Fringe Projection Based 3D Measuring Systems".
//!
//! # Example: the phase of one camera
//! ```
//! use std::f64::consts::TAU;
//!
//! use fringeflow::phase::{PhaseShifts, Validity, decode};
//! use fringeflow_base::grey::GreyLevels;
//!
//! // Four 8-bit images of 64 × 1 pixels show fringes with a period of 16 pixels.
//! let shifts_rad = [0.0, 0.25, 0.5, 0.75].map(|turns| turns * TAU);
//! let grey = |u: usize, shift_rad: f64| 100.0 + 60.0 * (TAU * u as f64 / 16.0 + shift_rad).cos();
//! let images = shifts_rad.map(|shift| (0..64).map(|u| grey(u, shift).round() as u8).collect::<Vec<u8>>());
//! let levels = images.each_ref().map(|image| GreyLevels::eight_bit(image));
//! let shifts = PhaseShifts::new(&shifts_rad)?;
//! let map = decode(&levels, 64, 1, &shifts, &Validity::default()).ok_or("the images do not fit the shifts")?;
//! // One phase per pixel, as a fraction of 65536 per turn. Column 4 is at a quarter of a period: 16384.
//! assert_eq!((map.width, map.height, map.phase.len()), (64, 1, 64));
//! assert!(map.valid[4] && map.phase[4].abs_diff(16384) < 100);
//! // Modulation and mean are grey levels.
//! assert!((map.modulation[4].grey() - 60.0).abs() < 1.0 && map.mean[4] == 100);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Frames and units
//! | what | frame | unit |
//! |---|---|---|
//! | 3D points | camera 1: x right, y down, z forward | metres |
//! | exported clouds | camera 1 | millimetres unless asked otherwise |
//! | image points | raw (distorted) image, pixel centres at integers | pixels |
//! | epipolar frame | virtual camera at C2, its rows are epipolar lines ([`geometry::EpipolarFrame`]) | pixels |
//! | wrapped phase | – | turns (1 turn = 2π), as `u16` fractions: 65536 = one turn |
//! | angles elsewhere | – | radians |
//!
//! # Modules
//! | module | what it holds |
//! |---|---|
//! | [`geometry`] | cameras, distortion, rig, measurement volume, epipolar frame |
//! | [`calibration`] | reading and checking calibration files |
//! | [`phase`] | wrapped phase, modulation, validity; scenes at rest and moving |
//! | [`correspondence`] | segment table, candidates, back-projection test, resolution |
//! | [`cloud`] | points with provenance, triangulation, file formats |
//! | [`prior`] | motion and coarse depth known from earlier windows |
//! | [`worker`] | the three stages, each as `step(input, &mut output)` |
//! | [`reconstruction`] | the chain from images to cloud |
//!
//! Stable, so that they change only with the minor version and a line in the changelog: [`calibration`], [`cloud`],
//! [`geometry`], [`phase`] and [`reconstruction`], and of [`correspondence`] `SegmentTable`, `MatchSettings` and `Outcome`.
//! The others serve the command and may change. Everything else is in other crates, see ARCHITECTURE.md.

#![forbid(unsafe_code)]

pub mod calibration;
pub mod cloud;
pub mod correspondence;
pub mod geometry;
pub mod phase;
pub mod prior;
pub mod reconstruction;
pub mod worker;
