//! The matrices of an OpenCV FileStorage YAML file. In: its text. Out: its matrices by name. Cost: one parse.
//!
//! OpenCV writes `%YAML:1.0`, which is not a valid directive. When it appends to a file, it ends the document with
//! `...` and begins another. So the documents are read one by one and their matrices collected.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_saphyr::NonFiniteFloatPolicy;

use super::CalibrationProblem;

/// A matrix as written: values row by row.
#[derive(Clone, Debug)]
pub(super) struct Matrix {
    pub(super) rows: usize,
    pub(super) cols: usize,
    pub(super) values: Vec<f64>,
}

#[derive(Deserialize)]
struct RawMatrix {
    rows: usize,
    cols: usize,
    data: Vec<f64>,
}

/// A node of the file: a matrix, or anything else (strings, numbers, lists).
#[derive(Deserialize)]
#[serde(untagged)]
enum Node {
    Matrix(RawMatrix),
    Other(serde::de::IgnoredAny),
}

/// The matrices of a file, by name.
pub(super) type Matrices = BTreeMap<String, Matrix>;

/// Parses all documents of a FileStorage text.
pub(super) fn parse(text: &str) -> Result<Matrices, CalibrationProblem> {
    let mut matrices = Matrices::new();
    // NaN and infinity pass here, so that the check of the values can name their field.
    let options = serde_saphyr::options! { non_finite_float_policy: NonFiniteFloatPolicy::PassThrough };
    for document in documents(text) {
        let nodes: BTreeMap<String, Node> = serde_saphyr::from_str_with_options(&document, options.clone())
            .map_err(|e| CalibrationProblem::NotFileStorage(first_line(&e.to_string())))?;
        for (name, node) in nodes {
            if let Node::Matrix(RawMatrix { rows, cols, data }) = node {
                matrices.insert(name, Matrix { rows, cols, values: data });
            }
        }
    }
    Ok(matrices)
}

/// Splits a text at its document marks. Drops directives and OpenCV's type tags: the shape of a node says the same.
fn documents(text: &str) -> Vec<String> {
    let mut documents = vec![String::new()];
    for line in text.lines() {
        match line.trim_end() {
            "---" | "..." => documents.push(String::new()),
            line if line.starts_with('%') => {}
            line => {
                if let Some(last) = documents.last_mut() {
                    last.push_str(&line.replace("!!opencv-matrix", ""));
                    last.push('\n');
                }
            }
        }
    }
    documents.retain(|d| !d.trim().is_empty());
    documents
}

fn first_line(text: &str) -> String {
    text.lines().next().unwrap_or_default().to_owned()
}
