//! Pictures of the results as SVG: the deviation over an artefact, and a figure over the windows.

use fringeflow_lab::artefact::Cell;
use fringeflow_lab::preview::diverging;

/// Widest and highest map, pixels of the page.
const MAP_PX: [f64; 2] = [520.0, 380.0];
/// Share of the cells whose deviation the colours reach at least.
const SHOWN_SHARE: f64 = 0.98;
/// Size of a plot, and the place of its axes.
const PLOT_PX: [f64; 2] = [520.0, 150.0];
const LEFT_PX: f64 = 64.0;
const BOTTOM_PX: f64 = 24.0;

/// Draws the mean deviation of each cell: red towards the scanner (of a ball: outwards), blue away from it. The colours
/// have the scale of the cells of `all` pictures beside each other.
pub(super) fn map(cells: &[Cell], all: &[Cell], title: &str) -> String {
    let bound = |axis: usize| {
        let values = || cells.iter().map(|cell| cell.at[axis]);
        (values().min().unwrap_or_default(), values().max().unwrap_or_default())
    };
    let [(left, right), (top, bottom)] = [bound(0), bound(1)];
    let [columns, rows] = [right - left + 1, bottom - top + 1].map(|count| count as f64);
    let size = (MAP_PX[0] / columns).min(MAP_PX[1] / rows);
    let span_um = span_um(all);
    let mut rects = String::new();
    for cell in cells {
        let um = cell.mean_m * 1e6;
        let [r, g, b] = diverging((um / span_um) as f32);
        let [x, y] = [cell.at[0] - left, cell.at[1] - top].map(|index| index as f64 * size);
        rects += &format!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{0:.1}\" height=\"{0:.1}\" fill=\"rgb({r} {g} {b})\"><title>{um:+.1} \
             µm, noise {1:.1} µm</title></rect>",
            size + 0.3,
            cell.sd_m * 1e6
        );
    }
    let (width, height) = (columns * size, rows * size);
    format!(
        "<svg viewBox=\"0 0 {MAX} {:.0}\" role=\"img\" aria-label=\"{title}\"><g transform=\"translate({:.1} 0)\">{rects}</g>{}\
         </svg>\n",
        height + 40.0,
        (MAP_PX[0] - width) / 2.0,
        scale(span_um, height + 10.0),
        MAX = MAP_PX[0],
    )
}

/// The deviation at the end of the colours, micrometres: a round number.
fn span_um(cells: &[Cell]) -> f64 {
    let mut sizes: Vec<f64> = cells.iter().map(|cell| (cell.mean_m * 1e6).abs()).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    let wanted = sizes.get((SHOWN_SHARE * sizes.len() as f64) as usize).or(sizes.last()).copied().unwrap_or_default();
    rounded_up(wanted.max(1e-3))
}

/// The next 1, 2 or 5 times a power of ten.
fn rounded_up(value: f64) -> f64 {
    let power = 10_f64.powf(value.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].into_iter().map(|step| step * power);
    steps.into_iter().find(|step| *step >= value * (1.0 - 1e-9)).unwrap_or(10.0 * power)
}

fn scale(span_um: f64, y: f64) -> String {
    const STEPS: i32 = 40;
    let (left, step) = (MAP_PX[0] / 2.0 - 100.0, 200.0 / f64::from(2 * STEPS + 1));
    let bars: String = (-STEPS..=STEPS)
        .map(|i| {
            let [r, g, b] = diverging(i as f32 / STEPS as f32);
            let x = left + f64::from(i + STEPS) * step;
            format!(
                "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"10\" fill=\"rgb({r} {g} {b})\"/>",
                step + 0.3
            )
        })
        .collect();
    let text = |x: f64, label: String| {
        format!("<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>", y + 24.0)
    };
    let labels = text(left, format!("−{span_um} µm")) + &text(MAP_PX[0] / 2.0, "0".into());
    bars + &labels + &text(left + 200.0, format!("+{span_um} µm"))
}

/// Draws a figure over the windows, with its limit on both sides.
pub(super) fn plot(values_mm: &[f64], limit_mm: Option<f64>, title: &str) -> String {
    let [width, height] = PLOT_PX;
    let drawn_limit =
        limit_mm.into_iter().flat_map(|limit| [limit, if values_mm.iter().any(|v| *v < 0.0) { -limit } else { 0.0 }]);
    let all = values_mm.iter().copied().chain(drawn_limit.clone()).chain([0.0]);
    let (low, high) = all.fold((0.0_f64, f64::MIN_POSITIVE), |(low, high), value| (low.min(value), high.max(value)));
    let x = |i: usize| LEFT_PX + (width - LEFT_PX - 8.0) * (i as f64 + 0.5) / values_mm.len().max(1) as f64;
    let y = |mm: f64| height - BOTTOM_PX - (height - BOTTOM_PX - 10.0) * (mm - low) / (high - low);
    let line = |mm: f64, class: &str| {
        format!(
            "<path class=\"{class}\" d=\"M{LEFT_PX} {0:.1}H{width}\"/><text x=\"{1}\" y=\"{2:.1}\" text-anchor=\"end\">{mm:.4}\
             </text>",
            y(mm),
            LEFT_PX - 6.0,
            y(mm) + 4.0
        )
    };
    let end = if low < -high { low } else { high };
    let frame = line(0.0, "axis") + &if limit_mm.is_none() { line(end, "axis") } else { String::new() };
    let limits: String = drawn_limit.filter(|limit| *limit != 0.0).map(|limit| line(limit, "limit")).collect();
    let points: Vec<String> =
        values_mm.iter().enumerate().map(|(i, mm)| format!("{:.1} {:.1}", x(i), y(*mm))).collect();
    let dots: String = values_mm
        .iter()
        .enumerate()
        .map(|(i, mm)| {
            format!("<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\"><title>{mm:.4} mm</title></circle>", x(i), y(*mm))
        })
        .collect();
    format!(
        "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{title}\">{frame}{limits}<path class=\"line\" \
         d=\"M{}\"/>{dots}<text x=\"{width}\" y=\"{:.1}\" text-anchor=\"end\">clouds</text></svg>\n",
        points.join("L"),
        height - 4.0
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_end_at_round_numbers() {
        assert_eq!([0.9, 1.0, 1.2, 4.0, 51.0].map(rounded_up), [1.0, 1.0, 2.0, 5.0, 100.0]);
    }

    #[test]
    fn a_map_has_a_rectangle_for_each_cell_and_a_plot_a_dot_for_each_window() {
        let cell = |x, y, um: f64| Cell { at: [x, y], points: 64, mean_m: um * 1e-6, sd_m: 1e-6 };
        let cells = [cell(-1, 5, 3.0), cell(2, 6, -4.0)];
        let drawn = map(&cells, &cells, "form");
        assert!(drawn.contains("<title>+3.0 µm, noise 1.0 µm</title>") && drawn.contains("−5 µm"), "{drawn}");
        let drawn = plot(&[0.01, -0.02], Some(0.03), "SD");
        assert_eq!((drawn.matches("<circle").count(), drawn.matches("class=\"limit\"").count()), (2, 2));
        assert!(!drawn.contains("NaN") && !plot(&[0.0], None, "PF").contains("NaN"));
    }
}
