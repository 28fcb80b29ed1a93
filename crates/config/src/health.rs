//! Table `[health]`: limits of the health quantities.

use fringeflow_telemetry::health::{HealthLimits, Limits, Quantity};

use super::ConfigurationProblem;
use super::raw::{RawHealth, RawLimits, checked};

/// Maximum number of windows in a level.
const MAX_WINDOWS: usize = 1000;

pub(super) fn health_limits(raw: &RawHealth) -> Result<HealthLimits, ConfigurationProblem> {
    let mut limits = HealthLimits::default();
    for quantity in Quantity::ALL {
        if let Some(given) = raw_limits(raw, quantity) {
            limits.set(quantity.key(), checked_limits(quantity, given, limits.limits_of(quantity))?);
        }
    }
    limits.windows = checked(
        "health.windows",
        raw.windows.unwrap_or(limits.windows),
        |n| (1..=MAX_WINDOWS).contains(n),
        "it must lie between 1 and 1000",
    )?;
    limits.fewest_windows = checked(
        "health.fewest_windows",
        raw.fewest_windows.unwrap_or(limits.fewest_windows.min(limits.windows)),
        |n| (1..=limits.windows).contains(n),
        "it must lie between 1 and health.windows",
    )?;
    limits.release_share = checked(
        "health.release_share",
        raw.release_share.unwrap_or(limits.release_share),
        |share| *share > 0.0 && *share <= 1.0,
        "it must be a share of the limit, above 0 and at most 1",
    )?;
    Ok(limits)
}

fn raw_limits(raw: &RawHealth, quantity: Quantity) -> Option<RawLimits> {
    match quantity {
        Quantity::Drift => raw.drift_rad,
        Quantity::DeltaSd => raw.delta_sd_rad,
        Quantity::DeltaNoise => raw.delta_noise_rad,
        Quantity::DeltaMean => raw.delta_mean_rad,
        Quantity::ResidualCam1 | Quantity::ResidualCam2 => raw.residual_share,
        Quantity::HarmonicsCam1 | Quantity::HarmonicsCam2 => raw.harmonics_share,
        Quantity::SaturatedCam1 | Quantity::SaturatedCam2 => raw.saturated_share,
        Quantity::DimCam1 | Quantity::DimCam2 => raw.dim_share,
        Quantity::Skew => raw.skew_ms,
        Quantity::Motion => raw.motion_rad,
        Quantity::Brightness => raw.brightness_share,
        Quantity::OneSurface => raw.one_surface_share,
        Quantity::Lost => raw.lost_share,
        Quantity::Slipped => raw.slipped_share,
        Quantity::Unexplained => raw.unexplained_share,
        Quantity::FalseCandidates => raw.false_candidates,
        Quantity::UnlitCam1 | Quantity::UnlitCam2 => raw.unlit_share,
        Quantity::UnusedRangeCam1 | Quantity::UnusedRangeCam2 => raw.unused_range_share,
    }
}

fn checked_limits(quantity: Quantity, given: RawLimits, default: Limits) -> Result<Limits, ConfigurationProblem> {
    let limits = Limits { warn: given.warn.unwrap_or(default.warn), bad: given.bad.unwrap_or(default.bad) };
    if limits.warn > 0.0 && limits.warn < limits.bad && limits.bad.is_finite() {
        return Ok(limits);
    }
    let Limits { warn, bad } = limits;
    Err(ConfigurationProblem::Named {
        key: quantity.key(),
        problem: format!("warn is {warn} and bad is {bad}; both must be finite, warn above 0 and below bad"),
    })
}
