//! XML of OpenCV: `<opencv_storage>` with an element for each field. A matrix has the attribute
//! `type_id="opencv-matrix"`; other elements hold numbers between spaces, a string, or elements of their own.

use roxmltree::{Document, Node as Element, ParsingOptions};

use super::super::CalibrationProblem;
use super::{Fields, Node};

/// Elements of a list.
const ITEM: &str = "_";
/// Most nodes of a document; calibrations have some hundreds.
const MAX_NODES: u32 = 1_000_000;
/// Depth of elements below which nothing is read; matrices of a calibration lie at depth 2.
const MAX_DEPTH: usize = 16;

/// Parses a text.
pub(super) fn parse(text: &str) -> Result<Fields, CalibrationProblem> {
    let refused = |what: String| CalibrationProblem::NotFileStorage(what);
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|e| refused(e.to_string()))?;
    let root = document.root_element();
    if !root.has_tag_name("opencv_storage") {
        let name = root.tag_name().name();
        return Err(refused(format!("it is XML, but begins with <{name}> and not with <opencv_storage>")));
    }
    Ok(fields_of(root, 0))
}

fn fields_of(element: Element<'_, '_>, depth: usize) -> Fields {
    let children = element.children().filter(Element::is_element);
    children.map(|child| (child.tag_name().name().to_owned(), value(child, depth + 1))).collect()
}

fn value(element: Element<'_, '_>, depth: usize) -> Node {
    let mut children = element.children().filter(Element::is_element).peekable();
    match children.peek().map(|child| child.has_tag_name(ITEM)) {
        Some(_) if depth > MAX_DEPTH => Node::Text("…".to_owned()),
        Some(true) => Node::Sequence(children.map(|child| value(child, depth + 1)).collect()),
        Some(false) => Node::Map(fields_of(element, depth)),
        None => content(element.text().unwrap_or_default().trim()),
    }
}

/// Numbers between spaces, one number, or a string, which may stand in quotes.
fn content(text: &str) -> Node {
    let words: Option<Vec<Node>> = text.split_whitespace().map(number).collect();
    match words {
        Some(mut numbers) if numbers.len() == 1 => numbers.remove(0),
        Some(numbers) if !numbers.is_empty() => Node::Sequence(numbers),
        _ => Node::Text(text.trim_matches('"').to_owned()),
    }
}

/// A number as OpenCV writes it.
fn number(word: &str) -> Option<Node> {
    let value = match word {
        ".Nan" => Some(f64::NAN),
        ".Inf" => Some(f64::INFINITY),
        "-.Inf" => Some(f64::NEG_INFINITY),
        word => word.parse().ok(),
    };
    value.map(Node::Number)
}
