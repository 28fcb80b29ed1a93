//! Summaries of the figures of groups of scenes.

use serde::Serialize;

use super::Row;

/// Largest fpc of a good scene, percent.
const GOOD_FPC_PERCENT: f64 = 0.2;

/// Figures of a group of scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Summary {
    pub(super) name: &'static str,
    /// Scenes that were measured.
    pub(super) scenes: usize,
    /// Scenes that failed.
    pub(super) failed: usize,
    pub(super) com_percent: Ends,
    pub(super) interior_percent: Ends,
    pub(super) fpc_percent: Ends,
    /// Share of the measured scenes with an fpc of 0.2 % at most, percent.
    pub(super) good_percent: f64,
    /// com of the paper's method; a scene in which it finds nothing counts as 0.
    pub(super) paper_com_percent: Ends,
}

/// Median and worst value; NaN, or `null` in JSON, without any.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Ends {
    pub(super) median: f64,
    pub(super) worst: f64,
}

impl Ends {
    /// Of values of which small ones are bad.
    fn of_shares(values: impl Iterator<Item = f64>) -> Self {
        let values = sorted(values);
        Self { median: median(&values), worst: values.first().copied().unwrap_or(f64::NAN) }
    }

    /// Of values of which large ones are bad.
    fn of_errors(values: impl Iterator<Item = f64>) -> Self {
        let values = sorted(values);
        Self { median: median(&values), worst: values.last().copied().unwrap_or(f64::NAN) }
    }
}

impl Summary {
    pub(super) fn new<'a>(name: &'static str, rows: impl Iterator<Item = &'a Row> + Clone) -> Self {
        let figures = rows.clone().filter_map(|row| row.figures);
        let scenes = figures.clone().count();
        let fpc = figures.clone().map(|f| f.scores.fpc_percent);
        let good = fpc.clone().filter(|&percent| percent <= GOOD_FPC_PERCENT).count();
        Self {
            name,
            scenes,
            failed: rows.count() - scenes,
            com_percent: Ends::of_shares(figures.clone().map(|f| f.scores.com_percent)),
            interior_percent: Ends::of_shares(figures.clone().filter_map(|f| f.scores.interior_percent)),
            fpc_percent: Ends::of_errors(fpc),
            good_percent: 100.0 * good as f64 / scenes as f64,
            paper_com_percent: Ends::of_shares(figures.map(|f| f.paper.map_or(0.0, |scores| scores.com_percent))),
        }
    }
}

/// Summaries of the groups that have scenes, in the order of `names`.
pub(super) fn summaries<const N: usize>(
    rows: &[Row],
    names: [&'static str; N],
    group: fn(&Row) -> &'static str,
) -> Vec<Summary> {
    let summaries = names.into_iter().map(|name| Summary::new(name, rows.iter().filter(move |row| group(row) == name)));
    summaries.filter(|summary| summary.scenes + summary.failed > 0).collect()
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    values
}

/// Median of sorted values; for an even count, the mean of the two middle ones.
fn median(sorted: &[f64]) -> f64 {
    match sorted.len() {
        0 => f64::NAN,
        count => (sorted[count / 2] + sorted[(count - 1) / 2]) / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::evaluate::scenes::test_row;

    #[test]
    fn a_group_has_its_median_its_worst_and_its_share_of_good_scenes() {
        let failed = Row { figures: None, failure: Some("no δ".to_owned()), ..test_row(3, "dim", 0.0, 0.0) };
        let rows =
            [test_row(0, "plain", 99.0, 0.0), test_row(1, "dim", 90.0, 0.2), test_row(2, "dim", 98.0, 0.5), failed];
        let groups = summaries(&rows, ["plain", "dim", "moving"], |row| row.kind);
        let [plain, dim] = &groups[..] else { panic!("{groups:?}") };
        assert_eq!((plain.scenes, plain.failed, plain.good_percent), (1, 0, 100.0));
        assert_eq!((dim.scenes, dim.failed, dim.good_percent), (2, 1, 50.0));
        assert_eq!(dim.com_percent, Ends { median: 94.0, worst: 90.0 });
        assert_eq!(dim.fpc_percent, Ends { median: 0.35, worst: 0.5 });
        assert_eq!(dim.paper_com_percent, Ends { median: 93.0, worst: 89.0 });
    }
}
