//! Stereo matching: from two phase maps to one correspondence per pixel of C1 (paper, sections 2.1 to 2.3).
//!
//! In: phase maps of C1 and C2, and the [`SegmentTable`] of the rig. Out: for each pixel of C1 a [`Candidate`], or the
//! reason why it has none ([`Outcome`]).
//!
//! # How a pixel is decided
//! ```text
//!  pixel p of C1, wrapped phase φ                         epipolar frame of C2
//!        │ segment table                 row of C2    ──────┬─────────┬─────────┬─────────┬──────
//!        ▼                               segment           q1        q2        q3        q4        φ(q) = φ
//!  epipolar segment ──────────────────►  fringe order      k        k+1       k+2       k+3
//!                                        δ = Φ(q) − φ    −2.4      0.02       2.4      −1.5       rad, about the drift
//!                                                                    ▲
//!  δ of all orders over a node of the surface of p: its moments ──── likelihood ratio of each order
//!  orders of all nodes along surfaces ── the surface of p has order k+1 ── its candidate fits
//!  surfaces stand or fall, confidence of each pixel ──► correspondence (p, q2), or the reason why there is none
//! ```
//!
//! Φ(q) is the back-projection phase: the phase at which the projector would light the 3D point of p and q. The
//! [reference method](reference_methods) decides by neighbour votes instead of surfaces.
//!
//! # Steps
//! | step | modules |
//! |---|---|
//! | segments of a rig, once | *segment table*, *builder*, *file*, *patches*, *source map*, *fingerprint* |
//! | C2 in the epipolar frame | *epipolar image*, *row view* |
//! | candidates by the scan of a segment | *candidates*, *search*; pixels with exactly one: *unique* |
//! | sd from the images | *delta histogram*, *delta statistics*, *support*; slips of the pattern sequence: *slip* |
//! | orders of surfaces and pixels, from the moments of δ | *moments*; the calibration drift that they show: *drift* |
//! | as the paper does it | *reference methods* |
//! | shared | *runs*, *disjoint sets*, *neighbourhood*, *chosen*, *bands*, *pool* |
//! | the chain | *matching*, *settings*; whether images and rig belong together: *agreement* |
//!
//! # Hot loops
//! | loop, per window | file |
//! |---|---|
//! | resampling of C2 | `epipolar_image.rs`, `Block::resample` |
//! | histogram of δ | `candidates.rs`, `scan_segment`, over `row_view.rs`, `MayCross` |
//! | unique candidates of the sampled rows | `unique/kernel.rs`, `Search::block` |
//! | neighbour votes | `support.rs`, `Votes::add_walk` |
//! | breaks of the wrapped phase | `moments/phase_runs.rs`, `BreakKernel` |
//! | orders that can fit a node | `moments/samples.rs`, `Screen` |
//! | sums of δ over a node | `moments/samples.rs`, `AllSums` |
//! | orders along surfaces | `moments/belief.rs`, `Propagation` |
//! | one look at a pixel at an order | `moments/look.rs`, `BlockLook` |
//!
//! The kernels share `kernels/`: the segments of 32 pixels, and tables of 64 columns of C2.

mod agreement;
mod bands;
mod candidates;
mod chosen;
mod delta_histogram;
mod delta_measurement;
mod delta_statistics;
mod disjoint_sets;
mod drift;
mod epipolar_image;
mod fingerprint;
mod kernels;
mod matching;
mod moments;
mod neighbourhood;
mod patches;
mod pool;
pub mod reference_methods;
mod row_view;
mod runs;
mod search;
mod segment;
mod segment_builder;
mod segment_fields;
mod segment_file;
mod segment_table;
mod settings;
mod slip;
mod source_map;
mod support;
#[cfg(test)]
mod test_random;
mod unique;
mod view;
mod wanted;

pub use agreement::MatchError;
pub use candidates::{Candidate, DeltaGate};
pub use chosen::ChosenCandidates;
pub use delta_histogram::DeltaHistogram;
pub use delta_measurement::measure_delta;
pub use delta_statistics::DeltaStatistics;
pub use drift::{Drift, DriftMap, DriftModes, KnownDrift};
pub use epipolar_image::EpipolarImage;
pub use fingerprint::Fingerprint;
pub use fringeflow_base::outcome::{Outcome, OutcomeCounts};
pub use matching::{Matcher, Matches, match_phases, match_phases_with_grounds};
pub use moments::{CONFIDENCE_TERMS, Confidence, Constant, Grounds, Model, Step};
pub use search::{Candidates, find_candidates};
pub use segment::{Segment, SegmentRow};
pub use segment_fields::SegmentTableError;
pub use segment_file::{SegmentFileError, SegmentFileProblem};
pub use segment_table::{EpipolarAxis, RayRow, SegmentTable};
pub use settings::{MatchSettings, ResolutionMethod, ResolutionSettings};
pub use unique::{UniqueCandidates, find_unique_candidates};
