//! The figures of an evaluation as text or JSON.

use std::io::Write as _;

use fringeflow::evaluation::Scores;
use serde::Serialize;

use super::{Against, Method};
use crate::failure::Failure;

#[derive(Serialize)]
struct Report<'a> {
    set: &'a str,
    method: Method,
    against: Against,
    #[serde(flatten)]
    scores: &'a Scores,
}

/// Prints the figures to standard output.
pub(super) fn print(set: &str, method: Method, against: Against, scores: &Scores, json: bool) -> Result<(), Failure> {
    let text = if json {
        serde_json::to_string(&Report { set, method, against, scores }).map_err(std::io::Error::from)?
    } else {
        text(set, scores)
    };
    Ok(writeln!(std::io::stdout().lock(), "{text}")?)
}

fn text(set: &str, s: &Scores) -> String {
    let outliers = s.outliers_percent.map(|o| format!("\noutliers    {o:9.4} %")).unwrap_or_default();
    let millimetres = |metres: Option<f64>| metres.map_or_else(|| "–".to_owned(), |m| format!("{:.4} mm", m * 1e3));
    format!(
        "{set}: {} points, {} reference correspondences, {} unjudged points\n\
         com         {:9.4} %\nmiss        {:9.4} %\nfpc         {:9.4} %  (wrong {:.4} %, stray {:.4} %){outliers}\n\
         3D error    rms {}, median {}",
        s.points,
        s.reference,
        s.unjudged,
        s.com_percent,
        s.miss_percent,
        s.fpc_percent,
        s.wrong_percent,
        s.stray_percent,
        millimetres(s.rms_m),
        millimetres(s.median_m),
    )
}
