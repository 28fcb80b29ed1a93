//! Checks that two phase maps and a rig belong together. Maps of another rig give a cloud too, of noise.

use super::delta_statistics::DeltaStatistics;

/// The images count as exchanged if δ scatters by less than this share of the measured sd once they are swapped, and
/// more references are found: with exchanged images δ is spread over the whole test.
const EXCHANGED_SD_RATIO: f64 = 0.5;
/// Most expected false candidates (Eq. 1): six times as many as the paper recommends. Beyond, δ has no meaning.
const MAX_FALSE_CANDIDATES: f64 = 3.0;
/// Largest sd of δ, rad: above it the test passes more than two fifths of all wrong candidates. It matters only from
/// this many expected false candidates on: on segments of one period there are none.
const MAX_SD_RAD: f64 = 0.45;
const MANY_FALSE_CANDIDATES: f64 = 1.0;
/// Least share of the pixels that must agree with the rest where sd is suspicious: wrong orders seldom agree.
const MIN_AGREEING_SHARE: f64 = 0.25;

/// Why two phase maps cannot be matched.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MatchError {
    /// A phase map has another size than the segment table was built for.
    #[error("a phase map of {found:?} pixels does not belong to a segment table for {expected:?} pixels")]
    Size {
        /// Width and height of the map of C1.
        found: [usize; 2],
        /// Width and height that the table was built for.
        expected: [usize; 2],
    },
    /// No pixel has a candidate.
    #[error(
        "no pixel of camera 1 finds its phase on its epipolar segment in camera 2: the images do not belong to this \
         calibration, or nothing lies in the measurement volume"
    )]
    NothingInCommon,
    /// The images of the cameras are exchanged.
    #[error(
        "the images of cameras 1 and 2 are exchanged: the back-projection phases scatter by {sd_rad:.2} rad, with the \
         images the other way round by {exchanged_sd_rad:.2} rad; exchange the image folders, or the cameras in the \
         calibration"
    )]
    Exchanged {
        /// Measured sd of δ, rad.
        sd_rad: f64,
        /// Measured sd of δ with the images exchanged, rad.
        exchanged_sd_rad: f64,
    },
    /// The back-projection phases agree with nothing.
    #[error(
        "the back-projection phases scatter by {sd_rad:.2} rad over {mean_periods:.1} periods, which leaves {efc:.1} \
         false candidates per pixel: the images do not belong to this calibration and pattern; is it the calibration of \
         another rig, or is period_px, phase_sign or phase_offset_rad wrong? (with correspondence.delta_sd_rad in the \
         configuration sd is taken as known)"
    )]
    NoAgreement {
        /// Measured sd of δ, rad.
        sd_rad: f64,
        /// Mean number of periods on a segment.
        mean_periods: f64,
        /// Expected false candidates by Eq. (1).
        efc: f64,
    },
    /// Few pixels agree with their neighbours.
    #[error(
        "{found} of {pixels} pixels find a correspondence that agrees with their neighbours, and the back-projection phases \
         scatter by {sd_rad:.2} rad: the images do not belong to this calibration, or nothing lies in the measurement \
         volume (with correspondence.delta_sd_rad in the configuration sd is taken as known)"
    )]
    FewAgree {
        /// Pixels with a correspondence.
        found: usize,
        /// Pixels with candidates, or with a phase.
        pixels: usize,
        /// Measured sd of δ, rad.
        sd_rad: f64,
    },
}

/// Refuses images whose δ scatters widely, but far less with the images exchanged. `exchanged` measures the latter.
fn check_order(delta: &DeltaStatistics, exchanged: impl FnOnce() -> Option<DeltaStatistics>) -> Result<(), MatchError> {
    let sd_rad = delta.sd_rad;
    let other = if delta.is_suspicious() { exchanged() } else { None };
    match other {
        Some(other) if other.sd_rad < EXCHANGED_SD_RATIO * sd_rad && other.references > delta.references => {
            Err(MatchError::Exchanged { sd_rad, exchanged_sd_rad: other.sd_rad })
        }
        _ => Ok(()),
    }
}

/// Refuses images whose δ scatters so widely that it has no meaning. `exchanged` measures δ with the images exchanged.
pub(super) fn check_scatter(
    delta: &DeltaStatistics,
    exchanged: impl FnOnce() -> Option<DeltaStatistics>,
) -> Result<(), MatchError> {
    check_order(delta, exchanged)?;
    let efc = delta.expected_false_candidates();
    refuse_if(efc > MAX_FALSE_CANDIDATES || (delta.sd_rad > MAX_SD_RAD && efc > MANY_FALSE_CANDIDATES), delta)
}

fn refuse_if(is_meaningless: bool, delta: &DeltaStatistics) -> Result<(), MatchError> {
    let (DeltaStatistics { sd_rad, mean_periods, .. }, efc) = (*delta, delta.expected_false_candidates());
    if is_meaningless { Err(MatchError::NoAgreement { sd_rad, mean_periods, efc }) } else { Ok(()) }
}

/// Refuses a result without a point, or, if the measured δ is `doubtful`, one with which a small share of the pixels
/// agrees. `found` of `pixels` have a correspondence, and δ scatters by `sd_rad`.
pub(super) fn check_share(
    sd_rad: f64,
    (doubtful, share): (bool, f64),
    found: usize,
    pixels: usize,
) -> Result<(), MatchError> {
    let few = found == 0 || (doubtful && share < MIN_AGREEING_SHARE);
    if few { Err(MatchError::FewAgree { found, pixels, sd_rad }) } else { Ok(()) }
}
