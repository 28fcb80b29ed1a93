//! Writes the page: the template with the style, the script and the plot library, and the figures.

use std::io::{self, Write};

use super::RunFigures;
use super::markup::COMMON_STYLE;

/// A placeholder is a name between two `@@`.
const TEMPLATE: &str = include_str!("page/page.html");
const STYLE: &[&str] =
    &[include_str!("../../../monitor/page/vendor/uplot/uPlot.min.css"), COMMON_STYLE, include_str!("page/page.css")];
const LICENCE: &str = include_str!("../../../monitor/page/vendor/uplot/LICENSE");
/// The parts of the module script. A part may use only names of the parts before it. Some parts are shared with the
/// dashboard. Their imports are left out, since the parts that they import come before them.
const SCRIPT: &[&str] = &[
    include_str!("../../../monitor/page/vendor/uplot/uPlot.min.js"),
    include_str!("../../../monitor/page/app/format.js"),
    include_str!("../../../monitor/page/app/gauges.js"),
    include_str!("../../../monitor/page/app/names.js"),
    include_str!("page/format.js"),
    include_str!("../../../monitor/page/app/colours.js"),
    include_str!("../../../monitor/page/app/axis.js"),
    include_str!("../../../monitor/page/app/plot-style.js"),
    include_str!("page/plots.js"),
    include_str!("page/tables.js"),
    include_str!("page/panels.js"),
    include_str!("page/main.js"),
];

/// Writes the page of a run.
pub(crate) fn write_html(out: &mut impl Write, figures: &RunFigures<'_>) -> io::Result<()> {
    let data = serde_json::to_string(figures)?;
    // Only the template is split, so a `@@` in the inserted texts is no placeholder.
    for (number, part) in TEMPLATE.split("@@").enumerate() {
        let is_name = number % 2 == 1;
        match part {
            "licence" if is_name => out.write_all(LICENCE.as_bytes())?,
            "style" if is_name => write_parts(out, STYLE)?,
            "script" if is_name => write_module(out)?,
            // In JSON the escape means `<`, but it cannot begin an HTML tag.
            "data" if is_name => out.write_all(data.replace('<', "\\u003c").as_bytes())?,
            text => out.write_all(text.as_bytes())?,
        }
    }
    Ok(())
}

fn write_parts(out: &mut impl Write, parts: &[&str]) -> io::Result<()> {
    parts.iter().try_for_each(|part| writeln!(out, "{part}"))
}

fn write_module(out: &mut impl Write) -> io::Result<()> {
    let lines = SCRIPT.iter().flat_map(|part| part.lines());
    lines.filter(|line| !line.starts_with("import ")).try_for_each(|line| writeln!(out, "{line}"))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use fringeflow_message::{Counts, DropReason, Stage, StageReport};
    use fringeflow_recording::Origin;
    use fringeflow_telemetry::{Exposures, RunReport};
    use serde_json::Value;

    use super::*;
    use crate::report::RunInfo;

    const HOSTILE: &str = "</script><script>alert(1)</script><!-- @@data@@ \u{2028} \"'&";

    fn page() -> String {
        let mut counts = Counts { taken: 3, passed: 2, ..Counts::default() };
        counts.drop_one(DropReason::Overrun);
        let mut run = RunReport::new(Exposures::Live, 3);
        run.add(&StageReport { stage: Stage::Cloud as u32, of_item: 1, counts, ..StageReport::default() });
        let info = RunInfo {
            instance: Some(HOSTILE),
            version: "0",
            origin: Origin { host: HOSTILE.to_owned(), ..Origin::default() },
            image_size_px: [4, 3],
            virtual_images: false,
            steps: 4,
            recording: Some(Path::new(HOSTILE)),
            is_recorded: true,
        };
        let mut page = Vec::new();
        write_html(&mut page, &RunFigures::new(info, &[(Stage::Cloud, counts)], &run)).unwrap();
        String::from_utf8(page).unwrap()
    }

    #[test]
    fn names_cannot_become_markup() {
        let page = page();
        assert_eq!((page.matches("<script").count(), page.matches("</script>").count()), (2, 2));
        let data = page.split_once("type=\"application/json\">").unwrap().1.split_once("</script>").unwrap().0;
        let data: Value = serde_json::from_str(data).unwrap();
        assert_eq!((&data["instance"], &data["origin"]["host"]), (&HOSTILE.into(), &HOSTILE.into()));
        assert_eq!((&data["drops"][0]["kind"], &data["drops"][0]["count"]), (&"loss".into(), &1.into()));
        assert_eq!(data["windows_incomplete"], 1);
    }

    #[test]
    fn every_placeholder_is_filled_and_nothing_is_loaded() {
        let page = page();
        let without_data = page.split_once("type=\"application/json\">").unwrap().0;
        assert!(!without_data.contains("@@"));
        assert!(page.contains("Permission is hereby granted"), "the licence of uPlot");
        for loading in [" src=", "<link", "@import", "url(", "fetch(", "import ", "import(", "XMLHttpRequest"] {
            assert!(!page.contains(loading), "{loading}");
        }
    }
}
