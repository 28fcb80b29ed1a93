//! A value of a file.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::IgnoredAny;

/// A value as a file holds it.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(untagged)]
pub(in super::super) enum Node {
    Number(f64),
    Sequence(Vec<Self>),
    Map(BTreeMap<String, Self>),
    Text(String),
    Other(IgnoredAny),
}

/// A matrix: values row by row.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Matrix {
    pub(in super::super) rows: usize,
    pub(in super::super) cols: usize,
    pub(in super::super) values: Vec<f64>,
}

impl Node {
    /// The matrix that the value holds; `None` if it is of another kind.
    pub(in super::super) fn matrix(&self) -> Option<Matrix> {
        match self {
            Self::Map(fields) => stated_matrix(fields),
            Self::Sequence(items) => numbers(items).map(column).or_else(|| matrix_of_rows(items)),
            Self::Number(_) | Self::Text(_) | Self::Other(_) => None,
        }
    }

    /// What the value is, for people.
    pub(in super::super) fn kind(&self) -> String {
        match self {
            Self::Number(value) => format!("the number {value}"),
            Self::Text(text) => format!("the text {:?}", text.chars().take(40).collect::<String>()),
            Self::Sequence(items) => format!("a sequence of {} items that are not all numbers", items.len()),
            Self::Map(fields) if fields.contains_key("data") => {
                "a matrix whose rows, cols (or sizes) or data are missing or are no numbers".to_owned()
            }
            Self::Map(fields) => format!("a map of {}", fields.keys().cloned().collect::<Vec<_>>().join(" ")),
            Self::Other(_) => "empty, or true or false".to_owned(),
        }
    }

    /// The field of this name, if the value is a map with such a field.
    pub(in super::super) fn field(&self, name: &str) -> Option<&Self> {
        match self {
            Self::Map(fields) => fields.get(name),
            _ => None,
        }
    }

    fn number(&self) -> Option<f64> {
        match self {
            Self::Number(value) => Some(*value),
            _ => None,
        }
    }

    fn numbers(&self) -> Option<Vec<f64>> {
        match self {
            Self::Sequence(items) => numbers(items),
            _ => None,
        }
    }

    /// In XML, a sequence of one number looks like a number.
    fn one_or_more_numbers(&self) -> Option<Vec<f64>> {
        self.number().map(|value| vec![value]).or_else(|| self.numbers())
    }
}

fn numbers(items: &[Node]) -> Option<Vec<f64>> {
    items.iter().map(Node::number).collect()
}

fn column(values: Vec<f64>) -> Matrix {
    Matrix { rows: values.len(), cols: 1, values }
}

/// A matrix as a sequence of rows of the same length.
fn matrix_of_rows(items: &[Node]) -> Option<Matrix> {
    let rows = items.iter().map(Node::numbers).collect::<Option<Vec<_>>>()?;
    let cols = rows.first()?.len();
    let is_even = rows.iter().all(|row| row.len() == cols);
    is_even.then(|| Matrix { rows: rows.len(), cols, values: rows.concat() })
}

/// A matrix with its size and data as fields. OpenCV 5 states the size of arrays as `sizes`.
fn stated_matrix(fields: &BTreeMap<String, Node>) -> Option<Matrix> {
    let values = fields.get("data")?.one_or_more_numbers()?;
    let extent = |node: &Node| node.number().filter(|n| *n >= 0.0 && n.fract() == 0.0).map(|n| n as usize);
    if let Some(sizes) = fields.get("sizes") {
        let sizes = sizes.one_or_more_numbers()?;
        let [rows, cols] = match sizes[..] {
            [rows] => [rows, 1.0],
            [rows, cols] => [rows, cols],
            _ => return None,
        };
        return Some(Matrix { rows: rows as usize, cols: cols as usize, values });
    }
    let (rows, cols) = (extent(fields.get("rows")?)?, extent(fields.get("cols")?)?);
    // A matrix of vectors (dt: "3d") has as many values for each item.
    let channels = match fields.get("dt") {
        Some(Node::Text(kind)) => kind.trim_end_matches(char::is_alphabetic).parse().unwrap_or(1),
        _ => 1,
    };
    Some(Matrix { rows, cols: cols.checked_mul(channels)?, values })
}
