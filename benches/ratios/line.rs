//! Lines of the result table, and its output as text and JSON.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};

use super::bench::Bench;
use super::clock::{Spent, median};

/// Target of a ratio.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Target {
    AtMost(f64),
    AtLeast(f64),
}

/// The kind of time that a ratio compares.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Time {
    Cpu,
    Wall,
}

/// All lines so far.
#[derive(Default)]
pub(crate) struct Report {
    lines: Vec<Line>,
    /// Texts below the table.
    notes: Vec<String>,
    /// Further data for the JSON file, such as the profile.
    data: serde_json::Map<String, Value>,
}

struct Line {
    name: String,
    /// Printed values of ours and of the peer.
    values: [String; 2],
    outcome: Outcome,
}

enum Outcome {
    Measured { value: f64, range: [f64; 2], target: Target },
    Skipped(String),
}

impl Target {
    fn is_reached(self, value: f64) -> bool {
        match self {
            Self::AtMost(limit) => value <= limit,
            Self::AtLeast(limit) => value >= limit,
        }
    }
}

impl std::fmt::Display for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::AtMost(limit) => write!(f, "<= {limit}"),
            Self::AtLeast(limit) => write!(f, ">= {limit}"),
        }
    }
}

impl Time {
    fn select_ns(self, spent: &Spent) -> f64 {
        match self {
            Self::Cpu => spent.cpu_ns,
            Self::Wall => spent.wall_ns,
        }
    }
}

impl Report {
    /// Adds a ratio of interleaved repetitions: the time of `over` ÷ the time of `under`.
    pub(crate) fn ratio(&mut self, name: &str, over: &[Spent], under: &[Spent], time: Time, target: Target) {
        self.scaled_ratio(name, [(over, 1.0), (under, 1.0)], time, target);
    }

    /// Adds a ratio of times per unit of work. Each side states the units per repetition.
    pub(crate) fn scaled_ratio(
        &mut self,
        name: &str,
        [(over, over_units), (under, under_units)]: [(&[Spent], f64); 2],
        time: Time,
        target: Target,
    ) {
        let unit_ns = |spent: &[Spent], units: f64| median(spent.iter().map(|s| time.select_ns(s))) / units;
        let (top, bottom) = (unit_ns(over, over_units), unit_ns(under, under_units));
        let ratios: Vec<f64> = over
            .iter()
            .zip(under)
            .map(|(a, b)| time.select_ns(a) / over_units / (time.select_ns(b) / under_units))
            .collect();
        // With an upper limit, the peer is the denominator; with a lower limit, ours is.
        let values = match target {
            Target::AtMost(_) => [top, bottom],
            Target::AtLeast(_) => [bottom, top],
        };
        self.measurement(name, values.map(milliseconds), top / bottom, &ratios, target);
    }

    /// Adds any other value, with its repetitions.
    pub(crate) fn measurement(&mut self, name: &str, values: [String; 2], value: f64, all: &[f64], target: Target) {
        let fold = |start: f64, pick: fn(f64, f64) -> f64| all.iter().copied().fold(start, pick);
        let range = [fold(value, f64::min), fold(value, f64::max)];
        self.lines.push(Line { name: name.to_owned(), values, outcome: Outcome::Measured { value, range, target } });
    }

    /// Adds a line that cannot be measured here, with the reason.
    pub(crate) fn skipped(&mut self, name: &str, why: &str) {
        let values = [String::new(), String::new()];
        self.lines.push(Line { name: name.to_owned(), values, outcome: Outcome::Skipped(why.to_owned()) });
    }

    /// Adds a text below the table.
    pub(crate) fn note(&mut self, note: String) {
        self.notes.push(note);
    }

    /// Adds data to the JSON file.
    pub(crate) fn data(&mut self, key: &str, value: Value) {
        self.data.insert(key.to_owned(), value);
    }

    /// Prints the table.
    pub(crate) fn print(&self) {
        let width = self.lines.iter().map(|line| line.name.chars().count()).max().unwrap_or_default();
        println!("\n{:<width$} {:>12} {:>12} {:>22} {:>8}  reached", "line", "ours", "peer", "ratio (range)", "wanted");
        for line in &self.lines {
            let (name, [ours, peer]) = (&line.name, &line.values);
            match &line.outcome {
                Outcome::Measured { value, range: [least, most], target } => {
                    let ratio = format!("{} ({}–{})", short(*value), short(*least), short(*most));
                    let reached = if target.is_reached(*value) { "yes" } else { "no" };
                    println!("{name:<width$} {ours:>12} {peer:>12} {ratio:>22} {:>8}  {reached}", target.to_string());
                }
                Outcome::Skipped(why) => println!("{name:<width$} skipped: {why}"),
            }
        }
        self.notes.iter().for_each(|note| println!("\n{note}"));
    }

    /// Writes the results as JSON.
    pub(crate) fn write_json(&self, file: &Path, bench: &Bench) {
        let line = |line: &Line| match &line.outcome {
            Outcome::Measured { value, range, target } => json!({
                "line": line.name,
                "ours": line.values[0],
                "peer": line.values[1],
                "value": value,
                "range": range,
                "wanted": target.to_string(),
                "reached": target.is_reached(*value),
            }),
            Outcome::Skipped(why) => json!({ "line": line.name, "skipped": why }),
        };
        let text = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "size_px": bench.size_px,
            "repetitions": bench.repetitions,
            "lines": self.lines.iter().map(line).collect::<Vec<_>>(),
            "notes": self.notes,
            "data": self.data,
        });
        std::fs::write(file, format!("{text:#}\n")).unwrap();
    }
}

/// Formats nanoseconds as milliseconds.
pub(crate) fn milliseconds(ns: f64) -> String {
    format!("{} ms", short(ns * 1e-6))
}

/// Formats a value with about three digits.
pub(crate) fn short(value: f64) -> String {
    let mut text = String::new();
    let digits = match value.abs() {
        0.0 => 0,
        x if x < 0.1 => 4,
        x if x < 10.0 => 2,
        x if x < 100.0 => 1,
        _ => 0,
    };
    write!(text, "{value:.digits$}").unwrap();
    text
}
