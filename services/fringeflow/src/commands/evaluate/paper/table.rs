//! A table, as Markdown and as HTML.

use crate::report::escaped;

/// A table with a title and a note.
pub(super) struct Table {
    pub(super) title: String,
    pub(super) note: String,
    pub(super) head: Vec<&'static str>,
    pub(super) rows: Vec<Vec<String>>,
}

impl Table {
    /// The table in Markdown, with columns of even width.
    pub(super) fn markdown(&self) -> String {
        let width = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count());
            cells.chain([self.head[column].chars().count()]).max().unwrap_or_default()
        };
        let widths: Vec<usize> = (0..self.head.len()).map(width).collect();
        let line = |cells: &[String]| {
            let cells = cells.iter().zip(&widths).map(|(cell, &width)| format!(" {cell:<width$} |"));
            format!("|{}\n", cells.collect::<String>())
        };
        let head: Vec<String> = self.head.iter().map(|&cell| cell.to_owned()).collect();
        let rule: Vec<String> = widths.iter().map(|&width| "-".repeat(width)).collect();
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        format!("## {}\n\n{}\n\n{}{}{rows}\n", self.title, self.note, line(&head), line(&rule))
    }

    /// The table in HTML.
    pub(super) fn html(&self) -> String {
        let row = |tag: &str, cells: Vec<&str>| {
            let cells = cells.iter().map(|cell| format!("<{tag}>{}</{tag}>", escaped(cell)));
            format!("<tr>{}</tr>\n", cells.collect::<String>())
        };
        let rows = self.rows.iter().map(|cells| row("td", cells.iter().map(String::as_str).collect()));
        format!(
            "<h2>{}</h2>\n<p>{}</p>\n<div class=\"wide\"><table><thead>{}</thead><tbody>\n{}</tbody></table></div>\n",
            escaped(&self.title),
            escaped(&self.note),
            row("th", self.head.clone()),
            rows.collect::<String>()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markdown_has_even_columns_and_html_is_escaped() {
        let rows = vec![vec!["a & b".to_owned(), "1".to_owned()], vec!["c".to_owned(), "23".to_owned()]];
        let table = Table { title: "T".to_owned(), note: "n < 1".to_owned(), head: vec!["name", "n"], rows };
        assert_eq!(
            table.markdown(),
            "## T\n\nn < 1\n\n| name  | n  |\n| ----- | -- |\n| a & b | 1  |\n| c     | 23 |\n\n"
        );
        let html = table.html();
        assert!(html.contains("<td>a &amp; b</td><td>1</td>") && html.contains("<p>n &lt; 1</p>"), "{html}");
    }
}
