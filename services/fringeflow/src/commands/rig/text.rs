//! The report as text and tables for the terminal.

use std::io::{self, Write};

use fringeflow_lab::rig_report::{Advice, CalibrationQuality, Change, Comb, Evaluation, Figures, Layout, RigReport};

/// efc below which the paper recommends the method.
const RECOMMENDED_EFC: f64 = 0.5;
/// Minimum share of the cases in which an order survives to be listed.
const MIN_LISTED_SHARE: f64 = 0.002;

/// Writes the whole report.
pub(super) fn write(out: &mut impl Write, report: &RigReport) -> io::Result<()> {
    layout(out, &report.layout)?;
    coverage(out, report)?;
    assumptions(out, report)?;
    evaluation(out, &report.evaluation)?;
    comb(out, &report.evaluation.comb)?;
    advice(out, report)
}

fn layout(out: &mut impl Write, l: &Layout) -> io::Result<()> {
    let mm = |metres: f64| 1e3 * metres;
    writeln!(out, "Layout (lengths in mm, angles at the centre of the volume)")?;
    writeln!(
        out,
        "  base C1–C2          {:8.1}   angle {:5.1}°",
        mm(l.base_cam1_cam2_m),
        l.angle_cam1_cam2_rad.to_degrees()
    )?;
    writeln!(
        out,
        "  base C1–P           {:8.1}   angle {:5.1}°",
        mm(l.base_cam1_projector_m),
        l.angle_cam1_projector_rad.to_degrees()
    )?;
    writeln!(
        out,
        "  base C2–P           {:8.1}   angle {:5.1}°",
        mm(l.base_cam2_projector_m),
        l.angle_cam2_projector_rad.to_degrees()
    )?;
    writeln!(
        out,
        "  place r of P        {:8.3}   (0 at C1, 1 at C2; {:.1} off the base)",
        l.projector_place_on_base,
        mm(l.projector_off_base_m)
    )?;
    writeln!(out, "  working distance    {:8.1}   volume {:.1} deep", mm(l.working_distance_m), mm(l.volume_depth_m))?;
    writeln!(
        out,
        "  pixel footprint     {:8.4}   depth per pixel of C2 {:.4}",
        mm(l.pixel_footprint_m),
        mm(l.depth_per_pixel_m)
    )?;
    writeln!(
        out,
        "  fringe period       {:8.3}   ({:.2} projector pixels), depth per rad of δ {:.3}",
        mm(l.period_m),
        l.period_px,
        mm(l.depth_per_rad_m)
    )
}

fn coverage(out: &mut impl Write, report: &RigReport) -> io::Result<()> {
    let c = &report.coverage;
    let percent = |share: f64| 100.0 * share;
    writeln!(out, "\nCoverage (percent)")?;
    writeln!(
        out,
        "  image of C1 with a segment {:5.1}, also seen by C2 and lit at the middle of the segment {:5.1}",
        percent(c.image_with_segment),
        percent(c.image_measurable)
    )?;
    writeln!(
        out,
        "  volume seen by all three {:5.1} (C1 {:.1}, C2 {:.1}, P {:.1})",
        percent(c.volume_measurable),
        percent(c.volume_seen_by_cam1),
        percent(c.volume_seen_by_cam2),
        percent(c.volume_lit)
    )
}

fn assumptions(out: &mut impl Write, report: &RigReport) -> io::Result<()> {
    let a = &report.assumptions;
    let calibration = match a.calibration {
        CalibrationQuality::SdRad(sd_rad) => format!("calibration share of sd {sd_rad} rad"),
        CalibrationQuality::ErrorPx(error_px) => format!("calibration error {error_px} px per coordinate"),
    };
    writeln!(
        out,
        "\nAssumed: {} steps, noise {} and modulation {} grey levels, {calibration}",
        a.steps, a.noise_grey, a.modulation_grey
    )
}

fn evaluation(out: &mut impl Write, e: &Evaluation) -> io::Result<()> {
    let (p, d) = (&e.periods, &e.deviation);
    writeln!(out, "\nAmbiguity (paper, Eq. 1)")?;
    writeln!(
        out,
        "  n, periods on a segment {:6.2}   ({:.2} to {:.2}; spans {:.2} orders in P, at most {:.2})",
        p.mean, p.min, p.max, p.orders_spanned_mean, p.orders_spanned_max
    )?;
    writeln!(
        out,
        "  sd of δ               {:8.4}   rad (noise {:.4}, calibration {:.4}); thr {:.4} rad",
        d.sd_rad, d.noise_sd_rad, d.calibration_sd_rad, d.threshold_rad
    )?;
    let verdict = if e.efc < RECOMMENDED_EFC { "below" } else { "NOT below" };
    writeln!(out, "  efc                     {:6.3}   {verdict} the recommended {RECOMMENDED_EFC}", e.efc)?;
    writeln!(out, "  puc                     {:6.2}   % of the correspondences expected to be unique", e.puc_percent)?;
    writeln!(out, "  sd of depth by noise  {:8.4}   mm", 1e3 * d.depth_sd_m)
}

fn comb(out: &mut impl Write, comb: &Comb) -> io::Result<()> {
    writeln!(
        out,
        "\nWrong fringe orders on flat surfaces: {:.3} survive per true point over tilts to ±40°, {:.3} untilted",
        comb.survivors, comb.survivors_facing
    )?;
    let surviving: Vec<_> = comb.teeth.iter().filter(|tooth| tooth.surviving_share >= MIN_LISTED_SHARE).collect();
    if surviving.is_empty() {
        return writeln!(out, "  none survives in more than {:.1} % of the cases", 100.0 * MIN_LISTED_SHARE);
    }
    writeln!(out, "  order   present %   survives %   like true %   mean |δ|   |2π·k·r|")?;
    for tooth in surviving {
        writeln!(
            out,
            "  {:+5}   {:9.1}   {:10.1}   {:11.1}   {:8.3}   {:8.3}",
            tooth.order,
            100.0 * tooth.present_share,
            100.0 * tooth.surviving_share,
            100.0 * tooth.like_true_share,
            tooth.mean_abs_delta_rad,
            tooth.approximate_abs_delta_rad
        )?;
    }
    writeln!(
        out,
        "  per true point, wrong orders whose δ has no slope either, so that they look like the true one, by tilt:"
    )?;
    let by_tilt: Vec<String> = comb.like_true.iter().map(|(tilt, count)| format!("{tilt:+.0}° {count:.3}")).collect();
    writeln!(out, "  {}", by_tilt.join("   "))
}

fn advice(out: &mut impl Write, report: &RigReport) -> io::Result<()> {
    writeln!(out, "\nEffect of changes (coarser grid)           n       sd     efc   survivors   sd of depth, mm")?;
    advice_line(out, "unchanged", &report.advice_base)?;
    for Advice { change, figures } in &report.advice {
        advice_line(out, &change_text(change), figures)?;
    }
    writeln!(
        out,
        "efc counts false candidates on irregular surfaces, survivors count them on flat surfaces. Fewer are better."
    )
}

fn advice_line(out: &mut impl Write, name: &str, f: &Figures) -> io::Result<()> {
    let depth_sd_mm = 1e3 * f.depth_sd_m;
    writeln!(out, "  {name:36} {:6.2} {:8.4} {:7.3} {:11.3} {depth_sd_mm:17.4}", f.n, f.sd_rad, f.efc, f.survivors)
}

fn change_text(change: &Change) -> String {
    match change {
        Change::ProjectorPlace { from, to } => format!("move P along the base: r {from:.2} -> {to:.2}"),
        Change::Period { from_px, to_px } => format!("period {from_px:.1} -> {to_px:.1} px"),
        Change::Depth { from_m, to_m } => format!("volume {:.1} -> {:.1} mm deep", 1e3 * from_m, 1e3 * to_m),
    }
}
