//! Checks that each detection is what its id says.
//!
//! 1. The image around a feature looks as the board does there.
//! 2. The cells of the markers in the image are those of the board.
//! 3. No feature stands out from its neighbours.
//! 4. No feature was fitted far worse than the others: the border of a light or of a shadow may cross its edges.

use nalgebra::{Matrix3, Vector3};

use super::homography::{Homography, Point};
use super::refine::{Refined, Refinement};
use super::{BoardImage, Detection};
use crate::board::Board;

/// Points along a side of the surroundings that are compared, and their extent in cells.
const POINTS: i32 = 25;
const EXTENT_CELLS: f64 = 1.2;
/// Least correlation of the surroundings with the board, and least share of them that must be in the image.
const LEAST_CORRELATION: f64 = 0.55;
const LEAST_SEEN: f64 = 0.3;
/// Least share of the cells of markers that must have the colour of the board.
const LEAST_CELLS: f64 = 0.75;
/// Neighbours that predict a feature, and the tolerance: pixels, and multiples of the median deviation.
const NEIGHBOURS: usize = 12;
const TOLERANCE_PX: f64 = 0.5;
const TOLERANCE_MEDIANS: f64 = 6.0;
/// Largest standard deviation in medians of all, from which a feature is left out.
const MOST_SD_MEDIANS: f64 = 4.0;

/// The detections that pass all checks.
pub(super) fn verified(board: &Board, image: &BoardImage, refinement: Refinement) -> Vec<Detection> {
    let Some(map) = refinement.map else { return Vec::new() };
    let places: Vec<Point> = board.features().iter().map(|[x, y, _]| [*x, *y]).collect();
    let mut found = refinement.features;
    found.retain(|refined| correlation(board, image, &map, places[refined.feature], refined.at) >= LEAST_CORRELATION);
    if share_of_cells(board, image, &map, &places, &found).is_some_and(|share| share < LEAST_CELLS) {
        return Vec::new();
    }
    remove_outstanding(&mut found, &places, &map);
    let mut deviations: Vec<f64> = found.iter().map(|refined| refined.sd_px).collect();
    if !deviations.is_empty() {
        let middle = deviations.len() / 2;
        let median = *deviations.select_nth_unstable_by(middle, f64::total_cmp).1;
        found.retain(|refined| refined.sd_px <= MOST_SD_MEDIANS * median);
    }
    found.iter().map(|r| Detection { feature: r.feature, pixel: r.at, sd_px: r.sd_px }).collect()
}

/// Correlation of the image around a feature with the board there; 0 if too little is in the image.
fn correlation(board: &Board, image: &BoardImage, map: &Homography, place: Point, at: Point) -> f64 {
    let expected = map.image(place);
    let [mut n, mut b, mut l, mut bb, mut ll, mut bl] = [0.0; 6];
    for k in 0..POINTS * POINTS {
        let offset = |k: i32| (f64::from(2 * k) / f64::from(POINTS - 1) - 1.0) * EXTENT_CELLS * board.cell_mm();
        let [x, y] = [place[0] + offset(k % POINTS), place[1] + offset(k / POINTS)];
        let [u, v] = map.image([x, y]);
        let Some(level) = image.level([u - expected[0] + at[0], v - expected[1] + at[1]]) else { continue };
        let brightness = board.brightness(x, y);
        n += 1.0;
        b += brightness;
        l += level;
        bb += brightness * brightness;
        ll += level * level;
        bl += brightness * level;
    }
    if n < LEAST_SEEN * f64::from(POINTS * POINTS) {
        return 0.0;
    }
    let (variance_b, variance_l) = (bb / n - (b / n).powi(2), ll / n - (l / n).powi(2));
    (bl / n - b / n * l / n) / (variance_b * variance_l).max(1e-12).sqrt()
}

/// Share of the inner cells of markers that have the colour of the board; `None` without markers.
fn share_of_cells(
    board: &Board,
    image: &BoardImage,
    map: &Homography,
    places: &[Point],
    found: &[Refined],
) -> Option<f64> {
    let (mut agree, mut all) = (0_u32, 0_u32);
    for marker in board.markers() {
        let middle = marker.corner_mm.map(|c| c + marker.side_mm / 2.0);
        let distance = |r: &&Refined| (places[r.feature][0] - middle[0]).hypot(places[r.feature][1] - middle[1]);
        let Some(nearest) = found.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) else { continue };
        if distance(&nearest) > 1.5 * marker.side_mm {
            continue;
        }
        let expected = map.image(places[nearest.feature]);
        let offset = [nearest.at[0] - expected[0], nearest.at[1] - expected[1]];
        let side = (marker.cells.len() as f64).sqrt() as usize;
        let level = |k: usize| {
            let at = |k: usize, corner: f64| corner + (k as f64 + 0.5) / side as f64 * marker.side_mm;
            let [u, v] = map.image([at(k % side, marker.corner_mm[0]), at(k / side, marker.corner_mm[1])]);
            image.level([u + offset[0], v + offset[1]])
        };
        let Some(levels) = (0..side * side).map(level).collect::<Option<Vec<f64>>>() else { continue };
        let (least, most) = levels.iter().fold((f64::MAX, f64::MIN), |(least, most), l| (least.min(*l), most.max(*l)));
        let is_inner = |k: &usize| [k % side, k / side].iter().all(|c| (1..side - 1).contains(c));
        for k in (0..side * side).filter(is_inner) {
            all += 1;
            agree += u32::from((levels[k] < (least + most) / 2.0) == marker.cells[k]);
        }
    }
    (all > 0).then(|| f64::from(agree) / f64::from(all))
}

/// Removes features that deviate from what their neighbours say, the worst first.
fn remove_outstanding(found: &mut Vec<Refined>, places: &[Point], map: &Homography) {
    let most = found.len() / 3;
    for _ in 0..=most {
        let deviations: Vec<f64> = (0..found.len()).map(|k| deviation(found, places, map, k)).collect();
        let mut sorted = deviations.clone();
        let Some(middle) = (!sorted.is_empty()).then_some(sorted.len() / 2) else { return };
        let median = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
        let Some((worst, deviation)) = deviations.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)) else { return };
        if *deviation <= TOLERANCE_PX.max(TOLERANCE_MEDIANS * median) {
            return;
        }
        found.remove(worst);
    }
    // More than a third stands out: then nothing tells which ones are wrong.
    found.clear();
}

/// Distance of a feature from where a linear fit to its neighbours' offsets from the map puts it, pixels.
fn deviation(found: &[Refined], places: &[Point], map: &Homography, of: usize) -> f64 {
    let [x, y] = places[found[of].feature];
    let distance = |k: &usize| (places[found[*k].feature][0] - x).hypot(places[found[*k].feature][1] - y);
    let mut near: Vec<usize> = (0..found.len()).filter(|k| *k != of).collect();
    near.sort_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)));
    near.truncate(NEIGHBOURS);
    let offset = |k: usize| {
        let expected = map.image(places[found[k].feature]);
        [found[k].at[0] - expected[0], found[k].at[1] - expected[1]]
    };
    let scale = near.last().map_or(1.0, |k| distance(k).max(1e-9));
    let (mut matrix, mut sums) = (Matrix3::zeros(), [Vector3::zeros(); 2]);
    for &k in &near {
        let [px, py] = places[found[k].feature];
        let row = Vector3::new(1.0, (px - x) / scale, (py - y) / scale);
        matrix += row * row.transpose();
        let offset = offset(k);
        sums = [0, 1].map(|i| sums[i] + row * offset[i]);
    }
    // Neighbours on one line leave a slope open; a little weight keeps it small.
    matrix += Matrix3::identity() * 1e-3;
    let Some(inverse) = matrix.try_inverse() else { return 0.0 };
    let own = offset(of);
    let apart = [0, 1].map(|i| own[i] - (inverse * sums[i])[0]);
    apart[0].hypot(apart[1])
}
