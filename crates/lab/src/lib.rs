//! The laboratory: a virtual scanner with exact truth, and the evaluation of real or virtual results.
//!
//! ```text
//!  simulation ─► dataset, images, truth ─► (the method) ─► cloud ─► evaluation ─► com, miss, fpc, 3D error
//!  paper_experiment: the tables of the paper, measured with both
//!  scene_lists: two lists of hundreds of scenes, to build the method and to judge it
//!  artefact: cloud of a plate, a ball or a ball bar ─► form, size, spacing, noise, likely causes
//!  rig_report: what a rig can be expected to do       preview: pictures of phase, depth, decisions and δ
//! ```
//!
//! ```
//! use fringeflow_lab::simulation::{Object, RigOptions, Simulation, SimulationOptions};
//!
//! let usual = SimulationOptions::usual(Object::Plane);
//! let rig = RigOptions { size_px: [64, 64], ..usual.rig };
//! let simulation = Simulation::new(SimulationOptions { rig, supersampling: 1, ..usual })?;
//! let measurable = simulation.truth().measurable.iter().filter(|&&measurable| measurable).count();
//! assert!(measurable > 1000, "{measurable} of 4096 pixels");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

pub mod artefact;
pub mod evaluation;
pub mod paper_experiment;
pub mod preview;
pub mod rig_report;
pub mod scene_lists;
pub mod simulation;
