//! The results as text.

use std::io::Write as _;

use crate::failure::Failure;

use super::results::{Figure, PointUse, Results};

/// Prints the results.
pub(super) fn print(results: &Results<'_>) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}: {}", results.input.display(), results.artefact)?;
    writeln!(out, "clouds    {}", clouds(results))?;
    writeln!(out, "points    {}", points(&results.points, results.measured))?;
    writeln!(out, "{:<8}{:>10}{:>10}{:>10}{:>10}{:>10}", "mm", "median", "worst", "repeats", "U (k=2)", "limit")?;
    for figure in &results.figures {
        let Figure { symbol, meaning, median_mm, worst_mm, .. } = figure;
        let rest = [figure.repeats_mm, figure.uncertainty_mm, figure.limit_mm].map(length);
        let verdict = match figure.within {
            Some(true) => "within",
            Some(false) => "OUTSIDE",
            None => "",
        };
        let [repeats, uncertainty, limit] = rest;
        let line = format!(
            "{symbol:<8}{median_mm:>10.4}{worst_mm:>10.4}{repeats:>10}{uncertainty:>10}{limit:>10}  {verdict:<8}{meaning}"
        );
        writeln!(out, "{line}")?;
    }
    if let Some(mm) = results.form_repeats_mm {
        writeln!(out, "the form repeats from cloud to cloud within {mm:.4} mm rms")?;
    }
    for cause in &results.causes {
        writeln!(out, "{}: {}", cause.cause, cause.text)?;
    }
    Ok(writeln!(out, "{}", verdict(results))?)
}

/// How many clouds were measured.
pub(super) fn clouds(results: &Results<'_>) -> String {
    let lost = results.lost.len();
    let rest = if lost == 0 { String::new() } else { format!("; in {lost} there is no cloud or no artefact") };
    format!("{} of {} measured{rest}", results.measured, results.clouds)
}

/// How many points were used, and how many left out.
pub(super) fn points(points: &PointUse, windows: usize) -> String {
    let PointUse { used, far, left_out_percent, allowed_percent, windows_beyond, without_coordinates, .. } = points;
    let mut text = format!(
        "{used} of {} used; {left_out_percent:.2} % left out (the standard allows {allowed_percent} %), {far} of them far \
         from the surface",
        points.points
    );
    if *windows_beyond > 0 {
        text += &format!(
            ". In {windows_beyond} of {windows} clouds more than allowed is far away: PF and F are no figures of the \
             standard there"
        );
    }
    if *without_coordinates > 0 {
        text += &format!("; {without_coordinates} points of the file have no coordinates");
    }
    text
}

/// The verdict in a sentence.
pub(super) fn verdict(results: &Results<'_>) -> &'static str {
    match results.within_limits {
        Some(true) => "within all limits",
        Some(false) => "outside the limits",
        None => "not judged: the artefact states no limits",
    }
}

/// A length in millimetres, or a dash.
pub(super) fn length(mm: Option<f64>) -> String {
    mm.map_or_else(|| "–".to_owned(), |mm| format!("{mm:.4}"))
}
