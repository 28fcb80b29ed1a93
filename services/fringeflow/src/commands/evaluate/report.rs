//! Prints the figures of an evaluation as text or JSON.

use std::io::Write as _;

use serde::Serialize;

use fringeflow_lab::evaluation::{Evaluation, Judgement, ReliabilityPart, Scores, reliability};

use crate::failure::Failure;
use crate::method::{Method, MethodOutput};
use crate::proposed::ProposedOutput;
use crate::statistics::Statistics;

use super::{Against, Args};

#[derive(Serialize)]
struct Report<'a> {
    set: &'a str,
    method: Method,
    against: Against,
    #[serde(flatten)]
    scores: &'a Scores,
    #[serde(flatten)]
    unique: Unique,
    /// Stated confidence and share of true points, in ten equal parts of the points.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    reliability: Vec<ReliabilityPart>,
    #[serde(flatten)]
    statistics: Option<Statistics>,
}

/// Correctness of the points, among them the unique ones: those whose pixel had a single candidate.
#[derive(Clone, Copy, Serialize)]
struct Unique {
    /// Correct points among the unique points that can be judged, percent; `None` without any.
    unique_correct_percent: Option<f64>,
    /// Standard deviation of δ over the correct points, rad; `None` without any.
    correct_delta_sd_rad: Option<f64>,
}

/// Prints the figures to standard output.
pub(super) fn print(set: &str, args: &Args, output: &MethodOutput, evaluation: &Evaluation) -> Result<(), Failure> {
    let statistics = output.proposed.as_ref().map(Statistics::new);
    let unique = unique(output, &evaluation.judgements);
    let reliability_parts = |ProposedOutput { reconstruction, .. }: &ProposedOutput| {
        reliability(&reconstruction.cloud, &evaluation.judgements, reconstruction.cam1.width)
    };
    let reliability = output.proposed.as_ref().map_or_else(Vec::new, reliability_parts);
    let scores = &evaluation.scores;
    let mut out = std::io::stdout().lock();
    if args.json {
        let report =
            Report { set, method: args.method, against: args.against, scores, unique, reliability, statistics };
        serde_json::to_writer(&mut out, &report).map_err(std::io::Error::from)?;
        return Ok(writeln!(out)?);
    }
    for warning in statistics.iter().flat_map(Statistics::warnings) {
        writeln!(out, "{warning}")?;
    }
    let note = statistics.as_ref().and_then(Statistics::outside_note).unwrap_or_default();
    writeln!(out, "{}", text(set, scores, &note))?;
    if let (Some(right), Some(sd)) = (unique.unique_correct_percent, unique.correct_delta_sd_rad) {
        writeln!(
            out,
            "{right:.2} % of the points with one candidate are right; sd of δ of the right points {sd:.4} rad"
        )?;
    }
    if let Some(line) = reliability_line(&reliability) {
        writeln!(out, "{line}")?;
    }
    if let Some(statistics) = statistics {
        write!(out, "{statistics}")?;
    }
    Ok(())
}

fn unique(output: &MethodOutput, judgements: &[Judgement]) -> Unique {
    let Some(ProposedOutput { reconstruction, .. }) = &output.proposed else {
        return Unique { unique_correct_percent: None, correct_delta_sd_rad: None };
    };
    let (mut right, mut judged) = (0_u64, 0_u64);
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for point in &output.cloud.points {
        let pixel = usize::from(point.cam1_px[1]) * reconstruction.cam1.width + usize::from(point.cam1_px[0]);
        let correct = judgements[pixel] == Judgement::Correct;
        let false_positive = matches!(judgements[pixel], Judgement::Wrong | Judgement::Stray);
        if point.candidates == 1 {
            right += u64::from(correct);
            judged += u64::from(correct || false_positive);
        }
        if correct {
            let delta = f64::from(point.delta_rad);
            count += 1.0;
            sum += delta;
            squares += delta * delta;
        }
    }
    Unique {
        unique_correct_percent: (judged > 0).then(|| 100.0 * right as f64 / judged as f64),
        correct_delta_sd_rad: (count > 0.0).then(|| (squares / count - (sum / count) * (sum / count)).max(0.0).sqrt()),
    }
}

/// Stated and true confidence of all points and of the least confident tenth; `None` if no confidence is stated.
fn reliability_line(parts: &[ReliabilityPart]) -> Option<String> {
    let lowest = parts.first()?;
    let mean = |percent: fn(&ReliabilityPart) -> f64| parts.iter().map(percent).sum::<f64>() / parts.len() as f64;
    let off = parts.iter().map(|part| (part.stated_percent - part.true_percent).abs()).fold(0.0, f64::max);
    Some(format!(
        "confidence {:.3} % stated, {:.3} % true; least confident tenth {:.2} % stated, {:.2} % true; no tenth is \
         off by more than {off:.2} percentage points",
        mean(|part| part.stated_percent),
        mean(|part| part.true_percent),
        lowest.stated_percent,
        lowest.true_percent,
    ))
}

/// The scores. `note` is what the first line adds.
fn text(set: &str, s: &Scores, note: &str) -> String {
    let outliers = s.outliers_percent.map(|o| format!("\noutliers    {o:9.4} %")).unwrap_or_default();
    let interior = s.interior_percent.map(|i| format!("\ninterior    {i:9.4} %")).unwrap_or_default();
    let millimetres = |metres: Option<f64>| metres.map_or_else(|| "–".to_owned(), |m| format!("{:.4} mm", m * 1e3));
    format!(
        "{set}: {} points, {} reference correspondences, {} unjudged points{note}\n\
         com         {:9.4} %{interior}\nmiss        {:9.4} %\nfpc         {:9.4} %  (wrong {:.4} %, stray {:.4} %)\
         {outliers}\n\
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
