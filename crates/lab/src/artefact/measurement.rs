//! The figures of an artefact in one cloud.

use nalgebra::Matrix4;

use fringeflow::geometry::Point3;

use super::cells::{CELL_POINTS, Cells};
use super::find_plane::find_plane;
use super::find_spheres::find_spheres;
use super::fit::{Fitted, LeftOut, fit};
use super::plane::Plane;
use super::region::{extent_m, facing, pitch, places_on_ball, places_on_plane, region_of_ball, region_of_plane};
use super::ripple::{Ripple, strongest};
use super::sphere::{Sphere, SphereFit};
use super::statistics::range;
use super::trend::{Bend, Trend};
use super::{Artefact, MeasuredPoints, Views};

/// Smallest share of the points that lie on a plate which fills the view.
const MIN_PLANE_SHARE: f64 = 0.5;
/// Distance from a plate beyond which a point is left out as no part of it, as a share of the extent of the cloud.
const FAR_FROM_PLANE: f64 = 0.008;
/// The same for a ball, as a share of its radius.
const FAR_FROM_BALL: f64 = 0.05;
/// Largest difference between found and certified spacing, as a share, with which balls are the certified ones.
const SPACING_SHARE: f64 = 0.05;
/// Most balls of one diameter that are searched beyond those of the artefact.
const MORE_BALLS: usize = 4;
/// Largest share of the points in the middle of an artefact that are far from its surface.
const MAX_FAR_SHARE: f64 = 0.1;
/// Fewest points with which a surface is measured.
const MIN_POINTS: usize = 500;

/// The measured artefact. Lengths in metres.
#[derive(Clone, Debug)]
pub enum Measurement {
    /// A plate.
    Plane(FlatFigures),
    /// Balls, in the order of the artefact.
    Balls {
        /// Each ball.
        balls: Vec<BallFigures>,
        /// Distances of neighbours.
        spacings: Vec<Spacing>,
    },
}

/// Noise and form of a surface.
#[derive(Clone, Debug)]
pub struct SurfaceFigures {
    /// Points used and left out.
    pub left_out: LeftOut,
    /// Range of the distances of the used points from the fitted surface: PF of a ball, F of a plate.
    pub range_m: f64,
    /// Noise of a point: the median over cells of the scatter about a small plane, and its 90th percentile.
    pub noise_m: [f64; 2],
    /// Form: root mean square of the means of the cells, without their noise.
    pub form_rms_m: f64,
    /// Highest minus lowest mean of a cell. It contains some noise.
    pub form_range_m: f64,
    /// The cells.
    pub cells: Cells,
    /// The strongest ripple with the fringes; `None` if the fringes are unknown.
    pub ripple: Option<Ripple>,
    /// Mean distance from the surface of the points that were left out as far away; 0 without any.
    pub far_offset_m: f64,
}

/// Figures of a plate.
#[derive(Clone, Debug)]
pub struct FlatFigures {
    /// The fitted plane.
    pub plane: Plane,
    /// Noise and form.
    pub surface: SurfaceFigures,
    /// How it is bent; `None` with too few cells.
    pub bend: Option<Bend>,
}

/// Figures of a ball.
#[derive(Clone, Debug)]
pub struct BallFigures {
    /// The fitted ball.
    pub sphere: Sphere,
    /// Fitted minus certified diameter: PS.
    pub size_error_m: f64,
    /// Standard uncertainty of the fitted diameter.
    pub diameter_u_m: f64,
    /// Covariance of centre and radius.
    pub covariance: Matrix4<f64>,
    /// Noise and form.
    pub surface: SurfaceFigures,
}

/// Distance of the centres of two neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spacing {
    /// Certified distance.
    pub certified_m: f64,
    /// Measured minus certified distance: SD.
    pub error_m: f64,
    /// Standard uncertainty of the measured distance.
    pub u_m: f64,
}

/// Why an artefact was not measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NotFound {
    /// The cloud is too small.
    #[error("the cloud has {points} points, too few to measure; use at least {MIN_POINTS}")]
    FewPoints {
        /// Its points.
        points: usize,
    },
    /// No plane holds most of the points.
    #[error(
        "no plane is there: the largest holds {percent:.0} % of the points; let the plate fill the view, so that it \
         holds {least:.0} % or more", least = MIN_PLANE_SHARE * 100.0
    )]
    NoPlane {
        /// Share of the points on the largest plane, percent.
        percent: f64,
    },
    /// Fewer balls were found than the artefact has.
    #[error(
        "{found} of {wanted} balls of {diameter_mm:.3} mm are there; check the diameter, and that the middle of each \
         ball is seen whole"
    )]
    NoBall {
        /// Certified diameter, millimetres.
        diameter_mm: f64,
        /// Balls found.
        found: usize,
        /// Balls of this diameter that the artefact has.
        wanted: usize,
    },
    /// The balls found are not where those of the artefact are.
    #[error(
        "no balls stand {certified_mm:.3} mm apart; the nearest distance is {nearest_mm:.3} mm; check the certified \
         spacing"
    )]
    NoSpacing {
        /// Certified distance, millimetres.
        certified_mm: f64,
        /// The distance nearest to it, millimetres.
        nearest_mm: f64,
    },
    /// Something else is where the artefact should be.
    #[error(
        "{percent:.0} % of the points in the middle of the artefact do not lie on it; take away what stands before it, or \
         name another artefact"
    )]
    Covered {
        /// Their share, percent.
        percent: f64,
    },
    /// A surface was found, but it has too few points to fit.
    #[error("the artefact has {points} points in its middle, too few to measure; move closer or use larger images")]
    FewOnSurface {
        /// Its points.
        points: usize,
    },
}

/// Finds and measures an artefact.
///
/// # Errors
/// [`NotFound`]: it is not there. No figure is made up then.
pub fn measure(points: &MeasuredPoints<'_>, artefact: &Artefact) -> Result<Measurement, NotFound> {
    let count = points.points_m.len();
    if count < MIN_POINTS {
        return Err(NotFound::FewPoints { points: count });
    }
    match artefact {
        Artefact::Plane => measure_plane(points).map(Measurement::Plane),
        Artefact::Balls { diameters_m, spacings_m } => {
            let spheres = chosen_balls(points.points_m, diameters_m, spacings_m)?;
            let balls =
                spheres.iter().zip(diameters_m).map(|(sphere, diameter)| measure_ball(points, *sphere, *diameter));
            let balls: Vec<BallFigures> = balls.collect::<Result<_, _>>()?;
            let pairs = balls.iter().zip(balls.iter().skip(1)).zip(spacings_m);
            let spacings = pairs.map(|((a, b), certified)| spacing(a, b, *certified)).collect();
            Ok(Measurement::Balls { balls, spacings })
        }
    }
}

fn measure_plane(points: &MeasuredPoints<'_>) -> Result<FlatFigures, NotFound> {
    let all = points.points_m;
    let (start, share, band_m) = find_plane(all).ok_or(NotFound::NoPlane { percent: 0.0 })?;
    if share < MIN_PLANE_SHARE {
        return Err(NotFound::NoPlane { percent: share * 100.0 });
    }
    let region = region_of_plane(&start, band_m, all, points.views);
    let region_points: Vec<Point3> = region.iter().map(|&i| all[i]).collect();
    let few = NotFound::FewOnSurface { points: region.len() };
    if region.len() < MIN_POINTS {
        return Err(few);
    }
    let far_m = FAR_FROM_PLANE * extent_m(all);
    let fitted = fit(&region_points, start, far_m, |points, _| Plane::fit(points), Plane::distance_m).ok_or(few)?;
    check_cover(&fitted.left_out)?;
    let places = places_on_plane(&fitted.surface, &region_points, points.views);
    let (surface, trend) = figures(points, &region, &region_points, &places, &fitted, Plane::distance_m);
    let bend = trend.map(|trend| trend.bend(&surface.cells));
    Ok(FlatFigures { plane: fitted.surface, surface, bend })
}

fn measure_ball(points: &MeasuredPoints<'_>, start: Sphere, diameter_m: f64) -> Result<BallFigures, NotFound> {
    let all = points.points_m;
    let region = region_of_ball(&start, all, points.views);
    let region_points: Vec<Point3> = region.iter().map(|&i| all[i]).collect();
    let few = NotFound::FewOnSurface { points: region.len() };
    if region.len() < MIN_POINTS {
        return Err(few);
    }
    let refit = |points: &[Point3], sphere: &Sphere| SphereFit::new(points, *sphere).map(|fit| fit.sphere);
    let fitted = fit(&region_points, start, FAR_FROM_BALL * start.radius_m, refit, Sphere::distance_m);
    let fitted = fitted.ok_or_else(|| few.clone())?;
    check_cover(&fitted.left_out)?;
    let sphere = fitted.surface;
    let axis = facing(&sphere, &region_points, points.views);
    let places = places_on_ball(&sphere, &axis, &region_points);
    let (surface, _) = figures(points, &region, &region_points, &places, &fitted, Sphere::distance_m);
    let covariance = covariance(&region_points, &fitted, &surface.cells).ok_or(few)?;
    Ok(BallFigures {
        sphere,
        size_error_m: 2.0 * sphere.radius_m - diameter_m,
        diameter_u_m: 2.0 * covariance[(3, 3)].sqrt(),
        covariance,
        surface,
    })
}

fn check_cover(left_out: &LeftOut) -> Result<(), NotFound> {
    let share = left_out.far as f64 / left_out.points.max(1) as f64;
    if share > MAX_FAR_SHARE { Err(NotFound::Covered { percent: share * 100.0 }) } else { Ok(()) }
}

/// Covariance of centre and radius. Neighbouring points share their errors, so each cell counts as one observation, with
/// the scatter that the means of the cells have.
fn covariance(region: &[Point3], fitted: &Fitted<Sphere>, cells: &Cells) -> Option<Matrix4<f64>> {
    let used: Vec<Point3> = fitted.used.iter().map(|&i| region[i]).collect();
    let count = cells.cells.len();
    let squares: f64 = cells.cells.iter().map(|cell| cell.mean_m * cell.mean_m).sum();
    let points_per_cell = used.len() as f64 / count as f64;
    let variance = squares / count.checked_sub(4).filter(|&left| left > 0)? as f64;
    Some(SphereFit::new(&used, fitted.surface)?.cofactors * (points_per_cell * variance))
}

/// Noise, form and ripple of the used points of a region, and its smooth bend.
fn figures<S>(
    points: &MeasuredPoints<'_>,
    region: &[usize],
    region_points: &[Point3],
    places: &[[f64; 2]],
    fitted: &Fitted<S>,
    distance_m: impl Fn(&S, &Point3) -> f64,
) -> (SurfaceFigures, Option<Trend>) {
    let residual = |i: usize| distance_m(&fitted.surface, &region_points[i]);
    let used_places: Vec<[f64; 2]> = fitted.used.iter().map(|&i| places[i]).collect();
    let residuals_m: Vec<f64> = fitted.used.iter().map(|&i| residual(i)).collect();
    let cells = match points.views {
        // The same cells in every window, so that their pictures can be put together.
        Views::Cam1 => Cells::of_width(steady_width(&used_places), &used_places, &residuals_m),
        Views::Several => Cells::new(&used_places, &residuals_m),
    };
    let trend = Trend::new(&cells);
    let ripple = points.fringes.and_then(|(phases_rad, steps)| {
        let phases: Vec<f64> = fitted.used.iter().map(|&i| phases_rad[region[i]]).collect();
        let bend = |place: &[f64; 2]| trend.as_ref().map_or(0.0, |trend| trend.at(place));
        let smooth: Vec<f64> =
            residuals_m.iter().zip(&used_places).map(|(residual, place)| residual - bend(place)).collect();
        strongest(&phases, &smooth, steps)
    });
    let far: Vec<f64> = far_residuals(fitted, region_points.len(), residual);
    let surface = SurfaceFigures {
        left_out: fitted.left_out,
        range_m: fitted.range_m,
        noise_m: [cells.noise_m(0.5), cells.noise_m(0.9)],
        form_rms_m: cells.form_rms_m(),
        form_range_m: range(cells.cells.iter().map(|cell| cell.mean_m)),
        cells,
        ripple,
        far_offset_m: far.iter().sum::<f64>() / far.len().max(1) as f64,
    };
    (surface, trend)
}

/// Residuals of the points that were left out as far away: the outermost ones.
fn far_residuals<S>(fitted: &Fitted<S>, count: usize, residual: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut is_used = vec![false; count];
    fitted.used.iter().for_each(|&i| is_used[i] = true);
    let mut out: Vec<f64> = (0..count).filter(|&i| !is_used[i]).map(residual).collect();
    out.sort_unstable_by(|a, b| b.abs().total_cmp(&a.abs()));
    out.truncate(fitted.left_out.far);
    out
}

/// A width that stays where the density of the points changes a little: a power of the square root of two.
fn steady_width(places: &[[f64; 2]]) -> f64 {
    let width = pitch(places.iter().copied(), CELL_POINTS);
    ((2.0 * width.log2()).round() / 2.0).exp2()
}

/// The balls of the artefact among those found: of each diameter, with the distances nearest to the certified ones.
fn chosen_balls(points: &[Point3], diameters_m: &[f64], spacings_m: &[f64]) -> Result<Vec<Sphere>, NotFound> {
    let mut found: Vec<(f64, Vec<Sphere>)> = Vec::new();
    for &diameter_m in diameters_m {
        if found.iter().any(|(known, _)| *known == diameter_m) {
            continue;
        }
        let wanted = diameters_m.iter().filter(|other| **other == diameter_m).count();
        let most = if diameters_m.len() > 1 { wanted + MORE_BALLS } else { 1 };
        let balls = find_spheres(points, diameter_m / 2.0, most);
        if balls.len() < wanted {
            return Err(NotFound::NoBall { diameter_mm: diameter_m * 1e3, found: balls.len(), wanted });
        }
        found.push((diameter_m, balls));
    }
    let choices: Vec<&[Sphere]> = diameters_m
        .iter()
        .filter_map(|diameter| found.iter().find(|(known, _)| known == diameter).map(|(_, balls)| balls.as_slice()))
        .collect();
    let mut best = (SPACING_SHARE, Vec::new());
    choose(&choices, spacings_m, &mut Vec::new(), 0.0, &mut best);
    let (_, chosen) = best;
    if chosen.is_empty() { Err(no_spacing(&choices, spacings_m)) } else { Ok(chosen) }
}

/// Tries all rows of balls, and keeps the one whose worst spacing is nearest to the certified one, as a share.
fn choose(choices: &[&[Sphere]], spacings_m: &[f64], row: &mut Vec<Sphere>, worst: f64, best: &mut (f64, Vec<Sphere>)) {
    let Some(candidates) = choices.get(row.len()) else {
        *best = (worst, row.clone());
        return;
    };
    for ball in *candidates {
        let certified = row.len().checked_sub(1).and_then(|before| spacings_m.get(before));
        let misfit = row
            .last()
            .zip(certified)
            .map_or(0.0, |(before, certified)| ((ball.centre - before.centre).norm() / certified - 1.0).abs());
        let worst = worst.max(misfit);
        if worst < best.0 && !row.iter().any(|other| other.centre == ball.centre) {
            row.push(*ball);
            choose(choices, spacings_m, row, worst, best);
            row.pop();
        }
    }
}

fn no_spacing(choices: &[&[Sphere]], spacings_m: &[f64]) -> NotFound {
    let certified_m = spacings_m.first().copied().unwrap_or_default();
    let balls = || choices.iter().flat_map(|balls| balls.iter());
    let distances =
        balls().flat_map(|a| balls().map(|b| (a.centre - b.centre).norm())).filter(|distance| *distance > 0.0);
    let nearest_m = distances.min_by(|a, b| (a - certified_m).abs().total_cmp(&(b - certified_m).abs()));
    NotFound::NoSpacing { certified_mm: certified_m * 1e3, nearest_mm: nearest_m.unwrap_or_default() * 1e3 }
}

fn spacing(a: &BallFigures, b: &BallFigures, certified_m: f64) -> Spacing {
    let between = b.sphere.centre - a.sphere.centre;
    let along = between.normalize();
    let variance = |ball: &BallFigures| (along.transpose() * ball.covariance.fixed_view::<3, 3>(0, 0) * along)[0];
    Spacing { certified_m, error_m: between.norm() - certified_m, u_m: (variance(a) + variance(b)).max(0.0).sqrt() }
}
