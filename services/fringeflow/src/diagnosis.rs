//! Why images yield few points: tries what is often wrong in a calibration, a pattern or the images, and tells what
//! makes them fit. In: the decoded phase of both cameras. Cost: one search for each of some dozen alternatives, only
//! where a reconstruction has failed or found little.

use fringeflow::calibration::Mistake;
use fringeflow::correspondence::{MatchSettings, Matches, Outcome, SegmentTable};
use fringeflow::geometry::{FringePattern, MeasurementVolume, Rig};
use fringeflow::phase::{PhaseMap, PhaseShifts};
use fringeflow::worker::{CorrespondenceWorker, Correspondences, PhasePair};

/// An alternative is told if it finds this many times as many points,
const MORE_POINTS: u64 = 3;
/// and this share of the pixels with a phase.
const MIN_FOUND_SHARE: f64 = 0.25;

/// A measurement as its files describe it.
pub(crate) struct Described<'a> {
    pub(crate) rig: &'a Rig,
    pub(crate) volume: &'a MeasurementVolume,
    pub(crate) pattern: &'a FringePattern,
    pub(crate) shifts: &'a PhaseShifts,
    pub(crate) settings: MatchSettings,
}

/// What may be wrong.
#[derive(Clone, Copy)]
enum Cause {
    Calibration(Mistake),
    /// The phase falls where it should rise.
    Sign {
        offset: f64,
    },
    /// `period_px` is the number of fringes.
    Period {
        period_px: f64,
    },
    Turned {
        cameras: [bool; 2],
    },
    Mirrored,
}

impl std::fmt::Display for Cause {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Calibration(mistake) => mistake.fmt(f),
            Self::Sign { .. } => write!(
                f,
                "the fringes seem to run the other way: the images are in reverse order, or phase_sign has the wrong sign"
            ),
            Self::Period { period_px } => write!(
                f,
                "period_px seems to be the number of fringes, and must be the width of one: {period_px:.2} projector pixels"
            ),
            Self::Turned { cameras: [true, true] } => write!(f, "the images of both cameras seem to be upside down"),
            Self::Turned { cameras: [true, false] } => write!(f, "the images of camera 1 seem to be upside down"),
            Self::Turned { .. } => write!(f, "the images of camera 2 seem to be upside down"),
            Self::Mirrored => write!(f, "the images of both cameras seem to be mirrored"),
        }
    }
}

/// What makes the images fit, for people. `None` if the result is no worse than that of the alternatives. `matches` is
/// the result, if there is one.
pub(crate) fn likely_cause(
    described: &Described<'_>,
    maps: [&PhaseMap; 2],
    matches: Option<&Matches>,
) -> Option<String> {
    let found = matches.map_or(0, found_points);
    let is_good = matches.is_some_and(|matches| found >= undecided_pixels(matches));
    if is_good {
        return None;
    }
    let with_phase = maps[0].fit.valid_pixels;
    if with_phase > 0 && maps[0].phase == maps[1].phase {
        return Some("the images of both cameras are the same; each camera needs its own".to_owned());
    }
    let tried =
        causes(described).into_iter().filter_map(|cause| Some((points_without(cause, described, maps)?, cause)));
    let (points, cause) = tried.max_by_key(|(points, _)| *points)?;
    let is_likely = points > MORE_POINTS * found && points as f64 > MIN_FOUND_SHARE * with_phase as f64;
    is_likely.then(|| {
        format!(
            "{cause}; then {points} of {with_phase} pixels with a phase find a correspondence, and {found} as it is"
        )
    })
}

fn causes(described: &Described<'_>) -> Vec<Cause> {
    let mistakes = Mistake::all(described.rig, Some(described.volume)).into_iter().map(Cause::Calibration);
    let signs = [1.0, -1.0].map(|offset| Cause::Sign { offset });
    let period_px = described.rig.projector.width_px() as f64 / described.pattern.period_px;
    let period = (period_px >= 2.0).then_some(Cause::Period { period_px });
    let turned = [[false, true], [true, false], [true, true]].map(|cameras| Cause::Turned { cameras });
    mistakes.chain(signs).chain(period).chain(turned).chain([Cause::Mirrored]).collect()
}

/// Points that the images would have without this cause; `None` if they could not be matched.
fn points_without(cause: Cause, described: &Described<'_>, [cam1, cam2]: [&PhaseMap; 2]) -> Option<u64> {
    let (mut rig, mut pattern) = (*described.rig, *described.pattern);
    let mut maps = PhasePair { cam1: cam1.clone(), cam2: cam2.clone(), known_drift: None };
    match cause {
        Cause::Calibration(mistake) => rig = mistake.corrected(&rig),
        Cause::Sign { offset } => {
            (pattern.sign, pattern.offset_rad) = (-pattern.sign, offset * pattern.offset_rad);
        }
        Cause::Period { period_px } => pattern.period_px = period_px,
        Cause::Turned { cameras } => {
            for (map, is_turned) in [&mut maps.cam1, &mut maps.cam2].into_iter().zip(cameras) {
                reverse(map, if is_turned { map.phase.len() } else { 1 });
            }
        }
        Cause::Mirrored => [&mut maps.cam1, &mut maps.cam2].into_iter().for_each(|map| reverse(map, map.width)),
    }
    let table = SegmentTable::build(&rig, described.volume, &pattern).ok()?;
    let mut worker = CorrespondenceWorker::new(table.into(), described.shifts, described.settings);
    let mut correspondences = Correspondences::default();
    worker.step(&maps, &mut correspondences).ok()?;
    Some(found_points(&correspondences.matches))
}

/// Reverses the order of pixels in parts of this length.
fn reverse(map: &mut PhaseMap, length: usize) {
    map.phase.chunks_mut(length).for_each(<[_]>::reverse);
    map.modulation.chunks_mut(length).for_each(<[_]>::reverse);
    map.mean.chunks_mut(length).for_each(<[_]>::reverse);
    map.valid.chunks_mut(length).for_each(<[_]>::reverse);
}

fn found_points(matches: &Matches) -> u64 {
    matches.outcomes.iter().filter(|outcome| outcome.is_found()).count() as u64
}

/// Pixels with a phase that are left without a point although nothing tells that they see anything outside.
fn undecided_pixels(matches: &Matches) -> u64 {
    let is_undecided =
        |outcome: &&Outcome| !outcome.is_found() && !matches!(outcome, Outcome::Invalid | Outcome::OutsideVolume);
    matches.outcomes.iter().filter(is_undecided).count() as u64
}
