//! What is wrong with a calibration, and what causes it.
//!
//! Every sign is asked for its own cause: the harmonics of the fringes for gamma, their brightness for the exposure, the
//! corners before and after for motion, and so on. A finding that makes measurements wrong refuses the calibration; one that
//! makes them worse warns.

use crate::adjustment::{Layout, PROJECTOR};
use crate::images::{ImageSigns, NoView};
use crate::lens::INTRINSIC_NAMES;
use crate::median::median;
use crate::observed::{Observed, ObservedPose};
use crate::quality::prediction::ExpectedError;
use crate::rig::{CalibratedRig, DeviceName};

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// The calibration is usable, and could be better.
    Warning,
    /// Measurements with it would be wrong.
    Refusal,
}

/// What is measured, and what it may be.
struct Limit {
    warning: f64,
    refusal: f64,
}

impl Limit {
    fn severity(&self, value: f64) -> Option<Severity> {
        // What is no number is no good calibration.
        match value {
            value if value <= self.warning => None,
            value if value <= self.refusal => Some(Severity::Warning),
            _ => Some(Severity::Refusal),
        }
    }
}

/// Something that is wrong, with its cause and the remedy.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// Short name of the cause.
    pub cause: &'static str,
    /// What was seen, what it means, what to do.
    pub text: String,
}

/// Second harmonic of the fringes relative to the fundamental. With four steps it shifts the phase by up to this many
/// radians, so the refusal is where the error of δ would reach that of a usual calibration several times over.
const HARMONIC: Limit = Limit { warning: 0.03, refusal: 0.1 };
/// Deviation of the brightness of a fringe image. The error of the phase is about half of it, in radians.
const BRIGHTNESS: Limit = Limit { warning: 0.01, refusal: 0.03 };
/// Share of saturated pixels with fringes.
const SATURATED: Limit = Limit { warning: 0.02, refusal: 0.3 };
/// Motion of the board during the images of a pose, pixels.
const MOVED_PX: Limit = Limit { warning: 0.2, refusal: 1.0 };
/// Width of the edges of the board, pixels. An ideal sensor with a sharp lens has 1 to 2.5.
const EDGE_PX: Limit = Limit { warning: 5.0, refusal: 10.0 };
/// Residual of the fringes relative to their modulation. A gamma of 2.2 causes up to 0.2, two exchanged images more.
const RESIDUAL: Limit = Limit { warning: 0.1, refusal: 0.25 };
/// Share of pixels with fringes whose Gray code does not fit their phase.
const UNCODED: Limit = Limit { warning: 0.2, refusal: 0.5 };
/// Root mean square of the reprojection errors, in thousandths of the image's width.
const REPROJECTION: Limit = Limit { warning: 0.5, refusal: 2.0 };
/// Root mean square of the projector's residuals relative to those of the cameras, both in shares of their image.
const PROJECTOR_FIT: Limit = Limit { warning: 3.0, refusal: 8.0 };
/// Relative standard deviation of focal lengths.
const FOCAL_SD: Limit = Limit { warning: 2e-3, refusal: 1e-2 };
/// Difference of the focal lengths in x and y.
const ASPECT: Limit = Limit { warning: 0.01, refusal: 0.1 };
/// Difference of the focal lengths of cameras of one size.
const FOCAL_PAIR: Limit = Limit { warning: 0.1, refusal: f64::INFINITY };
/// Expected standard deviation of δ, rad. Beyond the refusal, fringe orders are no longer decided by it.
const DELTA_RAD: Limit = Limit { warning: 0.05, refusal: 0.3 };
/// Change of the lenses if the board is not taken for a plane, in standard deviations. A flat board gives about 1; where it is
/// much more, the standard deviations do not hold.
const BEND_SDS: Limit = Limit { warning: 2.0, refusal: 4.0 };
/// What must not be at all.
const NONE: Limit = Limit { warning: 0.0, refusal: 0.0 };
/// Fields of view of lenses of scanners, degrees.
const FIELD_DEG: std::ops::RangeInclusive<f64> = 3.0..=130.0;
/// Share of poses that must agree before a cause is said of all of them.
const MOST_POSES: f64 = 0.5;
/// Share of the points of a pose that may deviate.
const DEVIATING: f64 = 0.25;

/// Findings in the images themselves.
#[must_use]
pub fn in_images(observed: &Observed) -> Vec<Finding> {
    let mut findings = Vec::new();
    let signs: Vec<(&ObservedPose, usize, &ImageSigns)> = observed
        .poses
        .iter()
        .flat_map(|pose| pose.cameras.iter().enumerate().filter_map(move |(c, s)| Some((pose, c, s.as_ref().ok()?))))
        .collect();
    let of_all = |of: fn(&ImageSigns) -> Option<f64>| median(signs.iter().filter_map(|(.., s)| of(s)).collect());
    let mut say = |limit: &Limit, value: Option<f64>, cause: &'static str, text: &dyn Fn(f64) -> String| {
        if let Some((value, severity)) = value.and_then(|value| Some((value, limit.severity(value)?))) {
            findings.push(Finding { severity, cause, text: text(value) });
        }
    };
    say(&HARMONIC, of_all(|s| s.second_harmonic_share), "gamma", &|share| {
        let gamma = (1.0 + 2.0 * share) / (1.0 - share);
        format!(
            "the projector is not linear: the fringes have a second harmonic of {:.0} %, as with a gamma of {gamma:.1}, or of \
             more where it is not sharp; set the projector's gamma to 1, or make its images with `fringeflow patterns \
             --gamma`",
            100.0 * share
        )
    });
    say(&BRIGHTNESS, of_all(|s| s.brightness_share), "exposure", &|share| {
        format!(
            "the fringe images of one pose differ in brightness by {:.1} %: the exposure is no multiple of the projector's \
             refresh period; set it to 1, 2, … periods, 16.667 ms each at 60 Hz",
            100.0 * share
        )
    });
    say(&RESIDUAL, of_all(|s| s.residual_share), "order", &|share| {
        format!(
            "the fringes are no sinusoids: the residual of their fit is {:.0} % of their modulation; the images are not in \
             the order of patterns.toml, or some are of another pose",
            100.0 * share
        )
    });
    say(&UNCODED, of_all(|s| s.coded_share.map(|share| 1.0 - share)), "order", &|share| {
        format!(
            "the Gray code does not fit the fringes in {:.0} % of the pixels: the images are not in the order of \
             patterns.toml, or the projector is not sharp",
            100.0 * share
        )
    });
    say(&EDGE_PX, of_all(|s| s.edge_width_px), "blur", &|width| {
        format!(
            "the images are not sharp: edges of the board are {width:.1} pixels wide; focus the cameras on the board"
        )
    });
    say(&SATURATED, of_all(|s| Some(s.saturated_share)), "saturated", &|share| {
        format!("{:.0} % of the pixels with fringes are saturated; use a shorter exposure", 100.0 * share)
    });
    say(&MOVED_PX, of_all(|s| s.moved_px), "motion", &|moved_px| {
        format!(
            "the board moved by {moved_px:.1} pixels during the images of a pose; put it down, or show fewer patterns at a \
             higher rate"
        )
    });
    findings.extend(motion_of_some(&signs));
    findings.extend(without_board(observed));
    findings
}

/// Poses in which the board moved, where most do not.
fn motion_of_some(signs: &[(&ObservedPose, usize, &ImageSigns)]) -> Option<Finding> {
    let moved: Vec<(&str, f64)> = signs
        .iter()
        .filter_map(|(pose, _, s)| Some((pose.name.as_str(), s.moved_px.filter(|&px| px > MOVED_PX.refusal)?)))
        .collect();
    let worst_px = moved.iter().map(|(_, px)| *px).fold(0.0, f64::max);
    let names = listed(moved.iter().map(|(name, _)| *name));
    let some = !moved.is_empty() && (moved.len() as f64) < MOST_POSES * signs.len() as f64;
    some.then(|| Finding {
        severity: Severity::Refusal,
        cause: "motion",
        text: format!(
            "the board moved by up to {worst_px:.1} pixels during the images of {names}; remove or repeat these poses"
        ),
    })
}

/// Poses in which a camera does not see the board.
fn without_board(observed: &Observed) -> Vec<Finding> {
    let mut findings = Vec::new();
    for camera in 0..2 {
        let failed: Vec<(&str, &NoView)> = observed
            .poses
            .iter()
            .filter_map(|pose| Some((pose.name.as_str(), pose.cameras[camera].as_ref().err()?)))
            .collect();
        let Some((_, why)) = failed.first() else { continue };
        let all = failed.len() == observed.poses.len();
        let severity = if all { Severity::Refusal } else { Severity::Warning };
        let places = if all { "any pose".to_owned() } else { listed(failed.iter().map(|(name, _)| *name)) };
        let text = format!("{} shows no board in {places}: {why}", DeviceName::of(camera));
        findings.push(Finding { severity, cause: "no board", text });
    }
    findings
}

/// Findings in a calibration. `expected` are the expected errors over the volume.
#[must_use]
pub fn in_calibration(
    observed: &Observed,
    calibrated: &CalibratedRig,
    expected: Option<ExpectedError>,
) -> Vec<Finding> {
    let mut findings = other_poses(observed, calibrated);
    let adjusted = &calibrated.adjusted;
    let layout = Layout::of(&adjusted.state);
    let sizes_px = &calibrated.problem.sizes_px;
    let mut say = |limit: &Limit, value: f64, cause: &'static str, text: String| {
        if let Some(severity) = limit.severity(value) {
            findings.push(Finding { severity, cause, text });
        }
    };
    for (device, state) in adjusted.state.devices.iter().enumerate() {
        let (name, [fx, fy], [width, _]) = (DeviceName::of(device), state.lens.focal_px(), sizes_px[device]);
        let field_deg = 2.0 * (width as f64 / (2.0 * fx)).atan().to_degrees();
        // How far the field of view is outside of those of lenses: nothing within.
        let outside_deg = (FIELD_DEG.start() - field_deg).max(field_deg - FIELD_DEG.end());
        say(&NONE, outside_deg, "focal length", {
            format!("{name} has a field of view of {field_deg:.1}°, which no lens of a scanner has")
        });
        say(&ASPECT, (fx / fy - 1.0).abs(), "focal length", {
            format!(
                "{name} has focal lengths of {fx:.0} and {fy:.0} pixels; square pixels have one, so the images were scaled unevenly"
            )
        });
        let sd = adjusted.sd(layout.lens(device)) / fx;
        say(&FOCAL_SD, sd, "poses", {
            format!(
                "the focal length of {name} is known to {:.2} % only ({} = {fx:.0} ± {:.1} pixels): the poses are too few or \
                 too parallel; take more with tilts of 20° to 45° about both axes and at several distances",
                100.0 * sd,
                INTRINSIC_NAMES[0],
                sd * fx
            )
        });
    }
    if let Some(bend) = calibrated.bend {
        say(&BEND_SDS, bend.change_sds, "board", {
            format!(
                "the board is no plane: its points fit a shape with {:.2} mm from the lowest to the highest, and with it the \
                 lenses change by {:.1} standard deviations; glue it on something stiff, or give --bent-board",
                1e3 * bend.height_m,
                bend.change_sds
            )
        });
    }
    if sizes_px[0] == sizes_px[1] {
        let [f1, f2] = [0, 1].map(|d| adjusted.state.devices[d].lens.focal_px()[0]);
        say(&FOCAL_PAIR, (f1 / f2 - 1.0).abs(), "focal length", {
            format!("the cameras have focal lengths of {f1:.0} and {f2:.0} pixels; are their lenses alike?")
        });
    }
    for camera in 0..2 {
        let (name, rms_px) = (DeviceName::of(camera), adjusted.groups[camera].rms_px);
        say(&REPROJECTION, 1e3 * rms_px / sizes_px[camera][0] as f64, "reprojection", {
            format!(
                "the corners of {name} deviate by {rms_px:.2} pixels (root mean square); is the board flat, is SPEC that of \
                 the board, and are the images sharp?"
            )
        });
    }
    if let Some(size_px) = sizes_px.get(PROJECTOR) {
        let share = |group: usize, size: [usize; 2]| adjusted.groups[group].rms_px / size[0] as f64;
        let projector = share(PROJECTOR, *size_px).max(share(PROJECTOR + 1, *size_px));
        let cameras = share(0, sizes_px[0]).max(share(1, sizes_px[1]));
        say(&PROJECTOR_FIT, projector / cameras, "projector", {
            format!(
                "the projector fits {:.1} times worse than the cameras ({:.2} of its pixels); see whether it has a gamma, \
                 shows the images in the order of patterns.toml and at its own resolution, and is sharp",
                projector / cameras,
                adjusted.groups[PROJECTOR].rms_px.max(adjusted.groups[PROJECTOR + 1].rms_px)
            )
        });
    }
    if let (Some(expected), Some(period_px)) = (expected, observed.period_px) {
        let delta_rad = expected.delta_rad(period_px);
        say(&DELTA_RAD, delta_rad, "poses", {
            format!(
                "δ of true correspondences is expected to have a standard deviation of {delta_rad:.2} rad; more poses make it \
                 smaller"
            )
        });
    }
    findings.extend(deviating_poses(observed, calibrated));
    findings
}

/// Views of which the images show different poses.
fn other_poses(observed: &Observed, calibrated: &CalibratedRig) -> Vec<Finding> {
    let name = |view: usize| observed.poses[view].name.as_str();
    let finding = |other: &crate::rig::OtherPose| {
        let found = match other.partner {
            _ if other.exchanged => {
                "; with the cameras exchanged they fit: exchange the images of both cameras".to_owned()
            }
            Some(partner) => {
                format!("; what camera 1 sees here, camera 2 sees in {}: exchange the images", name(partner))
            }
            None => "; the scanner or the board moved between the two images".to_owned(),
        };
        let text = format!(
            "the images of both cameras in {} do not show one pose: they deviate by {:.0} pixels{found}",
            name(other.view),
            other.deviation_px
        );
        Finding { severity: Severity::Refusal, cause: "pairs", text }
    };
    calibrated.other_poses.iter().map(finding).collect()
}

/// Poses of which many points fit no calibration that fits the others.
fn deviating_poses(observed: &Observed, calibrated: &CalibratedRig) -> Option<Finding> {
    let mut counts = vec![[0_usize; 2]; observed.poses.len()];
    for (measurement, weight) in calibrated.problem.measurements.iter().zip(&calibrated.adjusted.weights) {
        let view = calibrated.views[measurement.view];
        counts[view][0] += 1;
        counts[view][1] += usize::from(*weight < 1.0);
    }
    let deviates = |[all, left_out]: &[usize; 2]| *left_out as f64 > DEVIATING * *all as f64;
    let names = counts.iter().zip(&observed.poses).filter(|(c, _)| deviates(c)).map(|(_, pose)| pose.name.as_str());
    let names: Vec<&str> = names.collect();
    (!names.is_empty()).then(|| Finding {
        severity: Severity::Warning,
        cause: "pose",
        text: format!(
            "more than {:.0} % of the points of {} deviate from all others and were left out; repeat these poses",
            100.0 * DEVIATING,
            listed(names.iter().copied())
        ),
    })
}

/// Some names, and the number of the others.
fn listed<'a>(names: impl Iterator<Item = &'a str>) -> String {
    const MOST_NAMES: usize = 5;
    let mut names: Vec<&str> = names.collect();
    names.dedup();
    match names.len() {
        0..=MOST_NAMES => names.join(", "),
        count => format!("{} and {} more", names[..MOST_NAMES].join(", "), count - MOST_NAMES),
    }
}
