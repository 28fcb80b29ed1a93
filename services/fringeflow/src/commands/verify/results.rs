//! The figures of all windows, judged by the limits of the artefact. Lengths in millimetres.

use std::path::Path;

use serde::Serialize;

use fringeflow_lab::artefact::{
    ALLOWED_SHARE, Cell, Measurement, Spread, SurfaceFigures, causes, cell_repeatability_m,
};

use crate::failure::Failure;

use super::certificate::Certificate;
use super::clouds::Origin;
use super::explanation::{Explanation, explain};

/// A measured window.
pub(super) struct Window {
    pub(super) number: usize,
    pub(super) time_s: Option<f64>,
    pub(super) measurement: Measurement,
}

/// A window in which the artefact was not measured.
#[derive(Serialize)]
pub(super) struct Lost {
    pub(super) number: usize,
    pub(super) time_s: Option<f64>,
    pub(super) why: String,
}

/// All results.
#[derive(Serialize)]
pub(super) struct Results<'a> {
    pub(super) input: &'a Path,
    pub(super) clouds_are: Origin,
    pub(super) artefact: String,
    pub(super) clouds: usize,
    pub(super) measured: usize,
    pub(super) lost: Vec<Lost>,
    pub(super) points: PointUse,
    pub(super) figures: Vec<Figure>,
    /// How well the form of a plate repeats from cloud to cloud; `None` for balls and few windows.
    pub(super) form_repeats_mm: Option<f64>,
    pub(super) causes: Vec<Explanation>,
    pub(super) windows: Vec<WindowLine>,
    /// Whether all figures are within their limits; `None` without limits.
    pub(super) within_limits: Option<bool>,
}

/// Points of all windows in the middle of the artefact, and those left out.
#[derive(Serialize)]
pub(super) struct PointUse {
    pub(super) points: usize,
    pub(super) used: usize,
    /// Left out because they are far from the surface.
    pub(super) far: usize,
    pub(super) left_out_percent: f64,
    pub(super) allowed_percent: f64,
    /// Windows in which more is far away than the standard lets be left out.
    pub(super) windows_beyond: usize,
    /// Points of a cloud file without coordinates.
    pub(super) without_coordinates: usize,
}

/// A figure over all windows.
#[derive(Serialize)]
pub(super) struct Figure {
    pub(super) symbol: &'static str,
    pub(super) meaning: &'static str,
    pub(super) median_mm: f64,
    pub(super) worst_mm: f64,
    /// Standard deviation from window to window.
    pub(super) repeats_mm: Option<f64>,
    /// Expanded uncertainty (k = 2) of a window's value, with that of the certificate.
    pub(super) uncertainty_mm: Option<f64>,
    pub(super) limit_mm: Option<f64>,
    pub(super) within: Option<bool>,
}

/// A window in the table.
#[derive(Serialize)]
pub(super) struct WindowLine {
    pub(super) number: usize,
    pub(super) time_s: Option<f64>,
    /// Middle of the artefact in the frame of C1.
    pub(super) middle_mm: [f64; 3],
    /// Worst value of each figure, in their order.
    pub(super) worst_mm: Vec<f64>,
    pub(super) points: usize,
    pub(super) left_out_percent: f64,
}

/// The values of a figure: for each ball, spacing or plate, those of all windows.
struct Series {
    symbol: &'static str,
    meaning: &'static str,
    values_m: Vec<Vec<f64>>,
    uncertainty_m: Option<f64>,
    limit_mm: Option<f64>,
    /// Whether leaving out too many points spoils it.
    is_range: bool,
}

impl<'a> Results<'a> {
    pub(super) fn new(
        input: &'a Path,
        clouds_are: Origin,
        certificate: &Certificate,
        windows: &[Window],
        lost: Vec<Lost>,
        without_coordinates: usize,
    ) -> Self {
        let points = PointUse::new(windows, without_coordinates);
        let all = series(certificate, windows);
        let figures: Vec<Figure> = all.iter().filter_map(|series| series.figure(points.windows_beyond > 0)).collect();
        let judged: Vec<bool> = figures.iter().filter_map(|figure| figure.within).collect();
        let measurements: Vec<&Measurement> = windows.iter().map(|window| &window.measurement).collect();
        let is_plane = matches!(certificate.artefact, fringeflow_lab::artefact::Artefact::Plane);
        let named = causes(&measurements, certificate.spacing_u2_m / 2.0, certificate.diameter_u2_m / 2.0);
        Self {
            input,
            clouds_are,
            artefact: certificate.describe(),
            clouds: windows.len() + lost.len(),
            measured: windows.len(),
            lost,
            points,
            form_repeats_mm: if is_plane { cell_repeatability_m(all_cells(windows)).map(|m| m * 1e3) } else { None },
            causes: named.iter().map(explain).collect(),
            windows: windows.iter().enumerate().map(|(i, window)| line(window, i, &all)).collect(),
            within_limits: (!judged.is_empty()).then(|| !judged.contains(&false)),
            figures,
        }
    }

    /// Fails if a figure is outside its limit, or if windows were lost.
    pub(super) fn check(&self) -> Result<(), Failure> {
        let outside: Vec<&str> = self.figures.iter().filter(|f| f.within == Some(false)).map(|f| f.symbol).collect();
        if !outside.is_empty() {
            return Err(Failure::OutsideLimits(format!(
                "{}: outside the limits of the artefact: {}",
                self.input.display(),
                outside.join(", ")
            )));
        }
        let Some(Lost { number, why, .. }) = self.lost.first() else { return Ok(()) };
        let (lost, clouds) = (self.lost.len(), self.clouds);
        Err(Failure::Losses(format!(
            "the artefact was not measured in {lost} of {clouds} clouds, first in {number}: {why}"
        )))
    }
}

/// The cells of all windows of a plate.
pub(super) fn all_cells(windows: &[Window]) -> impl Iterator<Item = &[Cell]> {
    windows.iter().flat_map(|window| window.measurement.surfaces()).map(|surface| surface.cells.cells.as_slice())
}

impl PointUse {
    fn new(windows: &[Window], without_coordinates: usize) -> Self {
        let surfaces = || windows.iter().flat_map(|window| window.measurement.surfaces());
        let sum = |of: fn(&SurfaceFigures) -> usize| surfaces().map(of).sum::<usize>();
        let (points, used) = (sum(|s| s.left_out.points), sum(|s| s.left_out.used));
        let is_beyond = |window: &&Window| window.measurement.surfaces().iter().any(|s| s.left_out.exceeds());
        Self {
            points,
            used,
            far: sum(|s| s.left_out.far),
            left_out_percent: 100.0 * (points - used) as f64 / points.max(1) as f64,
            allowed_percent: 100.0 * ALLOWED_SHARE,
            windows_beyond: windows.iter().filter(is_beyond).count(),
            without_coordinates,
        }
    }
}

impl Series {
    fn figure(&self, is_beyond: bool) -> Option<Figure> {
        let all: Vec<f64> = self.values_m.iter().flatten().copied().collect();
        let spread = Spread::new(&all)?;
        let squares: Vec<f64> =
            self.values_m.iter().filter_map(|values| Spread::new(values)?.sd).map(|sd| sd * sd).collect();
        let repeats = (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt() * 1e3);
        let worst_mm = spread.worst * 1e3;
        Some(Figure {
            symbol: self.symbol,
            meaning: self.meaning,
            median_mm: spread.median * 1e3,
            worst_mm,
            repeats_mm: repeats,
            uncertainty_mm: self.uncertainty_m.map(|m| m * 1e3),
            limit_mm: self.limit_mm,
            within: self.limit_mm.map(|limit| worst_mm.abs() <= limit && !(self.is_range && is_beyond)),
        })
    }
}

/// All figures of an artefact.
fn series(certificate: &Certificate, windows: &[Window]) -> Vec<Series> {
    let limits = &certificate.limits;
    let surface = |symbol, meaning, of: &dyn Fn(&SurfaceFigures) -> f64, limit_mm, is_range| Series {
        symbol,
        meaning,
        values_m: columns(windows, |m| m.surfaces().into_iter().map(of).collect()),
        uncertainty_m: None,
        limit_mm,
        is_range,
    };
    let range = |s: &SurfaceFigures| s.range_m;
    let noise = surface("noise", "scatter of a point about smooth patches", &|s| s.noise_m[0], limits.noise_mm, false);
    let form = surface("form", "rms of the deviation of low frequency", &|s| s.form_rms_m, None, false);
    match &windows.first().map(|window| &window.measurement) {
        Some(Measurement::Balls { spacings, .. }) => {
            let mut all = vec![
                surface("PF", "probing error of form: range about the ball", &range, limits.pf_mm, true),
                size_error(certificate, windows),
            ];
            if !spacings.is_empty() {
                all.push(spacing_error(certificate, windows));
            }
            all.extend([noise, form]);
            all
        }
        _ => vec![surface("F", "flatness: range about the plane", &range, limits.f_mm, true), noise, form],
    }
}

fn size_error(certificate: &Certificate, windows: &[Window]) -> Series {
    let of = |value: fn(&fringeflow_lab::artefact::BallFigures) -> f64| {
        columns(windows, move |m| match m {
            Measurement::Balls { balls, .. } => balls.iter().map(value).collect(),
            Measurement::Plane(_) => Vec::new(),
        })
    };
    Series {
        symbol: "PS",
        meaning: "probing error of size: diameter",
        uncertainty_m: Some(expanded(&of(|ball| ball.diameter_u_m), certificate.diameter_u2_m)),
        values_m: of(|ball| ball.size_error_m),
        limit_mm: certificate.limits.ps_mm,
        is_range: false,
    }
}

fn spacing_error(certificate: &Certificate, windows: &[Window]) -> Series {
    let of = |value: fn(&fringeflow_lab::artefact::Spacing) -> f64| {
        columns(windows, move |m| match m {
            Measurement::Balls { spacings, .. } => spacings.iter().map(value).collect(),
            Measurement::Plane(_) => Vec::new(),
        })
    };
    Series {
        symbol: "SD",
        meaning: "error of the spacing of the balls",
        uncertainty_m: Some(expanded(&of(|spacing| spacing.u_m), certificate.spacing_u2_m)),
        values_m: of(|spacing| spacing.error_m),
        limit_mm: certificate.limits.sd_mm,
        is_range: false,
    }
}

/// Expanded uncertainty of the median window, with the expanded one of the certificate.
fn expanded(standard_m: &[Vec<f64>], certificate_u2_m: f64) -> f64 {
    let all: Vec<f64> = standard_m.iter().flatten().copied().collect();
    let median = Spread::new(&all).map_or(0.0, |spread| spread.median);
    (2.0 * median).hypot(certificate_u2_m)
}

/// Turns the values of each window into those of each ball, spacing or plate.
fn columns(windows: &[Window], values: impl Fn(&Measurement) -> Vec<f64>) -> Vec<Vec<f64>> {
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for values in windows.iter().map(|window| values(&window.measurement)) {
        columns.resize_with(columns.len().max(values.len()), Vec::new);
        columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
    }
    columns
}

fn line(window: &Window, index: usize, all: &[Series]) -> WindowLine {
    let worst_of = |series: &Series| {
        let values = series.values_m.iter().filter_map(|values| values.get(index)).copied();
        values.max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or_default() * 1e3
    };
    let middle = match &window.measurement {
        Measurement::Plane(flat) => flat.plane.point.coords,
        Measurement::Balls { balls, .. } => {
            balls.iter().map(|ball| ball.sphere.centre.coords).sum::<fringeflow::geometry::Vector3>()
                / balls.len().max(1) as f64
        }
    };
    let surfaces = window.measurement.surfaces();
    let sum = |of: fn(&SurfaceFigures) -> usize| surfaces.iter().map(|surface| of(surface)).sum::<usize>();
    let (points, used) = (sum(|s| s.left_out.points), sum(|s| s.left_out.used));
    WindowLine {
        number: window.number,
        time_s: window.time_s,
        middle_mm: middle.map(|m| m * 1e3).into(),
        worst_mm: all.iter().map(worst_of).collect(),
        points,
        left_out_percent: 100.0 * (points - used) as f64 / points.max(1) as f64,
    }
}
