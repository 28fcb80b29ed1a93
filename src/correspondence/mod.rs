//! From two phase maps to one correspondence a pixel (paper, sections 2.1 to 2.3).
//!
//! In: phase maps of C1 and C2, and the [`SegmentTable`] of the rig. Out: for each pixel of C1 a [`Candidate`] or the
//! reason why it has none ([`Outcome`]). Steps, one module each:
//!
//! 1. *segment table*, *segment file*: per pixel of C1 its epipolar segment and the back-projection phase along it; once
//!    a rig, what is smooth in *patches*;
//! 2. *epipolar image*, *row view*: the phase of C2, resampled so that segments are parts of rows;
//! 3. *candidates*, *search*: points of the segment with the phase of the pixel, and the test |δ| < 3·sd; *unique*: those of
//!    pixels that have one alone; *wide*: what the searches of many pixels at once are made of;
//! 4. *delta statistics*: sd from the images themselves; *surfaces*: orders of whole surfaces, anywhere in space; *drift*: the part
//!    of sd that is no noise but calibration, from their candidates; *outlook*: what one pixel sees of its segment;
//! 5. *semi-global*: the orders of the whole image decided together, or
//!    *reference methods*: as the paper does it, by reference correspondences, Eq. (2) and contradictions;
//!    shared by both: *neighbourhood* and *support* (neighbours), *regions* and *unions*, *places* and *claims* (one point of C2
//!    serves one order), *explanation* (why a pixel has none), *chosen* (what is decided), *bands* and *pool* (memory);
//! 6. *matching*: the chain; *agreement*: whether images and rig belong together at all.

mod agreement;
mod bands;
mod candidates;
mod chosen;
mod claims;
mod decay;
mod delta_histogram;
mod delta_statistics;
mod disjoint_sets;
mod drift;
mod epipolar_image;
mod explanation;
mod fingerprint;
mod kernels;
mod matching;
mod neighbourhood;
mod patches;
mod pixel_search;
mod places;
mod pool;
pub mod reference_methods;
mod regions;
mod row_view;
mod runs;
mod search;
mod segment;
mod segment_builder;
mod segment_file;
mod segment_table;
mod semi_global;
mod settings;
mod slip;
mod source_map;
mod support;
mod surfaces;
mod unique;

pub use agreement::MatchError;
pub use candidates::{Candidate, DeltaGate};
pub use chosen::ChosenCandidates;
pub use delta_histogram::DeltaHistogram;
pub use delta_statistics::{DeltaStatistics, measure_delta};
pub use drift::{Drift, DriftMap, DriftModes, KnownDrift, estimate_drift};
pub use epipolar_image::EpipolarImage;
pub use fingerprint::Fingerprint;
pub use fringeflow_base::outcome::{Outcome, OutcomeCounts};
pub use matching::{Matcher, Matches, match_phases, match_phases_with_grounds};
pub use search::{Candidates, find_candidates};
pub use segment::{Segment, SegmentRow};
pub use segment_file::{SegmentFileError, SegmentFileProblem};
pub use segment_table::{EpipolarAxis, RayRow, SegmentTable, SegmentTableError};
pub use semi_global::{CONFIDENCE_TERMS, Confidence, Grounds};
pub use settings::{MatchSettings, ResolutionMethod, ResolutionSettings};
pub use unique::{UniqueCandidates, find_unique_candidates};
