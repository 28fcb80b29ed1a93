//! Which points belong to an artefact: those that C1 sees in its middle, whatever they measure.

use std::collections::{HashMap, VecDeque};

use fringeflow::geometry::{Point3, Vector3};

use super::Views;
use super::plane::Plane;
use super::sphere::Sphere;

/// Share of the radius of a ball within which its points are used: there the surface is inclined by up to 58°. Nearer to
/// the border, a cloud has holes, and a bar or a stand begins.
pub(super) const USED_RADIUS: f64 = 0.85;
/// Distance from a ball at which the points of a model may belong to it, as a share of the radius.
const SHELL_SHARE: f64 = 0.15;
/// Mean number of points of a cell that tells where a plate is.
const CELL_POINTS: f64 = 25.0;
/// Smallest share of the points of such a cell that lie on the plane.
const ON_PLANE_SHARE: f64 = 0.8;

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

/// Indices of the points in the middle of a plate: the largest connected part of the picture in which points lie on the
/// plane, with the holes in it and without its border.
pub(super) fn region_of_plane(plane: &Plane, band_m: f64, points: &[Point3], views: Views) -> Vec<usize> {
    let places = places_on_plane(plane, points, views);
    let on_plane: Vec<bool> = points.iter().map(|point| plane.distance_m(point).abs() <= 2.0 * band_m).collect();
    let width = pitch(places.iter().zip(&on_plane).filter(|(_, on)| **on).map(|(place, _)| *place), CELL_POINTS);
    let key = |place: &[f64; 2]| place.map(|value| (value / width).floor() as i64);
    let mut counts: HashMap<[i64; 2], [usize; 2]> = HashMap::new();
    for (place, on) in places.iter().zip(&on_plane) {
        let count = counts.entry(key(place)).or_default();
        count[0] += 1;
        count[1] += usize::from(*on);
    }
    let is_plane = |cell: &[i64; 2]| {
        counts.get(cell).is_some_and(|[all, on]| *on as f64 >= ON_PLANE_SHARE * *all as f64 && *on as f64 >= CELL_POINTS / 4.0)
    };
    let mut cells: Vec<[i64; 2]> = counts.keys().copied().filter(is_plane).collect();
    cells.sort_unstable();
    let part = with_holes_filled(&largest_part(&cells));
    let inside = |cell: [i64; 2]| (-1..=1).all(|dx| (-1..=1).all(|dy| part.contains_key(&[cell[0].saturating_add(dx), cell[1].saturating_add(dy)])));
    (0..points.len()).filter(|&i| inside(key(&places[i]))).collect()
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
    [
        [x.saturating_sub(1), y],
        [x.saturating_add(1), y],
        [x, y.saturating_sub(1)],
        [x, y.saturating_add(1)],
    ]
}

/// The cells, and those that they enclose: all of their box that the outside does not reach.
fn with_holes_filled(part: &[[i64; 2]]) -> HashMap<[i64; 2], ()> {
    let bounds = |axis: usize| {
        let (low, high) = part.iter().fold((i64::MAX, i64::MIN), |(l, h), cell| (l.min(cell[axis]), h.max(cell[axis])));
        (low.saturating_sub(1), high.saturating_add(1))
    };
    let [(left, right), (top, bottom)] = [bounds(0), bounds(1)];
    let mut filled: HashMap<[i64; 2], ()> = part.iter().map(|&cell| (cell, ())).collect();
    if part.is_empty() {
        return filled;
    }
    let (mut outside, mut next) = (HashMap::from([([left, top], ())]), VecDeque::from([[left, top]]));
    while let Some(cell) = next.pop_front() {
        for neighbour in neighbours(cell) {
            let is_in_box = (left..=right).contains(&neighbour[0]) && (top..=bottom).contains(&neighbour[1]);
            if is_in_box && !filled.contains_key(&neighbour) && outside.insert(neighbour, ()).is_none() {
                next.push_back(neighbour);
            }
        }
    }
    for x in left..=right {
        filled.extend((top..=bottom).map(|y| [x, y]).filter(|cell| !outside.contains_key(cell)).map(|cell| (cell, ())));
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

/// Indices of the points in the middle of a ball.
pub(super) fn region_of_ball(ball: &Sphere, points: &[Point3], views: Views) -> Vec<usize> {
    let towards = ball.centre.coords.normalize();
    let is_inside = |point: &Point3| match views {
        // The ray from C1 through the point passes the centre nearer than this.
        Views::Cam1 => {
            let direction = point.coords.normalize();
            direction.dot(&towards) > 0.0 && direction.cross(&ball.centre.coords).norm() <= USED_RADIUS * ball.radius_m
        }
        Views::Several => ball.distance_m(point).abs() <= SHELL_SHARE * ball.radius_m,
    };
    (0..points.len()).filter(|&i| is_inside(&points[i])).collect()
}

/// Places of points on a ball: the equal-area map about `axis`, metres.
pub(super) fn places_on_ball(ball: &Sphere, axis: &Vector3, points: &[Point3]) -> Vec<[f64; 2]> {
    let across = super::plane::axes_across(axis);
    let place = |point: &Point3| {
        let direction = (point - ball.centre).try_normalize(0.0).unwrap_or(*axis);
        let stretch = ball.radius_m * (2.0 / (1.0 + direction.dot(axis)).max(1e-9)).sqrt();
        across.map(|side| stretch * direction.dot(&side))
    };
    points.iter().map(place).collect()
}
