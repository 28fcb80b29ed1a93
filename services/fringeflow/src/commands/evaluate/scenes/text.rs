//! The figures of scenes as tables for the terminal, and a scene in words.

use fringeflow_lab::scene_lists::{ListedScene, SceneList};
use fringeflow_lab::simulation::Board;

use super::Row;
use super::summary::{Ends, Summary};

/// The table of the groups of one title, with all scenes as the last line.
pub(super) fn table(title: &str, groups: &[Summary], all: &Summary) -> String {
    let head = |first: &str, name: &str| format!("{first:<13}{name:>7}{:>7}", "");
    let pairs: String = ["com %", "interior %", "fpc %"].map(|name| format!("{name:>18}")).concat();
    let ends = format!("{:>9}{:>9}", "median", "worst");
    let heading = format!(
        "{}{pairs}{:>11}{:>18}\n{}{}{:>11}{ends}\n",
        head("", ""),
        "fpc ≤ 0.2",
        "paper's com %",
        format_args!("{title:<13}{:>7}{:>7}", "scenes", "failed"),
        ends.repeat(3),
        "% of them",
    );
    heading + &groups.iter().chain([all]).map(line).collect::<String>()
}

fn line(group: &Summary) -> String {
    let ends = |Ends { median, worst }: Ends| format!("{}{}", figure(median), figure(worst));
    format!(
        "{:<13}{:>7}{:>7}{}{}{}{:>11}{}\n",
        group.name,
        group.scenes,
        group.failed,
        ends(group.com_percent),
        ends(group.interior_percent),
        ends(group.fpc_percent),
        figure(group.good_percent).trim(),
        ends(group.paper_com_percent),
    )
}

fn figure(value: f64) -> String {
    if value.is_nan() { format!("{:>9}", "–") } else { format!("{value:>9.2}") }
}

/// A line for each of the worst scenes.
pub(super) fn worst<'a>(list: SceneList, rows: impl Iterator<Item = &'a Row>) -> String {
    let line = |row: &Row| {
        let figures = row.figures?;
        let interior = figures.scores.interior_percent.unwrap_or(f64::NAN);
        let paper = figures.paper.map_or(f64::NAN, |scores| scores.com_percent);
        let (fpc, com) = (figure(figures.scores.fpc_percent), figure(figures.scores.com_percent));
        let Row { number, kind, layout, scene, .. } = row;
        let (interior, paper) = (figure(interior), figure(paper));
        Some(format!(
            "{number:>6}{fpc}{com}{interior}{paper}  {kind}, {layout}, n {:.1}, {scene}\n",
            figures.mean_periods
        ))
    };
    let heading = format!(
        "the worst of {}\n{:>6}{:>9}{:>9}{:>9}{:>9}  scene\n",
        list.name(),
        "number",
        "fpc %",
        "com %",
        "interior",
        "paper's"
    );
    heading + &rows.filter_map(line).collect::<String>()
}

/// A scene in words.
pub(super) fn scene(scene: &ListedScene) -> String {
    let ListedScene { options, staging, .. } = scene;
    let (rig, [width, height]) = (&options.rig, options.rig.size_px);
    let board = match options.board {
        Board::None => "no board".to_owned(),
        Board::Dark => "dark board".to_owned(),
        Board::Visible => "visible board".to_owned(),
        Board::Apart(board) => format!("board at {:.0} mm (albedo {:.2})", board.distance_mm, board.albedo),
    };
    let mut words = vec![
        options.object.name().to_owned(),
        board,
        format!("depth {:.0} mm", rig.depth_m * 1e3),
        format!("period {:.1} px", rig.period_px),
        format!("{} steps", options.steps),
        format!("sd {:.3} rad", rig.sd_rad),
        format!("noise {}", options.noise.name()),
        format!("albedo {:.2}", staging.albedo.unwrap_or(0.8)),
    ];
    words.extend((staging.gloss > 0.0).then(|| format!("gloss {:.1}", staging.gloss)));
    words.extend(staging.share_percent.map(|share| format!("share {share:.1} %")));
    words.extend(staging.hand.then(|| "hand".to_owned()));
    words.extend(staging.motion.map(|motion| format!("motion {:.2} mm", motion.mm_per_image)));
    words.push(format!("{width}x{height}"));
    words.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::evaluate::scenes::summary::summaries;
    use crate::commands::evaluate::scenes::test_row;

    #[test]
    fn every_group_and_every_worst_scene_has_a_line_with_its_figures() {
        let rows = [test_row(4, "dim", 90.0, 0.5), test_row(7, "dim", 94.0, 0.0)];
        let all = Summary::new("all", rows.iter());
        let text = table("kind", &summaries(&rows, ["plain", "dim"], |row| row.kind), &all);
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        let figures = ["2", "0", "92.00", "90.00", "92.00", "90.00", "0.25", "0.50", "50.00", "91.00", "89.00"];
        assert_eq!(lines[2], [&["dim"][..], &figures].concat());
        assert_eq!(lines[3], [&["all"][..], &figures].concat());
        let text = worst(SceneList::Build, rows.iter());
        let words: Vec<&str> = text.lines().nth(2).unwrap().split_whitespace().take(6).collect();
        assert_eq!(words, ["4", "0.50", "90.00", "90.00", "89.00", "dim,"]);
    }

    #[test]
    fn a_scene_is_told_with_what_makes_it_hard() {
        let listed = (0..).map(|number| SceneList::Judge.scene(number)).find(|scene| scene.staging.motion.is_some());
        let words = scene(&listed.unwrap());
        assert!(words.contains("steps") && words.contains("motion") && words.contains("albedo"), "{words}");
    }
}
