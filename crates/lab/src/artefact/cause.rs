//! What the figures of an artefact hint at. A cause is named only where the data show it beyond their noise.

use super::measurement::{BallFigures, Measurement, SurfaceFigures};
use super::ripple::Ripple;
use super::statistics::{mean_and_sd, median};
use super::trend::Bend;

/// How many standard uncertainties an error must have to be named.
const SURE: f64 = 3.0;
/// Smallest share of the form that a bend must explain, and smallest ratio to the range that noise would give.
const BEND_SHARE: f64 = 0.5;
const BEND_NOISE: f64 = 5.0;
/// Smallest amplitude of a ripple, in standard deviations and as a share of the noise of a point.
const RIPPLE_SDS: f64 = 4.0;
const RIPPLE_NOISE: f64 = 0.15;

/// A likely cause of errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cause {
    /// All lengths are too long or too short by the same share.
    Scale {
        /// Relative error.
        share: f64,
        /// Its standard uncertainty.
        u: f64,
    },
    /// Balls have another size than scale and certificate explain.
    BallSize {
        /// Error of the diameter that is left, metres.
        error_m: f64,
        /// Its standard uncertainty, metres.
        u_m: f64,
    },
    /// A plate is smoothly bent.
    Bend(Bend),
    /// The surface repeats with the fringes.
    Ripple(Ripple),
    /// Points stand apart from the surface, more than the standard lets be left out.
    Apart {
        /// Their share.
        share: f64,
        /// Their mean distance, positive towards the scanner for a plate and outwards for a ball, metres.
        offset_m: f64,
    },
}

/// The causes that windows of one artefact show. `spacing_u_m` and `diameter_u_m` are the standard uncertainties of the
/// certified lengths.
#[must_use]
pub fn causes(windows: &[&Measurement], spacing_u_m: f64, diameter_u_m: f64) -> Vec<Cause> {
    let scale = scale(windows, spacing_u_m);
    let surfaces: Vec<&SurfaceFigures> = windows.iter().flat_map(|window| window.surfaces()).collect();
    let size = ball_size(windows, diameter_u_m, scale.filter(|scale| scale.is_sure()));
    let named = [scale.filter(|scale| scale.is_sure()), size, bend(windows), ripple(&surfaces), apart(&surfaces)];
    named.into_iter().flatten().collect()
}

impl Cause {
    fn is_sure(&self) -> bool {
        matches!(self, Self::Scale { share, u } if share.abs() > SURE * u)
    }
}

impl Measurement {
    /// The measured surfaces.
    #[must_use]
    pub fn surfaces(&self) -> Vec<&SurfaceFigures> {
        match self {
            Self::Plane(flat) => vec![&flat.surface],
            Self::Balls { balls, .. } => balls.iter().map(|ball| &ball.surface).collect(),
        }
    }

    fn balls(&self) -> &[BallFigures] {
        match self {
            Self::Plane(_) => &[],
            Self::Balls { balls, .. } => balls,
        }
    }
}

/// The mean of some errors and its standard uncertainty. What windows share (the place of the artefact, the certificate)
/// does not average out, so the uncertainty of one window and of the certificate stays whole.
fn mean_with_u(errors: &[f64], u_window: f64, u_certificate: f64) -> Option<(f64, f64)> {
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let scatter = mean_and_sd(errors).map_or(0.0, |(_, sd)| sd / (errors.len() as f64).sqrt());
    (!errors.is_empty()).then(|| (mean, (u_window.powi(2) + scatter.powi(2) + u_certificate.powi(2)).sqrt()))
}

fn scale(windows: &[&Measurement], spacing_u_m: f64) -> Option<Cause> {
    let spacings = windows.iter().flat_map(|window| match window {
        Measurement::Balls { spacings, .. } => spacings.as_slice(),
        Measurement::Plane(_) => &[],
    });
    let (mut shares, mut u, mut shortest_m) = (Vec::new(), Vec::new(), f64::INFINITY);
    for spacing in spacings {
        shares.push(spacing.error_m / spacing.certified_m);
        u.push(spacing.u_m / spacing.certified_m);
        shortest_m = shortest_m.min(spacing.certified_m);
    }
    let (share, u) = mean_with_u(&shares, median(&mut u), spacing_u_m / shortest_m)?;
    // Where a ball is measured too large or too small, its centre may be wrong by as much as its radius.
    let mut off_m: Vec<f64> = size_errors(windows, share).map(|error_m| error_m.abs() / 2.0).collect();
    let u_centres = std::f64::consts::SQRT_2 * median(&mut off_m) / shortest_m;
    Some(Cause::Scale { share, u: u.hypot(u_centres) })
}

/// Errors of the diameters of all balls that a scale error leaves, metres.
fn size_errors(windows: &[&Measurement], scale_share: f64) -> impl Iterator<Item = f64> {
    let balls = windows.iter().flat_map(|window| window.balls());
    balls.map(move |ball| ball.size_error_m - scale_share * 2.0 * ball.sphere.radius_m)
}

fn ball_size(windows: &[&Measurement], diameter_u_m: f64, scale: Option<Cause>) -> Option<Cause> {
    let share = if let Some(Cause::Scale { share, .. }) = scale { share } else { 0.0 };
    let balls = || windows.iter().flat_map(|window| window.balls());
    let errors: Vec<f64> = size_errors(windows, share).collect();
    let mut u: Vec<f64> = balls().map(|ball| ball.diameter_u_m).collect();
    let mut noise: Vec<f64> = balls().map(|ball| ball.surface.noise_m[0]).collect();
    let (error_m, u_m) = mean_with_u(&errors, median(&mut u), diameter_u_m)?;
    // What is below the noise of a point matters to nobody, even if many points show it.
    (error_m.abs() > (SURE * u_m).max(median(&mut noise))).then_some(Cause::BallSize { error_m, u_m })
}

fn bend(windows: &[&Measurement]) -> Option<Cause> {
    let bends = windows.iter().filter_map(|window| match window {
        Measurement::Plane(flat) => flat.bend,
        Measurement::Balls { .. } => None,
    });
    let bend = median_by(bends, |bend| bend.range_m)?;
    (bend.share >= BEND_SHARE && bend.range_m >= BEND_NOISE * bend.noise_m).then_some(Cause::Bend(bend))
}

fn ripple(surfaces: &[&SurfaceFigures]) -> Option<Cause> {
    let sure = |surface: &&SurfaceFigures| {
        let ripple = surface.ripple?;
        let least_m = (RIPPLE_SDS * ripple.sd_m).max(RIPPLE_NOISE * surface.noise_m[0]);
        (ripple.amplitude_m >= least_m).then_some(ripple)
    };
    let found: Vec<Ripple> = surfaces.iter().filter_map(sure).collect();
    // A single window of many is chance.
    if 2 * found.len() <= surfaces.len() {
        return None;
    }
    median_by(found.into_iter(), |ripple| ripple.amplitude_m).map(Cause::Ripple)
}

fn apart(surfaces: &[&SurfaceFigures]) -> Option<Cause> {
    let apart = surfaces.iter().filter(|surface| surface.left_out.exceeds());
    let share = |surface: &SurfaceFigures| surface.left_out.far as f64 / surface.left_out.points.max(1) as f64;
    let worst = apart.max_by(|a, b| share(a).total_cmp(&share(b)))?;
    Some(Cause::Apart { share: share(worst), offset_m: worst.far_offset_m })
}

/// The item in the middle, by a value.
fn median_by<T>(items: impl Iterator<Item = T>, value: impl Fn(&T) -> f64) -> Option<T> {
    let mut items: Vec<T> = items.collect();
    items.sort_by(|a, b| value(a).total_cmp(&value(b)));
    let middle = items.len() / 2;
    items.into_iter().nth(middle)
}
