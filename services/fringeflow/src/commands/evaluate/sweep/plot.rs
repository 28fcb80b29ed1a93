//! The plot of a sweep: com and fpc over efc, as an SVG file without scripts, for light and dark pages.
//!
//! Each measurement is a point. A line connects the means over the objects, for one knob and resolution. The series
//! that do not change efc, boards and steps, are only in the table.

use super::axis::Axis;
use super::{Figures, Knob, Row};

const WIDTH_PX: f64 = 880.0;
const HEIGHT_PX: f64 = 760.0;
const EFC: Axis =
    Axis { low: 0.05, high: 4.0, from_px: 70.0, to_px: 640.0, ticks: &[0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0] };
const LEGEND_X_PX: f64 = 665.0;

/// A plot of one figure over efc.
struct Panel {
    title: &'static str,
    /// The plotted value, percent.
    figure: fn(&Figures) -> f64,
    /// Converts a plotted value to the shown number.
    label: fn(f64) -> f64,
    axis: Axis,
}

const PANELS: [Panel; 2] = [
    Panel {
        title: "com: found correctly, %; 99.99 or more at the top",
        // Results differ by orders of magnitude in their distance from 100 %.
        figure: |f| 100.0 - f.com_percent,
        label: |shortfall| 100.0 - shortfall,
        axis: Axis { low: 0.01, high: 100.0, from_px: 50.0, to_px: 320.0, ticks: &[0.01, 0.1, 1.0, 10.0, 100.0] },
    },
    Panel {
        title: "fpc: false positives, %; 0.001 or less at the bottom",
        figure: |f| f.fpc_percent,
        label: |percent| percent,
        axis: Axis {
            low: 0.001,
            high: 100.0,
            from_px: 690.0,
            to_px: 400.0,
            ticks: &[0.001, 0.01, 0.1, 1.0, 10.0, 100.0],
        },
    },
];
/// Statements of the paper (section 4): index of the panel, efc, and the plotted value in percent.
const PAPER: [(usize, f64, f64); 3] = [(0, 0.2, 0.1), (1, 0.2, 0.1), (1, 0.5, 2.0)];
/// efc beyond which the paper expects worse results.
const PAPER_WORSE_EFC: f64 = 1.0;

/// Colours by class: `k0` to `k2` for the knobs in their order. The second set is for dark pages.
const STYLE: &str = "text{font:13px system-ui,sans-serif;fill:var(--ink)}.title{font-weight:600}\
    svg{--ink:#1b1f24;--page:#fff;--grid:#d8dee4;--k0:#0b62c4;--k1:#b3400a;--k2:#1a7f37}\
    @media(prefers-color-scheme:dark){svg{--ink:#e6edf3;--page:#0d1117;--grid:#30363d;--k0:#6cb6ff;--k1:#ffa657;\
    --k2:#7ee787}}\
    .page{fill:var(--page)}.worse{fill:var(--grid);opacity:.35}.grid{stroke:var(--grid)}.line{fill:none;stroke-width:2}.paper{fill:var(--ink)}\
    .k0{stroke:var(--k0)}.k1{stroke:var(--k1)}.k2{stroke:var(--k2)}circle{fill:var(--page);stroke-width:1.5}";
/// Dash patterns of the lines, by index of the resolution.
const DASHES: [&str; 4] = ["none", "7 4", "2 3", "9 3 2 3"];

/// Draws the plot of all rows.
pub(in crate::commands::evaluate) fn svg(rows: &[Row]) -> String {
    let resolutions = resolutions(rows);
    let panels = PANELS.iter().map(|panel| draw_panel(panel, rows, &resolutions));
    let legend = draw_legend(&resolutions, rows);
    let [panels, legend] = [panels.collect(), legend].map(|parts: Vec<String>| parts.concat());
    let paper: String = PAPER.iter().map(|&(panel, efc, percent)| draw_paper(&PANELS[panel], efc, percent)).collect();
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH_PX} {HEIGHT_PX}\" role=\"img\">\n\
         <title>com and fpc against the expected false candidates</title>\n<style>{STYLE}</style>\n\
         <rect class=\"page\" width=\"100%\" height=\"100%\"/>\n{panels}{paper}{legend}</svg>\n"
    )
}

/// Names of the resolutions, in the order in which they first appear.
fn resolutions(rows: &[Row]) -> Vec<&'static str> {
    let mut names = Vec::new();
    for row in rows {
        if !names.contains(&row.resolution) {
            names.push(row.resolution);
        }
    }
    names
}

fn draw_panel(panel: &Panel, rows: &[Row], resolutions: &[&str]) -> String {
    let series = resolutions.iter().enumerate().flat_map(|(i, name)| Knob::EFC_KNOBS.map(|knob| (i, *name, knob)));
    let drawn = series.map(|(i, name, knob)| {
        let rows = rows.iter().filter(|row| row.resolution == name && row.knob == knob);
        draw_series(panel, &rows.collect::<Vec<_>>(), knob, DASHES[i % DASHES.len()])
    });
    draw_frame(panel) + &drawn.collect::<String>()
}

/// Draws grid, numbers and titles of a panel.
fn draw_frame(panel: &Panel) -> String {
    let (top, bottom) = (panel.axis.from_px.min(panel.axis.to_px), panel.axis.from_px.max(panel.axis.to_px));
    let Axis { from_px: left, to_px: right, .. } = EFC;
    let across = panel.axis.ticks.iter().map(|&tick| {
        let y = panel.axis.position_px(tick);
        format!(
            "<path class=\"grid\" d=\"M{left} {y:.1}H{right}\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\n",
            left - 8.0,
            y + 4.0,
            (panel.label)(tick)
        )
    });
    let up = EFC.ticks.iter().map(|&tick| {
        let x = EFC.position_px(tick);
        format!(
            "<path class=\"grid\" d=\"M{x:.1} {bottom}V{top}\"/><text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{tick}</text>\n",
            bottom + 18.0
        )
    });
    let worse = EFC.position_px(PAPER_WORSE_EFC);
    format!(
        "<rect class=\"worse\" x=\"{worse:.1}\" y=\"{top}\" width=\"{:.1}\" height=\"{:.1}\"/>\
         {}{}<text class=\"title\" x=\"{left}\" y=\"{}\">{}</text><text x=\"{right}\" y=\"{}\" text-anchor=\"end\">efc by \
         Eq. (1); shaded: the paper expects worse</text>\n",
        right - worse,
        bottom - top,
        across.collect::<String>(),
        up.collect::<String>(),
        top - 14.0,
        panel.title,
        bottom + 36.0
    )
}

/// A measurement: the value of the knob, efc and the figure of the panel.
struct Point {
    value: f64,
    efc: f64,
    figure: f64,
}

/// Draws the points of a series and the line through their means.
fn draw_series(panel: &Panel, rows: &[&Row], knob: Knob, dash: &str) -> String {
    let class = class(knob);
    let (mut points, mut circles) = (Vec::new(), String::new());
    for row in rows {
        let (Some(rig), Some(figures)) = (&row.rig, &row.figures) else { continue };
        let point = Point { value: row.value, efc: rig.efc, figure: (panel.figure)(figures) };
        circles += &format!(
            "<circle class=\"{class}\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\"><title>{}, {} {}: efc {:.3}, {:.3} %</title></circle>\n",
            EFC.position_px(point.efc),
            panel.axis.position_px(point.figure),
            row.object,
            knob.name(),
            row.value,
            point.efc,
            (panel.label)(point.figure)
        );
        points.push(point);
    }
    let positions = means(&points)
        .into_iter()
        .map(|(efc, figure)| format!("{:.1},{:.1}", EFC.position_px(efc), panel.axis.position_px(figure)));
    let positions = positions.collect::<Vec<_>>().join(" ");
    format!("<polyline class=\"line {class}\" stroke-dasharray=\"{dash}\" points=\"{positions}\"/>\n{circles}")
}

/// Mean efc and figure over the objects at each value, sorted by efc.
fn means(points: &[Point]) -> Vec<(f64, f64)> {
    let mut values: Vec<f64> = points.iter().map(|p| p.value).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let mean_at = |value: f64| {
        let at_value: Vec<&Point> = points.iter().filter(|p| p.value == value).collect();
        let mean = |figure: fn(&Point) -> f64| at_value.iter().map(|&p| figure(p)).sum::<f64>() / at_value.len() as f64;
        (mean(|p| p.efc), mean(|p| p.figure))
    };
    let mut means: Vec<_> = values.into_iter().map(mean_at).collect();
    means.sort_by(|a, b| a.0.total_cmp(&b.0));
    means
}

/// Draws a statement of the paper as a labelled diamond.
fn draw_paper(panel: &Panel, efc: f64, percent: f64) -> String {
    let (x, y) = (EFC.position_px(efc), panel.axis.position_px(percent));
    format!(
        "<path class=\"paper\" d=\"M{:.1} {y:.1}l7 -7l7 7l-7 7z\"/><text x=\"{:.1}\" y=\"{:.1}\">paper</text>\n",
        x - 7.0,
        x + 10.0,
        y - 6.0
    )
}

fn draw_legend(resolutions: &[&str], rows: &[Row]) -> Vec<String> {
    let entry = |row: usize, stroke: &str, dash: &str, name: &str| {
        let y = 60.0 + 24.0 * row as f64;
        format!(
            "<path class=\"line\" {stroke} stroke-dasharray=\"{dash}\" d=\"M{LEGEND_X_PX} {y}h30\"/><text x=\"{}\" \
             y=\"{}\">{name}</text>\n",
            LEGEND_X_PX + 38.0,
            y + 4.0
        )
    };
    let knobs: Vec<Knob> =
        Knob::EFC_KNOBS.into_iter().filter(|&knob| rows.iter().any(|row| row.knob == knob)).collect();
    let count = knobs.len();
    let knobs = knobs
        .into_iter()
        .enumerate()
        .map(|(i, knob)| entry(i, &format!("style=\"stroke:var(--{})\"", class(knob)), "none", knob.title()));
    let resolutions = resolutions.iter().enumerate().map(|(i, name)| {
        let name = format!("resolution: {name}");
        entry(count + i, "style=\"stroke:var(--ink)\"", DASHES[i % DASHES.len()], &name)
    });
    let refused = rows.iter().filter(|row| row.figures.is_none()).count();
    let note = format!("<text x=\"{LEGEND_X_PX}\" y=\"340\">{refused} of {} not measured</text>\n", rows.len());
    knobs.chain(resolutions).chain([note]).collect()
}

/// Colour class of a knob.
fn class(knob: Knob) -> String {
    let index = Knob::EFC_KNOBS.iter().position(|&efc_knob| efc_knob == knob).unwrap_or_default();
    format!("k{index}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::evaluate::sweep::test_row;

    fn rows() -> Vec<Row> {
        let mut rows = vec![
            test_row(Knob::Depth, "elephant", 0.2, 0.02),
            test_row(Knob::Depth, "machine", 0.2, 0.04),
            test_row(Knob::Depth, "elephant", 2.0, 4.0),
            test_row(Knob::Sd, "elephant", 0.5, 0.0),
        ];
        rows[2].value = 50.0;
        rows.push(Row { resolution: "other", ..rows[0].clone() });
        rows.push(Row { figures: None, failure: Some("<&".to_owned()), ..rows[0].clone() });
        rows
    }

    #[test]
    fn every_measurement_is_a_point_and_every_series_a_line() {
        let svg = svg(&rows());
        assert_eq!(svg.matches("<circle").count(), 2 * 5);
        assert_eq!(svg.matches("<polyline").count(), 2 * 2 * Knob::EFC_KNOBS.len());
        assert_eq!(svg.matches(">paper</text>").count(), PAPER.len());
        assert!(svg.contains("1 of 6 not measured"), "{svg}");
        assert!(svg.contains("resolution: other") && !svg.contains("<script") && !svg.contains("NaN"));
    }

    #[test]
    fn a_line_connects_the_means_over_the_objects() {
        let point = |value, efc, figure| Point { value, efc, figure };
        let points = [point(8.0, 2.0, 5.0), point(16.0, 1.0, 3.0), point(16.0, 1.0, 1.0)];
        assert_eq!(means(&points), [(1.0, 2.0), (2.0, 5.0)]);
    }
}
