//! Tables of results: those of the paper beside ours.

use std::fmt::Write as _;

/// A row of Table 1: completeness of the method without Gray code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompletenessRow<'a> {
    /// The measured object, by its name in the paper.
    pub object: &'a str,
    /// Completeness, percent.
    pub com_percent: f64,
    /// Completeness error, percent.
    pub miss_percent: f64,
    /// False positive correspondences, percent.
    pub fpc_percent: f64,
    /// Number of reference points.
    pub points: u64,
}

/// A row of Table 2: images per sequence with 16, 8 and 4 phase steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SequenceRow {
    /// The method: CGC, EGC or PA.
    pub method: &'static str,
    /// Number of images for 16, 8 and 4 phase steps.
    pub images: [u64; 3],
}

/// Table 1 of the paper.
pub const PAPER_TABLE_1: [CompletenessRow<'static>; 7] = [
    row("Plane", 100.00, 0.00, 0.00, 6384),
    row("Prism", 99.96, 0.03, 0.02, 19307),
    row("Machine tool", 99.99, 0.01, 0.03, 28568),
    row("Set of teeth", 99.99, 0.01, 0.03, 70249),
    row("Plaster tooth", 100.00, 0.00, 0.13, 6769),
    row("Nose", 99.92, 0.06, 2.02, 22709),
    row("Elephant", 99.99, 0.01, 0.00, 11412),
];

/// Table 2 of the paper, with a Gray code of 7 images.
pub const PAPER_TABLE_2: [SequenceRow; 3] = [
    SequenceRow { method: "CGC", images: [46, 30, 22] },
    SequenceRow { method: "EGC", images: [23, 15, 11] },
    SequenceRow { method: "PA", images: [16, 8, 4] },
];

const fn row(
    object: &'static str,
    com_percent: f64,
    miss_percent: f64,
    fpc_percent: f64,
    points: u64,
) -> CompletenessRow<'static> {
    CompletenessRow { object, com_percent, miss_percent, fpc_percent, points }
}

/// Formats Table 1, ours beside that of the paper. Objects that the paper does not have come last.
#[must_use]
pub fn completeness_table(ours: &[CompletenessRow<'_>]) -> String {
    let mut text = format!("{:16}{:^34}  {:^34}\n", "", "paper", "ours");
    let head = format!("{:>8}{:>8}{:>8}{:>10}", "com %", "miss %", "fpc %", "points");
    let missing = || format!("{:>34}", "–");
    push_line(&mut text, "object", &head, &head);
    for theirs in &PAPER_TABLE_1 {
        let right = ours.iter().find(|o| o.object == theirs.object).map(figures);
        push_line(&mut text, theirs.object, &figures(theirs), &right.unwrap_or_else(missing));
    }
    let is_known = |o: &&CompletenessRow<'_>| PAPER_TABLE_1.iter().any(|p| p.object == o.object);
    for other in ours.iter().filter(|o| !is_known(o)) {
        push_line(&mut text, other.object, &missing(), &figures(other));
    }
    text
}

/// Formats Table 2, ours beside that of the paper.
#[must_use]
pub fn sequence_table(ours: &[SequenceRow]) -> String {
    let mut text = format!("{:16}{:^30}  {:^30}\n", "", "paper", "ours");
    let head = format!("{:>10}{:>10}{:>10}", "16-phase", "8-phase", "4-phase");
    push_line(&mut text, "images", &head, &head);
    for theirs in &PAPER_TABLE_2 {
        let right = ours.iter().find(|o| o.method == theirs.method).map(|o| counts(o.images));
        push_line(&mut text, theirs.method, &counts(theirs.images), &right.unwrap_or_else(|| format!("{:>30}", "–")));
    }
    text
}

fn figures(row: &CompletenessRow<'_>) -> String {
    format!("{:8.2}{:8.2}{:8.2}{:10}", row.com_percent, row.miss_percent, row.fpc_percent, row.points)
}

fn counts(images: [u64; 3]) -> String {
    images.iter().map(|n| format!("{n:10}")).collect()
}

fn push_line(text: &mut String, name: &str, left: &str, right: &str) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{name:16}{left}  {right}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ours_stand_beside_the_papers() {
        let ours = |object| row(object, 99.5, 0.25, 0.125, 1234);
        let text = completeness_table(&[ours("Nose"), ours("Bust")]);
        let line = |start: &str| text.lines().find(|l| l.starts_with(start)).unwrap().split_whitespace().collect();
        let nose: Vec<&str> = line("Nose");
        assert_eq!(nose, ["Nose", "99.92", "0.06", "2.02", "22709", "99.50", "0.25", "0.12", "1234"]);
        let plane: Vec<&str> = line("Plane");
        assert_eq!(plane, ["Plane", "100.00", "0.00", "0.00", "6384", "–"]);
        let bust: Vec<&str> = line("Bust");
        assert_eq!(bust, ["Bust", "–", "99.50", "0.25", "0.12", "1234"]);
        let widths: Vec<usize> = text.lines().map(|l| l.chars().count()).collect();
        assert!(widths.iter().all(|&w| w == widths[0]), "{text}");
    }

    #[test]
    fn sequence_lengths_stand_beside_the_papers() {
        let text = sequence_table(&[SequenceRow { method: "PA", images: [16, 8, 4] }]);
        let last: Vec<&str> = text.lines().last().unwrap().split_whitespace().collect();
        assert_eq!(last, ["PA", "16", "8", "4", "16", "8", "4"]);
    }
}
