//! Slips of the pattern sequence: images that show another step than they are said to, of one camera or of both.
//!
//! In: the phase maps and the number N of steps. Out: by how many steps the pattern of each camera is ahead. A slip of both by
//! the same moves all δ by 2π/N a step and nothing else. A slip of one moves every correspondence by a fraction of a period,
//! and δ by about 2π/N times the place of the projector along the base: a slip of the camera that the projector stands at
//! cannot be seen, nor can it be told from a scene elsewhere.
//!
//! Motion is no slip: what it leaves in δ is far below 2π/N. Nor is a surface outside the volume, which may agree with a slip in the
//! volume: a slip is believed only where surfaces, asked about all of space, are explained better with it than without.

use std::f64::consts::TAU;

use crate::phase::PhaseMap;

use super::delta_histogram::DeltaHistogram;
use super::drift::DriftScratch;
use super::epipolar_image::EpipolarImage;
use super::surfaces::{self, View};

/// Standard deviation of the weight with which a candidate near δ = 0 agrees, rad: twice that of calibrated rigs.
const AGREEMENT_SD_RAD: f64 = 0.08;
/// Agreement, as candidates a pixel, from which on nobody asks for a slip: the true candidates alone make about 0.9.
const PLENTY: f64 = 0.75;
/// Least agreement of a slip. A scene that lies beyond the volume agrees with some slip by accident, but at no more than 0.4 of
/// its pixels (clutter before a board, measured), since its δ changes with depth.
const LEAST: f64 = 0.6;
/// How much better a slip must agree than what the images are said to show.
const BETTER: f64 = 2.0;
/// How much better than every other slip.
const BEST: f64 = 1.15;
/// How much better surfaces must be explained with a slip: 2.5 times and more where there is one (bodies alone and before boards), 0.95
/// times where a board 5 mm beyond the volume agreed with one.
const EXPLAINED: f64 = 1.25;

/// Phases from which a slip was taken off.
pub(super) struct Corrected {
    /// Steps by which the patterns of C1 and of C2 were ahead of what was said of them, 0 to N − 1.
    pub(super) slip_steps: [usize; 2],
    pub(super) cam1: PhaseMap,
    pub(super) cam2: EpipolarImage,
}

/// Takes a slip off, of which there are so many steps; `None` where nothing agrees clearly better than what is said.
pub(super) fn correct_slip(
    view: View<'_>,
    as_said: &DeltaHistogram,
    steps: usize,
    (scratch, drift): (&mut surfaces::Scratch, &mut DriftScratch),
) -> Option<Corrected> {
    let slip_steps = find_slip(view, as_said, steps)?;
    let [of_cam1, of_cam2] = slip_steps.map(|ahead| phase_of_steps(ahead, steps));
    let (mut cam1, mut cam2) = (view.cam1.clone(), view.cam2.clone());
    cam1.phase.iter_mut().for_each(|phase| *phase = phase.wrapping_sub(of_cam1));
    cam2.turn_back(of_cam2);
    let as_said_nats = surfaces::clear_nats(view, scratch, drift);
    let corrected_nats = surfaces::clear_nats(View { cam1: &cam1, cam2: &cam2, ..view }, scratch, drift);
    (corrected_nats > EXPLAINED * as_said_nats).then_some(Corrected { slip_steps, cam1, cam2 })
}

/// The slip that agrees clearly better in the volume than what is said, and than every other.
fn find_slip(View { cam1, cam2, table }: View<'_>, as_said: &DeltaHistogram, steps: usize) -> Option<[usize; 2]> {
    let nominal = as_said.agreement(0.0, AGREEMENT_SD_RAD);
    if nominal >= PLENTY {
        return None;
    }
    let mut agreements: Vec<(f64, [usize; 2])> = Vec::with_capacity(steps * steps);
    for apart in 0..steps {
        let histogram = DeltaHistogram::from_all_candidates(cam1, cam2, table, phase_of_steps(apart, steps));
        for of_cam2 in 0..steps {
            let agreement = histogram.agreement(of_cam2 as f64 * TAU / steps as f64, AGREEMENT_SD_RAD);
            agreements.push((agreement, [(apart + of_cam2) % steps, of_cam2]));
        }
    }
    agreements.sort_by(|a, b| b.0.total_cmp(&a.0));
    let [(best, slip), (second, _), ..] = agreements[..] else { return None };
    let is_clear = best >= LEAST && best >= BETTER * nominal && best >= BEST * second;
    (is_clear && slip != [0; 2]).then_some(slip)
}

/// Phase that so many steps ahead of N add, turns · 65536.
fn phase_of_steps(ahead: usize, steps: usize) -> u16 {
    ((ahead << 16) / steps.max(1)) as u16
}
