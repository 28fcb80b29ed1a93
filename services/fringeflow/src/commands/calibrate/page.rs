//! The page of a calibration: a single file without scripts that loads nothing.

use std::fmt::Write as _;

use fringeflow_calibrate::findings::Severity;
use fringeflow_calibrate::{CalibratedRig, DeviceName, Quality};

use crate::report::{COMMON_STYLE, FRAME_STYLE, escaped};

use super::{Outcome, svg, text};

const STYLE: &str = include_str!("page.css");

/// Returns the text of the page.
pub(super) fn page(outcome: &Outcome<'_>) -> String {
    let refused = outcome.assessment.refusals().next().is_some();
    let (level, verdict) = match (refused, outcome.assessment.findings.is_empty()) {
        (true, _) => ("error", "refused: measurements with it would be wrong"),
        (false, false) => ("warning", "usable, could be better"),
        (false, true) => ("ok", "usable"),
    };
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <title>Fringeflow: calibration</title>\n<style>\n{COMMON_STYLE}\n{FRAME_STYLE}\n{STYLE}</style>\n</head>\n<body>\n\
         <header class=\"top\"><h1><span class=\"brand-name\">Fringeflow</span> calibration</h1>\
         <span class=\"pill\" data-level=\"{level}\">{verdict}</span></header>\n<main>\n\
         <dl class=\"about panel\"><div><dt>Images</dt><dd>{}</dd></div><div><dt>Board</dt><dd>{}</dd></div>\
         <div><dt>Poses</dt><dd>{}</dd></div></dl>\n",
        escaped(&outcome.folder.display().to_string()),
        escaped(&outcome.board.to_string()),
        outcome.observed.poses.len()
    );
    findings(&mut out, outcome);
    if let (Ok(calibrated), Some(quality)) = (&outcome.assessment.calibrated, &outcome.assessment.quality) {
        figures(&mut out, outcome);
        images(&mut out, calibrated, quality);
        poses(&mut out, outcome, calibrated);
        proposed(&mut out, calibrated, quality);
        depth(&mut out, calibrated, quality);
    }
    let version = env!("CARGO_PKG_VERSION");
    out + &format!("</main>\n<footer class=\"foot\">Fringeflow {version}</footer>\n</body>\n</html>\n")
}

fn findings(out: &mut String, outcome: &Outcome<'_>) {
    if outcome.assessment.findings.is_empty() {
        return;
    }
    *out += "<section class=\"panel\"><h2>Findings</h2><ul class=\"findings\">";
    for finding in &outcome.assessment.findings {
        let level = match finding.severity {
            Severity::Refusal => "error",
            Severity::Warning => "warning",
        };
        let (cause, text) = (finding.cause, escaped(&finding.text));
        let _ = write!(out, "<li><span class=\"badge\" data-level=\"{level}\">{cause}</span> {text}</li>");
    }
    *out += "</ul></section>";
}

fn figures(out: &mut String, outcome: &Outcome<'_>) {
    let mut figures = Vec::new();
    // Writing to memory cannot fail.
    let _ = text::write_figures(&mut figures, outcome);
    let _ = write!(
        out,
        "<section class=\"panel\"><h2>Figures</h2><pre>{}</pre></section>",
        escaped(&String::from_utf8_lossy(&figures))
    );
}

fn images(out: &mut String, calibrated: &CalibratedRig, quality: &Quality) {
    *out += "<section class=\"panel\"><h2>Coverage</h2><p>Shaded cells hold points of the board; yellow ones hold none. Lines show the residual of \
             each point, a hundred times as long as it is; red ones were left out.</p><div class=\"row\">";
    for device in 0..calibrated.problem.sizes_px.len() {
        let drawing = svg::coverage(calibrated, quality, device);
        let _ = write!(out, "<figure>{drawing}<figcaption>{}</figcaption></figure>", DeviceName::of(device));
    }
    *out += "</div></section>";
}

/// Residuals of each pose.
fn poses(out: &mut String, outcome: &Outcome<'_>, calibrated: &CalibratedRig) {
    *out += "<section class=\"panel\"><h2>Poses</h2><table><tr><th>pose</th>";
    let devices = calibrated.problem.sizes_px.len();
    for device in 0..devices {
        let _ = write!(out, "<th>{}: rms px</th><th>points</th><th>left out</th>", DeviceName::of(device));
    }
    *out += "<th>remarks</th></tr>";
    for (view, pose) in outcome.observed.poses.iter().enumerate() {
        let _ = write!(out, "<tr><td>{}</td>", escaped(&pose.name));
        for device in 0..devices {
            let of_device = calibrated
                .problem
                .measurements
                .iter()
                .enumerate()
                .filter(|(_, m)| calibrated.views[m.view] == view && m.measures(device));
            let (mut square, mut used, mut left_out) = (0.0, 0_usize, 0_usize);
            for (k, _) in of_device {
                match calibrated.adjusted.residuals_px[k] {
                    Some(r) if calibrated.adjusted.weights[k] >= 1.0 => {
                        square += r.norm_squared();
                        used += 1;
                    }
                    _ => left_out += 1,
                }
            }
            let rms = if used > 0 { format!("{:.3}", (square / used as f64).sqrt()) } else { "–".to_owned() };
            let _ = write!(out, "<td>{rms}</td><td>{used}</td><td>{left_out}</td>");
        }
        let remarks = pose
            .cameras
            .iter()
            .enumerate()
            .filter_map(|(camera, seen)| Some(format!("{}: {}", DeviceName::of(camera), seen.as_ref().err()?)));
        let _ = write!(out, "<td>{}</td></tr>", escaped(&remarks.collect::<Vec<_>>().join("; ")));
    }
    *out += "</table></section>";
}

fn proposed(out: &mut String, calibrated: &CalibratedRig, quality: &Quality) {
    if quality.proposed.is_empty() {
        return;
    }
    *out += "<section class=\"panel\"><h2>Poses that would make it better</h2><p>As camera 1 would see the board, the best first.</p>";
    let _ = write!(out, "<div class=\"row\"><figure>{}</figure><ol>", svg::proposed(calibrated, quality));
    for pose in &quality.proposed {
        let _ = write!(out, "<li>{} (depth ± {:.4} mm)</li>", pose.words, pose.expected.depth_mm);
    }
    *out += "</ol></div></section>";
}

fn depth(out: &mut String, calibrated: &CalibratedRig, quality: &Quality) {
    if quality.expected.is_none() {
        return;
    }
    *out += "<section class=\"panel\"><h2>Expected error of the depth</h2><p>In micrometres, where both cameras and the projector see, as camera 1 \
             sees it.</p><div class=\"row\">";
    for (depth_mm, drawing) in svg::depth_errors(calibrated, quality) {
        let _ = write!(out, "<figure>{drawing}<figcaption>{depth_mm:.0} mm</figcaption></figure>");
    }
    *out += "</div></section>";
}
