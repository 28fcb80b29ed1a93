//! Slips of the pattern sequence: images that show another step than they are said to, of one camera or of both.
//!
//! In: the phase maps and the number N of steps. Out: by how many steps the pattern of each camera is ahead. A slip of both by
//! the same moves all δ by 2π/N a step and nothing else. A slip of one moves every correspondence by a fraction of a period,
//! and δ by about 2π/N times the place of the projector along the base: a slip of the camera that the projector stands at
//! cannot be seen, nor can it be told from a scene elsewhere.
//!
//! Motion is no slip: what it leaves in δ is far below 2π/N.

use std::f64::consts::TAU;

use crate::phase::PhaseMap;

use super::delta_histogram::DeltaHistogram;
use super::epipolar_image::EpipolarImage;
use super::segment_table::SegmentTable;

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

/// Steps by which the patterns of C1 and of C2 are ahead of what is said of them, 0 to N − 1; zero where nothing else agrees
/// clearly better.
pub(super) fn find_slip(
    cam1: &PhaseMap,
    cam2: &EpipolarImage,
    table: &SegmentTable,
    as_said: &DeltaHistogram,
    steps: usize,
) -> [usize; 2] {
    let nominal = as_said.agreement(0.0, AGREEMENT_SD_RAD);
    if nominal >= PLENTY {
        return [0; 2];
    }
    let mut agreements: Vec<(f64, [usize; 2])> = Vec::with_capacity(steps * steps);
    for apart in 0..steps {
        let histogram = DeltaHistogram::of_all_candidates(cam1, cam2, table, phase_of_steps(apart, steps));
        for of_cam2 in 0..steps {
            let agreement = histogram.agreement(of_cam2 as f64 * TAU / steps as f64, AGREEMENT_SD_RAD);
            agreements.push((agreement, [(apart + of_cam2) % steps, of_cam2]));
        }
    }
    agreements.sort_by(|a, b| b.0.total_cmp(&a.0));
    match agreements[..] {
        [(best, slip), (second, _), ..] if best >= LEAST && best >= BETTER * nominal && best >= BEST * second => slip,
        _ => [0; 2],
    }
}

/// Phase that so many steps ahead of N add, turns · 65536.
pub(super) fn phase_of_steps(ahead: usize, steps: usize) -> u16 {
    ((ahead << 16) / steps.max(1)) as u16
}
