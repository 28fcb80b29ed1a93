//! The page of a field check: one HTML file without scripts, in the style of the dashboard.

use std::io::{self, Write};

use fringeflow_lab::artefact::{BallFigures, Cell, Measurement, merged};

use crate::report::{COMMON_STYLE, FRAME_STYLE, escaped};

use super::picture::{map, plot};
use super::results::{Figure, Results, Window, WindowLine, all_cells};
use super::text::{clouds, length, points, verdict};

const STYLE: &str = include_str!("page.css");

/// Writes the page.
pub(super) fn write(out: &mut impl Write, results: &Results<'_>, windows: &[Window]) -> io::Result<()> {
    let level = match results.within_limits {
        Some(true) => "ok",
        Some(false) => "error",
        None => "idle",
    };
    let (input, artefact) = (escaped(&results.input.display().to_string()), escaped(&results.artefact));
    write!(
        out,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <title>Fringeflow: field check</title>\n<style>\n{COMMON_STYLE}\n{FRAME_STYLE}\n{STYLE}</style>\n</head>\n<body>\n\
         <header class=\"top\"><h1><span class=\"brand-name\">Fringeflow</span> field check</h1>\
         <span class=\"pill\" data-level=\"{level}\">{}</span></header>\n<main>\n\
         <dl class=\"about panel\"><div><dt>Input</dt><dd>{input}</dd></div><div><dt>Artefact</dt><dd>{artefact}</dd></div>\
         <div><dt>Clouds</dt><dd>{}</dd></div><div><dt>Points</dt><dd>{}</dd></div></dl>\n<div class=\"grid\">\n",
        escaped(verdict(results)),
        escaped(&clouds(results)),
        escaped(&points(&results.points, results.measured)),
    )?;
    out.write_all(figures(results).as_bytes())?;
    out.write_all(causes(results).as_bytes())?;
    out.write_all(maps(windows).as_bytes())?;
    if windows.len() > 1 {
        out.write_all(plots(results).as_bytes())?;
    }
    out.write_all(table_of_windows(results).as_bytes())?;
    let version = env!("CARGO_PKG_VERSION");
    write!(
        out,
        "</div>\n</main>\n<footer class=\"foot\">Fringeflow {version}, after VDI/VDE 2634 parts 2 and 3</footer>\n</body>\n</html>\n"
    )
}

fn figures(results: &Results<'_>) -> String {
    let row = |figure: &Figure| {
        let Figure { symbol, meaning, median_mm, worst_mm, .. } = figure;
        let [repeats, uncertainty, limit] = [figure.repeats_mm, figure.uncertainty_mm, figure.limit_mm].map(length);
        let judged = match figure.within {
            Some(true) => "<span class=\"badge\" data-level=\"ok\">within</span>",
            Some(false) => "<span class=\"badge\" data-level=\"error\">outside</span>",
            None => "",
        };
        let numbers = [
            ("Median", format!("{median_mm:.4}")),
            ("Worst", format!("{worst_mm:.4}")),
            ("Repeats", repeats),
            ("U (k = 2)", uncertainty),
            ("Limit", limit),
        ];
        let numbers =
            numbers.map(|(title, text)| format!("<td class=\"number\" data-title=\"{title}\">{text}</td>")).concat();
        format!("<tr><th>{symbol}<span class=\"meaning\">{meaning}</span></th>{numbers}<td>{judged}</td></tr>\n")
    };
    let rows: String = results.figures.iter().map(row).collect();
    let form = results.form_repeats_mm.map_or_else(String::new, |mm| {
        format!("<p class=\"summary\">The form repeats from cloud to cloud within {mm:.4} mm rms.</p>")
    });
    format!(
        "<section class=\"panel wide\"><h2>Figures, mm</h2><div class=\"table-scroll\"><table><thead><tr><th></th>\
         <th class=\"number\">Median</th><th class=\"number\">Worst</th><th class=\"number\">Repeats</th>\
         <th class=\"number\">U (k = 2)</th><th class=\"number\">Limit</th><th></th></tr></thead><tbody>\n{rows}</tbody>\
         </table></div>{form}</section>\n"
    )
}

fn causes(results: &Results<'_>) -> String {
    let line = |cause: &super::explanation::Explanation| {
        format!("<li><b>{}</b>: {}</li>\n", escaped(cause.cause), escaped(&cause.text))
    };
    let lines: String = results.causes.iter().map(line).collect();
    let text = if lines.is_empty() {
        "<p class=\"summary\">The data show no cause beyond their noise.</p>".to_owned()
    } else {
        format!("<ul class=\"causes\">{lines}</ul>")
    };
    format!("<section class=\"panel wide\"><h2>What the deviations hint at</h2>{text}</section>\n")
}

/// The form of a plate or of each ball in the window in the middle, and that of a plate over all windows.
fn maps(windows: &[Window]) -> String {
    let Some(middle) = windows.get(windows.len() / 2) else { return String::new() };
    let panel = |title: &str, svg: String| {
        let colours = "Red: towards the scanner, or out of the ball. Blue: away from it, or into the ball.";
        format!("<section class=\"panel half\"><h2>{title}</h2><p class=\"summary\">{colours}</p>{svg}</section>\n")
    };
    match &middle.measurement {
        Measurement::Plane(flat) => {
            let all = merged(all_cells(windows));
            let one = format!("Form of the plate as the scanner sees it, cloud {}", middle.number);
            let first = panel(&one, map(&flat.surface.cells.cells, &all, &one));
            let title = format!("The same, mean of {} clouds", windows.len());
            if windows.len() > 1 { first + &panel(&title, map(&all, &all, &title)) } else { first }
        }
        Measurement::Balls { balls, .. } => {
            let all: Vec<Cell> = balls.iter().flat_map(|ball| ball.surface.cells.cells.iter().copied()).collect();
            let draw = |(i, ball): (usize, &BallFigures)| {
                let title = format!("Form of ball {} as the scanner sees it, cloud {}", i + 1, middle.number);
                panel(&title, map(&ball.surface.cells.cells, &all, &title))
            };
            balls.iter().enumerate().map(draw).collect()
        }
    }
}

fn plots(results: &Results<'_>) -> String {
    let plot = |(i, figure): (usize, &Figure)| {
        let values: Vec<f64> = results.windows.iter().filter_map(|window| window.worst_mm.get(i)).copied().collect();
        let title = format!("{} from cloud to cloud, mm", figure.symbol);
        format!("<section class=\"panel half\"><h2>{title}</h2>{}</section>\n", plot(&values, figure.limit_mm, &title))
    };
    results.figures.iter().enumerate().map(plot).collect()
}

fn table_of_windows(results: &Results<'_>) -> String {
    let cell = |title: &str, text: String| format!("<td class=\"number\" data-title=\"{title}\">{text}</td>");
    let row = |window: &WindowLine| {
        let time = window.time_s.map_or_else(String::new, |s| format!("{s:.3}"));
        let [x, y, z] = window.middle_mm;
        let values: String =
            results.figures.iter().zip(&window.worst_mm).map(|(f, mm)| cell(f.symbol, format!("{mm:.4}"))).collect();
        format!(
            "<tr><th>{}</th>{}{}{values}{}{}</tr>\n",
            window.number,
            cell("time, s", time),
            cell("middle, mm", format!("{x:.1}, {y:.1}, {z:.1}")),
            cell("points", window.points.to_string()),
            cell("left out, %", format!("{:.2}", window.left_out_percent)),
        )
    };
    let lost = |lost: &super::results::Lost| {
        let columns = results.figures.len() + 4;
        format!(
            "<tr><th>{}</th><td colspan=\"{columns}\">not measured: {}</td></tr>\n",
            lost.number,
            escaped(&lost.why)
        )
    };
    let head: String = results.figures.iter().map(|f| format!("<th class=\"number\">{}</th>", f.symbol)).collect();
    let rows: String = results.windows.iter().map(row).chain(results.lost.iter().map(lost)).collect();
    format!(
        "<section class=\"panel wide\"><h2>Clouds</h2><p class=\"summary\">Worst value of each figure, mm.</p>\
         <div class=\"table-scroll\"><table><thead><tr><th>Cloud</th><th class=\"number\">Time, s</th>\
         <th class=\"number\">Middle, mm</th>{head}<th class=\"number\">Points</th><th class=\"number\">Left out, %</th></tr>\
         </thead><tbody>\n{rows}</tbody></table></div></section>\n"
    )
}
