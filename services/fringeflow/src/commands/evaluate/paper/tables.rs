//! The tables of the experiment: those of the paper, measured, and all figures.

use fringeflow::correspondence::Outcome;
use fringeflow_lab::evaluation::Scores;
use fringeflow_lab::paper_experiment::{Figures, STEPS, Spread, Way};

use super::Experiment;
use super::published::{CompletenessRow, TABLE_1, TABLE_2};
use super::summary::{Group, groups};
use super::table::Table;

/// A reference: its name, and the scores against it.
type Reference = (&'static str, fn(&Figures) -> &Scores);
/// The two references.
const REFERENCES: [Reference; 2] = [("RD by EGC", |figures| &figures.rd), ("exact truth", |figures| &figures.truth)];
/// What stands for a missing figure.
const MISSING: &str = "–";

/// All tables.
pub(super) fn tables(experiment: &Experiment) -> Vec<Table> {
    let groups = groups(&experiment.measurements);
    vec![table_1(&groups), table_2(&groups), all_scores(&groups), missed(&groups), candidates(&groups)]
}

/// Table 1: completeness with 16 steps.
fn table_1(groups: &[Group<'_>]) -> Table {
    let of_object = |paper: &CompletenessRow| {
        let published = vec![
            paper.title.to_owned(),
            "the paper".to_owned(),
            "RD by EGC".to_owned(),
            format!("{:.2}", paper.com_percent),
            format!("{:.2}", paper.miss_percent),
            format!("{:.2}", paper.fpc_percent),
            paper.points.to_string(),
        ];
        let ours = groups.iter().filter(|group| {
            group.object == paper.object && group.steps == STEPS[0] && group.way.resolution().is_some()
        });
        let ours = ours.flat_map(|group| REFERENCES.map(|reference| measured_row(group, paper.title, reference)));
        [published].into_iter().chain(ours).collect::<Vec<_>>()
    };
    Table {
        title: "Table 1: completeness with 16 steps".to_owned(),
        note: "RD are the correspondences that EGC finds in the same images, in the volume and with a back-projection \
               residual of at most 0.15 rad. The exact truth also judges the pixels on silhouettes, which see two \
               surfaces."
            .to_owned(),
        head: vec!["object", "way", "reference", "com %", "miss %", "fpc %", "points of the reference"],
        rows: TABLE_1.iter().flat_map(of_object).collect(),
    }
}

fn measured_row(group: &Group<'_>, title: &str, (reference, scores): Reference) -> Vec<String> {
    let percent = |figure: fn(&Scores) -> f64| with_spread(group.spread(|figures| figure(scores(figures))), 3);
    let points = group.spread(|figures| scores(figures).reference as f64);
    vec![
        title.to_owned(),
        group.way.title().to_owned(),
        reference.to_owned(),
        percent(|s| s.com_percent),
        percent(|s| s.miss_percent),
        percent(|s| s.fpc_percent),
        points.map_or_else(|| MISSING.to_owned(), |points| format!("{:.0}", points.mean)),
    ]
}

/// Table 2: images of a sequence, counted as they were read.
fn table_2(groups: &[Group<'_>]) -> Table {
    let counted = |way: Way| {
        STEPS.map(|steps| {
            let mut counts = groups.iter().filter(|g| g.way == way && g.steps == steps).map(Group::images);
            let first = counts.next().flatten();
            first.filter(|_| counts.all(|count| count == first))
        })
    };
    let row = |name: &str, counts: [Option<u64>; 3]| {
        let counts = counts.map(|count| count.map_or_else(|| MISSING.to_owned(), |count| count.to_string()));
        [name.to_owned()].into_iter().chain(counts).collect::<Vec<_>>()
    };
    let published = TABLE_2.map(|(name, counts)| row(&format!("{name}, the paper"), counts.map(Some)));
    let measured = [Way::Cgc, Way::Egc, Way::PaPaper, Way::PaProduct].map(|way| row(way.title(), counted(way)));
    Table {
        title: "Table 2: images of a sequence".to_owned(),
        note: "Images of each camera that the reader of the dataset counted.".to_owned(),
        head: vec!["way", "16 steps", "8 steps", "4 steps"],
        rows: published.into_iter().chain(measured).collect(),
    }
}

/// com, miss and fpc of every way with every number of steps.
fn all_scores(groups: &[Group<'_>]) -> Table {
    let row = |group: &Group<'_>| {
        let percent = |(_, scores): Reference, figure: fn(&Scores) -> f64| {
            with_spread(group.spread(|figures| figure(scores(figures))), 3)
        };
        let [rd, truth] = REFERENCES;
        vec![
            group.object.to_owned(),
            group.steps.to_string(),
            group.way.title().to_owned(),
            percent(rd, |s| s.com_percent),
            percent(rd, |s| s.miss_percent),
            percent(rd, |s| s.fpc_percent),
            percent(truth, |s| s.com_percent),
            percent(truth, |s| s.interior_percent.unwrap_or(f64::NAN)),
            percent(truth, |s| s.miss_percent),
            percent(truth, |s| s.fpc_percent),
            with_spread(group.spread(|figures| 1e3 * scores_rms(&figures.truth)), 4),
            with_spread(group.spread(|figures| figures.seconds), 2),
        ]
    };
    Table {
        title: "All steps and ways".to_owned(),
        note: "Interior: pixels whose neighbours in 5 × 5 pixels are references too. Seconds: from the files of the \
               images to the cloud."
            .to_owned(),
        head: vec![
            "object",
            "steps",
            "way",
            "com % (RD)",
            "miss % (RD)",
            "fpc % (RD)",
            "com % (truth)",
            "interior % (truth)",
            "miss % (truth)",
            "fpc % (truth)",
            "rms error, mm",
            "seconds",
        ],
        rows: groups.iter().map(row).collect(),
    }
}

/// Why points of RD are missed by the proposed algorithm.
fn missed(groups: &[Group<'_>]) -> Table {
    let outcomes = [
        Outcome::Invalid,
        Outcome::OutsideVolume,
        Outcome::NoCandidate,
        Outcome::RejectedByDelta,
        Outcome::Ambiguous,
        Outcome::Contradicted,
    ];
    let row = |group: &Group<'_>| {
        let share = |outcome: Outcome| {
            let percent = group.spread(|figures| {
                let missed = figures.missed.get(outcome.name()).copied().unwrap_or_default();
                100.0 * missed as f64 / figures.rd.reference as f64
            });
            with_spread(percent, 3)
        };
        let scene = [group.object.to_owned(), group.steps.to_string(), group.way.title().to_owned()];
        scene.into_iter().chain(outcomes.map(share)).collect::<Vec<_>>()
    };
    Table {
        title: "Why points of RD are missed".to_owned(),
        note: "Percent of RD by the outcome of the pixel.".to_owned(),
        head: vec![
            "object",
            "steps",
            "way",
            "no phase",
            "outside the volume",
            "no candidate",
            "rejected by δ",
            "ambiguous",
            "contradicted",
        ],
        rows: groups.iter().filter(|group| group.way.resolution().is_some()).map(row).collect(),
    }
}

/// Root mean square 3D error, metres.
fn scores_rms(scores: &Scores) -> f64 {
    scores.rms_m.unwrap_or(f64::NAN)
}

/// n, sd, efc and puc of the proposed algorithm.
fn candidates(groups: &[Group<'_>]) -> Table {
    let row = |group: &Group<'_>| {
        vec![
            group.object.to_owned(),
            group.steps.to_string(),
            group.way.title().to_owned(),
            with_spread(group.delta(|delta| delta.mean_periods), 2),
            with_spread(group.delta(|delta| delta.sd_rad), 4),
            with_spread(group.delta(|delta| delta.efc_predicted), 3),
            with_spread(group.delta(|delta| delta.efc_measured), 3),
            with_spread(group.delta(|delta| delta.puc_predicted), 2),
            with_spread(group.delta(|delta| delta.puc_measured), 2),
        ]
    };
    Table {
        title: "Candidates".to_owned(),
        note: "n: periods on a segment. sd: standard deviation of δ, for the product's way about the drift of the \
               calibration. efc: false candidates for each true one, by Eq. (1) and counted. puc: percentage of unique \
               correspondences, 100·(1 − efc) and counted."
            .to_owned(),
        head: vec!["object", "steps", "way", "n", "sd, rad", "efc by Eq. (1)", "efc", "puc predicted %", "puc %"],
        rows: groups.iter().filter(|group| group.way.resolution().is_some()).map(row).collect(),
    }
}

fn with_spread(spread: Option<Spread>, digits: usize) -> String {
    match spread {
        Some(Spread { mean, sd }) if mean.is_finite() => format!("{mean:.digits$} ± {sd:.digits$}"),
        _ => MISSING.to_owned(),
    }
}
