//! Slips of the pattern sequence: one camera, or both, saw other steps than declared.
//!
//! In: the phase maps and the number N of steps. Out: the steps by which the pattern of each camera is ahead. A slip of
//! both cameras by the same number moves all δ by 2π/N per step and nothing else. A slip of one camera moves every
//! correspondence by a fraction of a period, and δ by about 2π/N times the place of the projector along the base. A
//! slip of the camera beside the projector is therefore invisible, and looks like a scene elsewhere.
//!
//! Motion moves δ by far less than 2π/N and is not mistaken for a slip. A surface outside the volume may agree with a
//! slip inside it. So a slip is accepted only if the surfaces of the whole scene, sought in all of space, fit better
//! with it than without.

use std::f64::consts::TAU;

use crate::phase::PhaseMap;

use super::delta_histogram::DeltaHistogram;
use super::epipolar_image::EpipolarImage;
use super::moments;
use super::view::View;

/// Standard deviation of the weight of a candidate near δ = 0, rad: twice that of calibrated rigs.
const AGREEMENT_SD_RAD: f64 = 0.08;
/// Agreement, in candidates per pixel, from which on no slip is sought: true candidates alone give about 0.9.
const ENOUGH_AGREEMENT: f64 = 0.75;
/// Least agreement of a slip. A scene beyond the volume agrees with some slip by accident, but at no more than 0.4 of
/// its pixels (clutter before a board, measured), since its δ changes with depth.
const MIN_AGREEMENT: f64 = 0.6;
/// Ratio by which a slip must agree better than the declared steps.
const MIN_RATIO_TO_NOMINAL: f64 = 2.0;
/// Ratio by which it must agree better than every other slip.
const MIN_RATIO_TO_OTHERS: f64 = 1.15;
/// Ratio by which surfaces must fit better with a slip. With a slip it is 1.2 to 2.5: a calibration error of pixels can
/// explain a slip too. It was 0.95 where a board 5 mm beyond the volume agreed with one.
const MIN_EXPLAINED_RATIO: f64 = 1.1;

/// Phases without the slip.
pub(super) struct Corrected {
    /// Steps by which the patterns of C1 and C2 were ahead of the declared ones, 0 to N − 1.
    pub(super) slip_steps: [usize; 2],
    pub(super) cam1: PhaseMap,
    pub(super) cam2: EpipolarImage,
}

/// Finds and removes a slip in a sequence of `steps` steps. `nominal_histogram` is that of δ by the declared steps.
/// `None` if no slip agrees clearly better than the declared steps.
pub(super) fn correct_slip(
    view: View<'_>,
    nominal_histogram: &DeltaHistogram,
    steps: usize,
    scratch: &mut moments::Scratch,
) -> Option<Corrected> {
    let slip_steps = find_slip(view, nominal_histogram, steps)?;
    let [of_cam1, of_cam2] = slip_steps.map(|ahead| phase_of_steps(ahead, steps));
    let (mut cam1, mut cam2) = (view.cam1.clone(), view.cam2.clone());
    cam1.phase.iter_mut().for_each(|phase| *phase = phase.wrapping_sub(of_cam1));
    cam2.subtract_phase(of_cam2);
    // The histogram sees the volume alone. Surfaces are sought in all of space.
    let nominal_nats = scratch.explain(view, None).nats;
    let corrected_nats = scratch.explain(View { cam1: &cam1, cam2: &cam2, ..view }, None).nats;
    (corrected_nats > MIN_EXPLAINED_RATIO * nominal_nats).then_some(Corrected { slip_steps, cam1, cam2 })
}

/// The slip that agrees clearly better in the volume than the declared steps, and than every other slip.
fn find_slip(
    View { cam1, cam2, table, .. }: View<'_>,
    nominal_histogram: &DeltaHistogram,
    steps: usize,
) -> Option<[usize; 2]> {
    let nominal = nominal_histogram.agreement(0.0, AGREEMENT_SD_RAD);
    if nominal >= ENOUGH_AGREEMENT {
        return None;
    }
    let mut agreements: Vec<(f64, [usize; 2])> = Vec::with_capacity(steps * steps);
    // One histogram serves all slips with the same difference of the cameras: a common slip only shifts δ.
    for apart in 0..steps {
        let histogram = DeltaHistogram::from_all_candidates(cam1, cam2, table, phase_of_steps(apart, steps));
        for of_cam2 in 0..steps {
            let agreement = histogram.agreement(of_cam2 as f64 * TAU / steps as f64, AGREEMENT_SD_RAD);
            agreements.push((agreement, [(apart + of_cam2) % steps, of_cam2]));
        }
    }
    agreements.sort_by(|a, b| b.0.total_cmp(&a.0));
    let [(best, slip), (second, _), ..] = agreements[..] else { return None };
    let is_better = best >= MIN_RATIO_TO_NOMINAL * nominal && best >= MIN_RATIO_TO_OTHERS * second;
    let is_clear = best >= MIN_AGREEMENT && is_better;
    (is_clear && slip != [0; 2]).then_some(slip)
}

/// Phase of `ahead` of N steps, turns · 65536.
fn phase_of_steps(ahead: usize, steps: usize) -> u16 {
    ((ahead << 16) / steps.max(1)) as u16
}
