//! The figures of a calibration as text and as JSON.

use std::io::{self, Write};

use fringeflow_calibrate::adjustment::{Layout, PROJECTOR};
use fringeflow_calibrate::findings::Severity;
use fringeflow_calibrate::{CalibratedRig, DeviceName, INTRINSIC_NAMES, Quality};

use super::Outcome;

/// Writes the findings and all figures.
pub(super) fn write(out: &mut impl Write, outcome: &Outcome<'_>) -> io::Result<()> {
    for finding in &outcome.assessment.findings {
        let severity = match finding.severity {
            Severity::Refusal => "refused",
            Severity::Warning => "warning",
        };
        writeln!(out, "{severity}: {}", finding.text)?;
    }
    write_figures(out, outcome)
}

/// Writes the figures of a calibration.
pub(super) fn write_figures(out: &mut impl Write, outcome: &Outcome<'_>) -> io::Result<()> {
    let (Ok(calibrated), Some(quality)) = (&outcome.assessment.calibrated, &outcome.assessment.quality) else {
        return Ok(());
    };
    writeln!(
        out,
        "Calibration of {} from {} poses of {}",
        outcome.folder.display(),
        outcome.observed.poses.len(),
        outcome.board
    )?;
    devices(out, calibrated, quality)?;
    arrangement(out, calibrated)?;
    expected(out, outcome, quality)?;
    if !quality.proposed.is_empty() {
        writeln!(out, "Poses that would make it better, the best first")?;
        for pose in &quality.proposed {
            writeln!(out, "  {} (depth ± {:.4} mm)", pose.words, pose.expected.depth_mm)?;
        }
    }
    let Some(changes) = &outcome.changes else { return Ok(()) };
    if changes.is_empty() {
        writeln!(out, "nothing has moved since the earlier calibration, as far as this one can tell")?;
    }
    changes.iter().try_for_each(|change| writeln!(out, "changed: {change}"))
}

/// A device in the table.
struct DeviceLine {
    name: DeviceName,
    /// Intrinsic parameters and their standard deviations.
    lens: [(f64, f64); INTRINSIC_NAMES.len()],
    rms_px: f64,
    points: usize,
    left_out: usize,
    covered: f64,
}

fn lines(calibrated: &CalibratedRig, quality: &Quality) -> Vec<DeviceLine> {
    let adjusted = &calibrated.adjusted;
    let layout = Layout::of(&adjusted.state);
    let line = |(device, state): (usize, &fringeflow_calibrate::adjustment::Device)| {
        // The projector is measured through both cameras.
        let groups = if device == PROJECTOR { PROJECTOR..PROJECTOR + 2 } else { device..device + 1 };
        let groups = &adjusted.groups[groups];
        let points: usize = groups.iter().map(|group| group.used).sum();
        let square: f64 = groups.iter().map(|group| group.used as f64 * group.rms_px.powi(2)).sum();
        DeviceLine {
            name: DeviceName::of(device),
            lens: std::array::from_fn(|k| (state.lens.0[k], adjusted.sd(layout.lens(device) + k))),
            rms_px: (square / points.max(1) as f64).sqrt(),
            points,
            left_out: groups.iter().map(|group| group.left_out).sum(),
            covered: quality.coverage[device].share(),
        }
    };
    adjusted.state.devices.iter().enumerate().map(line).collect()
}

fn devices(out: &mut impl Write, calibrated: &CalibratedRig, quality: &Quality) -> io::Result<()> {
    writeln!(
        out,
        "  {:14} {:>20} {:>20} {:>18} {:>18} {:>7} {:>7} {:>9} {:>8}",
        "", "fx px", "fy px", "cx px", "cy px", "rms px", "points", "left out", "covered"
    )?;
    for line in lines(calibrated, quality) {
        write!(out, "  {:14}", line.name.to_string())?;
        for (k, (value, sd)) in line.lens.iter().take(4).enumerate() {
            let width = if k < 2 { 12 } else { 10 };
            write!(out, " {value:width$.2} ± {sd:5.2}")?;
        }
        let (rms_px, points, left_out, covered) = (line.rms_px, line.points, line.left_out, 100.0 * line.covered);
        writeln!(out, " {rms_px:7.3} {points:7} {left_out:9} {covered:6.0} %")?;
    }
    for line in lines(calibrated, quality) {
        write!(out, "  {:14}", line.name.to_string())?;
        for ((value, sd), name) in line.lens.iter().zip(INTRINSIC_NAMES).skip(4) {
            write!(out, " {name} {value:.5} ± {sd:.5}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

fn arrangement(out: &mut impl Write, calibrated: &CalibratedRig) -> io::Result<()> {
    let adjusted = &calibrated.adjusted;
    let layout = Layout::of(&adjusted.state);
    for (device, state) in adjusted.state.devices.iter().enumerate() {
        let Some(at) = layout.arrangement(device) else { continue };
        let place = state.from_first.inverse().translation.vector * 1e3;
        let [sd_x, sd_y, sd_z] = [0, 1, 2].map(|k| 1e3 * adjusted.sd(at + 3 + k));
        writeln!(
            out,
            "  {} stands at ({:.3}, {:.3}, {:.3}) ± ({sd_x:.3}, {sd_y:.3}, {sd_z:.3}) mm from camera 1, turned by {:.3}°",
            DeviceName::of(device),
            place.x,
            place.y,
            place.z,
            state.from_first.rotation.angle().to_degrees()
        )?;
    }
    Ok(())
}

fn expected(out: &mut impl Write, outcome: &Outcome<'_>, quality: &Quality) -> io::Result<()> {
    let Some(expected) = quality.expected else { return Ok(()) };
    writeln!(
        out,
        "  expected errors from the calibration: depth {:.4} mm, epipolar {:.3} px, projector column {:.3} px",
        expected.depth_mm, expected.epipolar_px, expected.column_px
    )?;
    if let Some(scan) = &outcome.scan {
        let box_mm = scan.volume_mm.map(|mm| mm.to_string()).join(",");
        writeln!(
            out,
            "  in the volume {box_mm} mm that all devices see: sd of δ {:.3} rad, efc {:.2} with four images",
            scan.delta_sd_rad, scan.expected_false_candidates
        )?;
    }
    Ok(())
}

/// The devices for other programs.
pub(super) fn devices_json(calibrated: &CalibratedRig, quality: Option<&Quality>) -> serde_json::Value {
    let Some(quality) = quality else { return serde_json::Value::Null };
    let device = |line: DeviceLine| {
        let values: serde_json::Map<_, _> = line
            .lens
            .iter()
            .zip(INTRINSIC_NAMES)
            .map(|((value, _), name)| (name.to_owned(), (*value).into()))
            .collect();
        let sds: serde_json::Map<_, _> =
            line.lens.iter().zip(INTRINSIC_NAMES).map(|((_, sd), name)| (name.to_owned(), (*sd).into())).collect();
        serde_json::json!({
            "name": line.name.to_string(),
            "lens": values,
            "sd": sds,
            "rms_px": line.rms_px,
            "points": line.points,
            "left_out": line.left_out,
            "covered_share": line.covered,
        })
    };
    lines(calibrated, quality).into_iter().map(device).collect()
}
