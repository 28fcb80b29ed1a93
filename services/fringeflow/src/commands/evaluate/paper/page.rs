//! The page of the experiment: one HTML file without scripts, for light and dark screens.

use crate::report::escaped;

use super::table::Table;
use super::{NamedPicture, SHORT_TABLES};

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:72rem;padding:0 1rem;\
    background:var(--page);color:var(--ink)}:root{--ink:#1b1f24;--page:#fff;--grid:#d8dee4}\
    @media(prefers-color-scheme:dark){:root{--ink:#e6edf3;--page:#0d1117;--grid:#30363d}}\
    .wide{overflow-x:auto}table{border-collapse:collapse;font-size:13px;white-space:nowrap}\
    th,td{border:1px solid var(--grid);padding:.2rem .6rem;text-align:left;font-variant-numeric:tabular-nums}\
    svg,img{max-width:100%;height:auto}.pictures{display:grid;gap:1rem;\
    grid-template-columns:repeat(auto-fill,minmax(20rem,1fr))}figure{margin:0}";

/// The page with the tables, and the plot and the pictures before the long ones. The pictures stand beside the page.
pub(super) fn html(about: &str, tables: &[Table], plot: &str, pictures: &[NamedPicture]) -> String {
    let (first, rest) = tables.split_at(tables.len().min(SHORT_TABLES));
    let figure = |NamedPicture { name, title, .. }: &NamedPicture| {
        format!(
            "<figure><img src=\"{name}\" alt=\"{0}\" loading=\"lazy\"><figcaption>{0}</figcaption></figure>\n",
            escaped(title)
        )
    };
    let figures: String = pictures.iter().map(figure).collect();
    let [first, rest] = [first, rest].map(|tables| tables.iter().map(Table::html).collect::<String>());
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>The experiment of the paper</title>\n\
         <meta name=\"viewport\" content=\"width=device-width\"><style>{STYLE}</style></head><body>\n\
         <h1>The experiment of the paper</h1>\n<p>Bräuer-Burchardt et al. (2011), section 3, measured with the virtual \
         scanner of Fringeflow. {}</p>\n{first}<h2>More and more false candidates</h2>\n<p>The paper states 99.9 % com \
         and 0.1 % fpc at efc 0.2, 2 % fpc at efc 0.5, and expects worse beyond 1.</p>\n{plot}\n<h2>Right and missed points by RD</h2>\n<div class=\"pictures\">{figures}</div>\n{rest}</body></html>\n",
        escaped(about)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_has_every_table_and_loads_nothing() {
        let table = |title: &str| Table {
            title: title.to_owned(),
            note: String::new(),
            head: vec!["n"],
            rows: vec![vec!["<1>".to_owned()]],
        };
        let page = html("a < b", &[table("one"), table("two"), table("three")], "<svg></svg>", &[]);
        assert_eq!((page.matches("<table>").count(), page.matches("<td>&lt;1&gt;</td>").count()), (3, 3));
        assert!(page.find("two").unwrap() < page.find("<svg>").unwrap());
        assert!(page.contains("a &lt; b") && !page.contains("<script") && !page.contains(" src="));
    }
}
