//! `fringeflow evaluate --scenes`: measures the scenes of a list by a method and by the paper's.
//!
//! See [`fringeflow_lab::scene_lists`]. Only the figures of all scenes are kept; the worst scenes are measured again for
//! their pictures.

mod sensitivity;
mod summary;
mod table;
mod text;

use std::io::Write as _;
use std::path::Path;

use serde::Serialize;

use fringeflow::correspondence::ResolutionMethod;
use fringeflow_base::atomic_file::write_atomically;
use fringeflow_lab::scene_lists::{
    Layout, ListedScene, SCENES, SceneError, SceneFigures, SceneKind, SceneList, measure_all,
};
use fringeflow_lab::simulation::Object;

use self::summary::{Summary, summaries};
use crate::failure::Failure;
use crate::{json, progress};

/// Number of worst scenes that are listed.
const WORST: usize = 10;

/// A scene and its figures, or the reason why it failed.
#[derive(Clone, Serialize)]
struct Row {
    number: usize,
    kind: &'static str,
    layout: &'static str,
    object: &'static str,
    /// The scene in words, as options of `simulate`.
    scene: String,
    #[serde(flatten)]
    figures: Option<SceneFigures>,
    failure: Option<String>,
}

#[derive(Serialize)]
struct Report<'a> {
    list: SceneList,
    /// All scenes together.
    all: &'a Summary,
    kinds: &'a [Summary],
    layouts: &'a [Summary],
    objects: &'a [Summary],
    /// Numbers of the worst scenes, the worst first.
    worst: Vec<usize>,
    scenes: &'a [Row],
}

/// The names by which scenes can be chosen: kinds, layouts and objects.
pub(super) fn names() -> Vec<&'static str> {
    let kinds = SceneKind::ALL.map(SceneKind::name).into_iter();
    kinds.chain(Layout::ALL.map(Layout::name)).chain(Object::ALL.map(Object::name)).collect()
}

/// Measures the scenes, prints the tables, and writes table and pictures to a folder.
pub(super) fn run(
    list: SceneList,
    method: ResolutionMethod,
    take: Option<u16>,
    only: Option<&str>,
    is_sensitivity: bool,
    folder: Option<&Path>,
    as_json: bool,
) -> Result<(), Failure> {
    let chosen = |scene: &ListedScene| only.is_none_or(|name| scene.names().contains(&name));
    let scenes = (0..SCENES).map(|number| list.scene(number)).filter(chosen);
    let scenes: Vec<ListedScene> = scenes.take(take.map_or(SCENES, usize::from)).collect();
    if is_sensitivity {
        return sensitivity::run(&scenes, folder, as_json);
    }
    let bar = progress::bar("scenes", scenes.len() as u64);
    let figures = measure_all(&scenes, method, || bar.inc(1));
    bar.finish_and_clear();
    let rows: Vec<Row> = scenes.iter().zip(figures).map(|(scene, figures)| Row::new(scene, figures)).collect();
    let worst = worst(&rows);
    if let Some(folder) = folder {
        write_atomically(&folder.join("scenes.csv"), |out| table::write(out, &rows))?;
        write_pictures(folder, method, &scenes, &worst)?;
    }
    print(list, &rows, &worst, as_json)?;
    failures(&rows).map_or(Ok(()), Err)
}

impl Row {
    fn new(scene: &ListedScene, figures: Result<SceneFigures, SceneError>) -> Self {
        let [kind, layout, object] = scene.names();
        let (figures, failure) = match figures {
            Ok(figures) => (Some(figures), None),
            Err(error) => (None, Some(error.to_string())),
        };
        Self { number: scene.number, kind, layout, object, scene: text::scene(scene), figures, failure }
    }
}

/// Indices of the worst scenes: those with the highest fpc, among equals those with the lowest com.
fn worst(rows: &[Row]) -> Vec<usize> {
    let badness = |&(_, row): &(usize, &Row)| {
        row.figures.map_or((0.0, 0.0), |figures| (figures.scores.fpc_percent, -figures.scores.com_percent))
    };
    let mut measured: Vec<(usize, &Row)> = rows.iter().enumerate().filter(|(_, row)| row.figures.is_some()).collect();
    measured.sort_by(|a, b| {
        let (a, b) = (badness(a), badness(b));
        b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1))
    });
    measured.into_iter().take(WORST).map(|(index, _)| index).collect()
}

/// Measures the worst scenes again, and writes their pictures.
fn write_pictures(
    folder: &Path,
    method: ResolutionMethod,
    scenes: &[ListedScene],
    worst: &[usize],
) -> Result<(), Failure> {
    for (rank, &index) in worst.iter().enumerate() {
        let scene = &scenes[index];
        let measured = scene.measure(method).map_err(Failure::unusable)?;
        for (name, picture) in measured.pictures() {
            let (rank, list, number) = (rank + 1, scene.list.name(), scene.number);
            picture.write_png(&folder.join(format!("worst-{rank:02}-{list}-{number:03}-{name}.png")))?;
        }
    }
    Ok(())
}

fn print(list: SceneList, rows: &[Row], worst: &[usize], as_json: bool) -> Result<(), Failure> {
    let all = Summary::new("all", rows.iter());
    let kinds = summaries(rows, SceneKind::ALL.map(SceneKind::name), |row| row.kind);
    let layouts = summaries(rows, Layout::ALL.map(Layout::name), |row| row.layout);
    let objects = summaries(rows, Object::ALL.map(Object::name), |row| row.object);
    if as_json {
        let worst = worst.iter().map(|&index| rows[index].number).collect();
        let (all, kinds, layouts, objects) = (&all, &kinds[..], &layouts[..], &objects[..]);
        return json::print(&Report { list, all, kinds, layouts, objects, worst, scenes: rows });
    }
    let mut out = std::io::stdout().lock();
    for (title, groups) in [("kind", &kinds), ("layout", &layouts), ("object", &objects)] {
        writeln!(out, "{}", text::table(title, groups, &all))?;
    }
    write!(out, "{}", text::worst(list, worst.iter().map(|&index| &rows[index])))?;
    Ok(())
}

/// The error that lists the failed scenes with their reasons; `None` if all succeeded.
fn failures(rows: &[Row]) -> Option<Failure> {
    let line = |row: &Row| {
        let Row { number, kind, layout, object, .. } = row;
        Some(format!("  {number}, {kind}, {layout}, {object}: {}", row.failure.as_deref()?))
    };
    let lines: Vec<String> = rows.iter().filter_map(line).collect();
    let text = format!("{} of {} scenes failed:\n{}", lines.len(), rows.len(), lines.join("\n"));
    match lines.len() {
        _ if rows.is_empty() => Some(Failure::Usage("the list has no such scene; use another --only".to_owned())),
        0 => None,
        failed if failed == rows.len() => Some(Failure::NothingMeasured(text)),
        _ => Some(Failure::Losses(text)),
    }
}

/// A row for tests.
#[cfg(test)]
fn test_row(number: usize, kind: &'static str, com_percent: f64, fpc_percent: f64) -> Row {
    use fringeflow_lab::evaluation::Scores;
    let scores = Scores { com_percent, fpc_percent, interior_percent: Some(com_percent), ..Scores::default() };
    let paper = Some(Scores { com_percent: com_percent - 1.0, ..Scores::default() });
    let figures = Some(SceneFigures { mean_periods: 6.0, sd_rad: 0.041, efc: 0.2, scores, paper });
    let (layout, object, scene) = ("inside", "tooth", "tooth, 4 steps".to_owned());
    Row { number, kind, layout, object, scene, figures, failure: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_have_the_most_false_points_and_then_the_fewest_right_ones() {
        let failed = Row { figures: None, failure: Some("no δ".to_owned()), ..test_row(3, "dim", 0.0, 0.0) };
        let rows =
            [test_row(0, "plain", 99.0, 0.0), test_row(1, "dim", 90.0, 0.0), test_row(2, "dim", 99.0, 0.5), failed];
        assert_eq!(worst(&rows), [2, 1, 0]);
        assert!(failures(&rows[..3]).is_none());
        assert!(
            matches!(failures(&rows), Some(Failure::Losses(text)) if text.contains("3, dim") && text.contains("δ"))
        );
        assert!(matches!(failures(&rows[3..]), Some(Failure::NothingMeasured(_))));
        assert!(matches!(failures(&[]), Some(Failure::Usage(_))));
    }

    #[test]
    fn no_name_means_two_things() {
        let mut all = names();
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), count);
    }
}
