//! Which points belong to an artefact: those that C1 sees in its middle, whatever they measure.

use std::collections::{HashMap, HashSet, VecDeque};

use fringeflow::geometry::{Point3, Vector3};

use super::Views;
use super::plane::{Plane, axes_across};
use super::sphere::Sphere;

/// Share of the radius of a ball within which its points are used: there the surface is inclined by up to 58°. Nearer to
/// the border, a cloud has holes, and a bar or a stand begins.
pub(super) const USED_RADIUS: f64 = 0.85;
/// Distance from a ball at which the points of a model may belong to it, as a share of the radius.
const SHELL_SHARE: f64 = 0.15;
/// Distance within which such a point lies on it, as a share of the radius.
const SURFACE_SHARE: f64 = 0.02;
/// Mean number of points of a cell that tells where a surface is.
const CELL_POINTS: f64 = 25.0;
/// Smallest share of the points of such a cell that lie on the surface.
const ON_SURFACE_SHARE: f64 = 0.8;

/// At most `count` of the points, evenly spaced.
pub(super) fn thinned(points: &[Point3], count: usize) -> Vec<Point3> {
    points.iter().step_by(points.len().div_ceil(count).max(1)).copied().collect()
}

/// Diagonal of the box of the points, without the outermost hundredth on each side, metres.
pub(super) fn extent_m(points: &[Point3]) -> f64 {
    let side = |axis: usize| {
        let mut values: Vec<f64> = points.iter().map(|point| point[axis]).collect();
        values.sort_unstable_by(f64::total_cmp);
        let cut = values.len() / 100;
        values.get(values.len().saturating_sub(cut + 1)).zip(values.get(cut)).map_or(0.0, |(high, low)| high - low)
    };
    (0..3).map(|axis| side(axis).powi(2)).sum::<f64>().sqrt()
}

/// Places of points in the picture of a plate: directions from C1 (x/z, y/z), or metres along the plane.
pub(super) fn places_on_plane(plane: &Plane, points: &[Point3], views: Views) -> Vec<[f64; 2]> {
    let [along, across] = plane.axes();
    let place = |point: &Point3| match views {
        Views::Cam1 => [point.x / point.z, point.y / point.z],
        Views::Several => [along, across].map(|axis| (point - plane.point).dot(&axis)),
    };
    points.iter().map(place).collect()
}

/// Indices of the points in the middle of a plate.
pub(super) fn region_of_plane(plane: &Plane, band_m: f64, points: &[Point3], views: Views) -> Vec<usize> {
    let places = places_on_plane(plane, points, views);
    let on_plane: Vec<bool> = points.iter().map(|point| plane.distance_m(point).abs() <= 2.0 * band_m).collect();
    inside_outline(&places, &on_plane)
}

/// Indices of the points inside the outline of a surface: the largest connected part of the picture in which points lie
/// on it, with the holes in it and without its border.
fn inside_outline(places: &[[f64; 2]], on_surface: &[bool]) -> Vec<usize> {
    let width = pitch(places.iter().zip(on_surface).filter(|(_, on)| **on).map(|(place, _)| *place), CELL_POINTS);
    let key = |place: &[f64; 2]| place.map(|value| (value / width).floor() as i64);
    let mut counts: HashMap<[i64; 2], [usize; 2]> = HashMap::new();
    for (place, on) in places.iter().zip(on_surface) {
        let count = counts.entry(key(place)).or_default();
        count[0] += 1;
        count[1] += usize::from(*on);
    }
    let is_surface = |cell: &[i64; 2]| {
        let [all, on] = counts.get(cell).map_or([0.0; 2], |count| count.map(|points| points as f64));
        on >= ON_SURFACE_SHARE * all && on >= CELL_POINTS / 4.0
    };
    let mut cells: Vec<[i64; 2]> = counts.keys().copied().filter(is_surface).collect();
    cells.sort_unstable();
    let part = with_holes_filled(&largest_part(&cells));
    let inside = |[x, y]: [i64; 2]| {
        let mut around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| [x.saturating_add(dx), y.saturating_add(dy)]));
        around.all(|cell| part.contains(&cell))
    };
    (0..places.len()).filter(|&i| inside(key(&places[i]))).collect()
}

/// The largest set of cells that are neighbours by a side; of several the first.
fn largest_part(cells: &[[i64; 2]]) -> Vec<[i64; 2]> {
    let mut open: HashMap<[i64; 2], bool> = cells.iter().map(|&cell| (cell, true)).collect();
    let mut largest = Vec::new();
    for &start in cells {
        if open.insert(start, false) != Some(true) {
            continue;
        }
        let (mut part, mut next) = (vec![start], VecDeque::from([start]));
        while let Some(cell) = next.pop_front() {
            for neighbour in neighbours(cell) {
                if let Some(is_open) = open.get_mut(&neighbour).filter(|is_open| **is_open) {
                    *is_open = false;
                    part.push(neighbour);
                    next.push_back(neighbour);
                }
            }
        }
        if part.len() > largest.len() {
            largest = part;
        }
    }
    largest
}

fn neighbours([x, y]: [i64; 2]) -> [[i64; 2]; 4] {
    [[x.saturating_sub(1), y], [x.saturating_add(1), y], [x, y.saturating_sub(1)], [x, y.saturating_add(1)]]
}

/// The cells, and those that they enclose: all of their box that the outside does not reach.
fn with_holes_filled(part: &[[i64; 2]]) -> HashSet<[i64; 2]> {
    let bounds = |axis: usize| {
        let (low, high) = part.iter().fold((i64::MAX, i64::MIN), |(l, h), cell| (l.min(cell[axis]), h.max(cell[axis])));
        (low.saturating_sub(1), high.saturating_add(1))
    };
    let [(left, right), (top, bottom)] = [bounds(0), bounds(1)];
    let mut filled: HashSet<[i64; 2]> = part.iter().copied().collect();
    if part.is_empty() {
        return filled;
    }
    let (mut outside, mut next) = (HashSet::from([[left, top]]), VecDeque::from([[left, top]]));
    while let Some(cell) = next.pop_front() {
        for neighbour in neighbours(cell) {
            let is_in_box = (left..=right).contains(&neighbour[0]) && (top..=bottom).contains(&neighbour[1]);
            if is_in_box && !filled.contains(&neighbour) && outside.insert(neighbour) {
                next.push_back(neighbour);
            }
        }
    }
    for x in left..=right {
        filled.extend((top..=bottom).map(|y| [x, y]).filter(|cell| !outside.contains(cell)));
    }
    filled
}

/// Width of square cells with about `count` points each.
pub(super) fn pitch(places: impl Iterator<Item = [f64; 2]>, count: f64) -> f64 {
    let start = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], 0_usize);
    let (low, high, all) = places.fold(start, |(low, high, all), place| {
        ([0, 1].map(|i| low[i].min(place[i])), [0, 1].map(|i| high[i].max(place[i])), all + 1)
    });
    let area = [0, 1].map(|i| (high[i] - low[i]).max(f64::MIN_POSITIVE));
    (area[0] * area[1] * count / all.max(1) as f64).sqrt().max(f64::MIN_POSITIVE)
}

/// Indices of the points in the middle of a ball: by the rays of C1, or in a model inside the outline of what is there of
/// it, so that no stand or bar takes part.
pub(super) fn region_of_ball(ball: &Sphere, points: &[Point3], views: Views) -> Vec<usize> {
    match views {
        Views::Cam1 => (0..points.len()).filter(|&i| is_in_middle(ball, &points[i])).collect(),
        Views::Several => {
            let is_near = |point: &Point3| ball.distance_m(point).abs() <= SHELL_SHARE * ball.radius_m;
            let near: Vec<usize> = (0..points.len()).filter(|&i| is_near(&points[i])).collect();
            let near_points: Vec<Point3> = near.iter().map(|&i| points[i]).collect();
            let places = places_on_ball(ball, &facing(ball, &near_points, views), &near_points);
            let is_on = |point: &Point3| ball.distance_m(point).abs() <= SURFACE_SHARE * ball.radius_m;
            let on_ball: Vec<bool> = near_points.iter().map(is_on).collect();
            inside_outline(&places, &on_ball).into_iter().map(|i| near[i]).collect()
        }
    }
}

/// Whether the ray from C1 through the point passes the centre near enough.
fn is_in_middle(ball: &Sphere, point: &Point3) -> bool {
    let direction = point.coords.normalize();
    let centre = &ball.centre.coords;
    direction.dot(centre) > 0.0 && direction.cross(centre).norm() <= USED_RADIUS * ball.radius_m
}

/// The direction in which a ball is seen from: towards C1, or in the mean towards its points.
pub(super) fn facing(ball: &Sphere, points: &[Point3], views: Views) -> Vector3 {
    let outward: Vector3 = match views {
        Views::Cam1 => -ball.centre.coords,
        Views::Several => points.iter().filter_map(|point| (point - ball.centre).try_normalize(0.0)).sum(),
    };
    outward.try_normalize(0.0).unwrap_or_else(Vector3::z)
}

/// Places of points on a ball: the equal-area map about `axis`, metres.
pub(super) fn places_on_ball(ball: &Sphere, axis: &Vector3, points: &[Point3]) -> Vec<[f64; 2]> {
    let across = axes_across(axis);
    let place = |point: &Point3| {
        let direction = (point - ball.centre).try_normalize(0.0).unwrap_or(*axis);
        let stretch = ball.radius_m * (2.0 / (1.0 + direction.dot(axis)).max(1e-9)).sqrt();
        across.map(|side| stretch * direction.dot(&side))
    };
    points.iter().map(place).collect()
}
