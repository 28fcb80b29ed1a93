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
//!  the surface of p has order k+1 ── its candidate fits ─────────────┤ confirmed
//!  else: cost of every order ── least sum over eight paths ──────────┤ selected
//!                                                                    ▼
//!  regions stand or fall, confidence of each pixel ──► correspondence (p, q2), or the reason why there is none
//! ```
//!
//! Φ(q) is the back-projection phase: the phase at which the projector would light the 3D point of p and q. The
//! [reference method](reference_methods) decides by neighbour votes instead of surfaces and paths.
//!
//! # Steps
//! | step | modules |
//! |---|---|
//! | segments of a rig, once | *segment table*, *builder*, *file*, *patches*, *source map*, *fingerprint* |
//! | C2 in the epipolar frame | *epipolar image*, *row view* |
//! | candidates by the scan of a segment | *candidates*, *search*; pixels with exactly one: *unique* |
//! | sd from the images | *delta histogram*, *delta statistics*, *support*; slips of the pattern sequence: *slip* |
//! | orders of whole surfaces, calibration drift | *surfaces*, *drift* |
//! | orders of the other pixels | *semi-global*, with *pixel search* as its scalar form |
//! | orders of surfaces and pixels from the moments of δ, as a setting | *moments* |
//! | as the paper does it | *reference methods* |
//! | shared | *runs*, *regions*, *disjoint sets*, *places*, *claims*, *explanation*, *chosen*, *bands*, *pool* |
//! | the chain | *matching*, *settings*; whether images and rig belong together: *agreement* |
//!
//! # Hot loops
//! | loop, per window | file |
//! |---|---|
//! | resampling of C2 | `epipolar_image.rs`, `Block::resample` |
//! | histogram of δ | `candidates.rs`, `scan_segment`, over `row_view.rs`, `MayCross` |
//! | unique candidates of the sampled rows | `unique/kernel.rs`, `Search::block` |
//! | neighbour votes | `support.rs`, `Votes::add_walk` |
//! | breaks of the wrapped phase | `surfaces/runs.rs`, `BreakKernel` |
//! | scores of all orders of sampled pixels | `surfaces/order_scores.rs`, `order_scores` |
//! | confirmation of known orders | `semi_global/kernels/confirm.rs`, `Row::confirm` |
//! | matching costs of the other pixels | `semi_global/kernels/matching_cost.rs`, `Block::matching_costs` |
//! | path sums | `semi_global/paths/sweep.rs`, `Sweep::advance` |
//! | candidates of the decided orders | `semi_global/kernels/selection.rs`, `Block::select` |
//! | support and confidence | `semi_global/grounds.rs`, `support`; `semi_global/confidence.rs`, `ConfidenceRow` |
//!
//! The kernels share `kernels/`: the segments of 32 pixels, and tables of 64 columns of C2.

mod agreement;
mod bands;
mod candidates;
mod chosen;
mod claims;
mod decay;
mod delta_histogram;
mod delta_measurement;
mod delta_statistics;
mod disjoint_sets;
mod drift;
mod epipolar_image;
mod explanation;
mod fingerprint;
mod kernels;
mod matching;
mod moments;
mod neighbourhood;
mod patches;
mod pixel_search;
mod places;
mod pool;
pub mod reference_methods;
mod regions;
mod row_view;
mod runs;
mod scene;
mod search;
mod segment;
mod segment_builder;
mod segment_fields;
mod segment_file;
mod segment_table;
mod semi_global;
mod settings;
mod slip;
mod source_map;
mod support;
mod surfaces;
#[cfg(test)]
mod test_random;
mod unique;
mod view;

pub use agreement::MatchError;
pub use candidates::{Candidate, DeltaGate};
pub use chosen::ChosenCandidates;
pub use delta_histogram::DeltaHistogram;
pub use delta_measurement::measure_delta;
pub use delta_statistics::DeltaStatistics;
pub use drift::{Drift, DriftMap, DriftModes, KnownDrift, estimate_drift};
pub use epipolar_image::EpipolarImage;
pub use fingerprint::Fingerprint;
pub use fringeflow_base::outcome::{Outcome, OutcomeCounts};
pub use matching::{Matcher, Matches, match_phases, match_phases_with_grounds};
pub use search::{Candidates, find_candidates};
pub use segment::{Segment, SegmentRow};
pub use segment_fields::SegmentTableError;
pub use segment_file::{SegmentFileError, SegmentFileProblem};
pub use segment_table::{EpipolarAxis, RayRow, SegmentTable};
pub use semi_global::{CONFIDENCE_TERMS, Confidence, Grounds};
pub use settings::{MatchSettings, ResolutionMethod, ResolutionSettings};
pub use unique::{UniqueCandidates, find_unique_candidates};
