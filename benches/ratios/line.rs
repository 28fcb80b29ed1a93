//! Lines of the table, and the table on a terminal and as JSON.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};

use super::bench::Bench;
use super::clock::{Spent, median};

/// What is wanted of a ratio.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Wanted {
    AtMost(f64),
    AtLeast(f64),
}

/// Which time a ratio is made of.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Time {
    Cpu,
    Wall,
}

/// All lines so far.
#[derive(Default)]
pub(crate) struct Report {
    lines: Vec<Line>,
    /// What stands below the table.
    notes: Vec<String>,
    /// The profile and whatever else is data.
    data: serde_json::Map<String, Value>,
}

struct Line {
    name: String,
    /// Ours and the peer's, as they are printed.
    values: [String; 2],
    outcome: Outcome,
}

enum Outcome {
    Figure { value: f64, range: [f64; 2], wanted: Wanted },
    Skipped(String),
}

impl Wanted {
    fn is_reached(self, value: f64) -> bool {
        match self {
            Self::AtMost(limit) => value <= limit,
            Self::AtLeast(limit) => value >= limit,
        }
    }
}

impl std::fmt::Display for Wanted {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::AtMost(limit) => write!(f, "<= {limit}"),
            Self::AtLeast(limit) => write!(f, ">= {limit}"),
        }
    }
}

impl Time {
    fn of(self, spent: &Spent) -> f64 {
        match self {
            Self::Cpu => spent.cpu_ns,
            Self::Wall => spent.wall_ns,
        }
    }
}

impl Report {
    /// A ratio of interleaved repetitions: what `over` took ÷ what `under` took.
    pub(crate) fn ratio(&mut self, name: &str, over: &[Spent], under: &[Spent], time: Time, wanted: Wanted) {
        self.scaled_ratio(name, [(over, 1.0), (under, 1.0)], time, wanted);
    }

    /// The same where one repetition of either is so many units of work.
    pub(crate) fn scaled_ratio(
        &mut self,
        name: &str,
        [(over, over_units), (under, under_units)]: [(&[Spent], f64); 2],
        time: Time,
        wanted: Wanted,
    ) {
        let of = |spent: &[Spent], units: f64| median(spent.iter().map(|s| time.of(s))) / units;
        let (top, bottom) = (of(over, over_units), of(under, under_units));
        let ratios: Vec<f64> =
            over.iter().zip(under).map(|(a, b)| time.of(a) / over_units / (time.of(b) / under_units)).collect();
        // The peer is what ours must be faster than, or what it is counted in.
        let values = match wanted {
            Wanted::AtMost(_) => [top, bottom],
            Wanted::AtLeast(_) => [bottom, top],
        };
        self.figure(name, values.map(milliseconds), top / bottom, &ratios, wanted);
    }

    /// Any other figure, with its repetitions.
    pub(crate) fn figure(&mut self, name: &str, values: [String; 2], value: f64, all: &[f64], wanted: Wanted) {
        let fold = |start: f64, pick: fn(f64, f64) -> f64| all.iter().copied().fold(start, pick);
        let range = [fold(value, f64::min), fold(value, f64::max)];
        self.lines.push(Line { name: name.to_owned(), values, outcome: Outcome::Figure { value, range, wanted } });
    }

    /// A line that cannot be measured here, and why.
    pub(crate) fn skipped(&mut self, name: &str, why: &str) {
        let values = [String::new(), String::new()];
        self.lines.push(Line { name: name.to_owned(), values, outcome: Outcome::Skipped(why.to_owned()) });
    }

    /// Something to be said below the table.
    pub(crate) fn note(&mut self, note: String) {
        self.notes.push(note);
    }

    /// Data of the JSON beside the lines.
    pub(crate) fn data(&mut self, key: &str, value: Value) {
        self.data.insert(key.to_owned(), value);
    }

    /// The table.
    pub(crate) fn print(&self) {
        let width = self.lines.iter().map(|line| line.name.chars().count()).max().unwrap_or_default();
        println!("\n{:<width$} {:>12} {:>12} {:>22} {:>8}  reached", "line", "ours", "peer", "ratio (range)", "wanted");
        for line in &self.lines {
            let (name, [ours, peer]) = (&line.name, &line.values);
            match &line.outcome {
                Outcome::Figure { value, range: [least, most], wanted } => {
                    let ratio = format!("{} ({}–{})", short(*value), short(*least), short(*most));
                    let reached = if wanted.is_reached(*value) { "yes" } else { "no" };
                    println!("{name:<width$} {ours:>12} {peer:>12} {ratio:>22} {:>8}  {reached}", wanted.to_string());
                }
                Outcome::Skipped(why) => println!("{name:<width$} skipped: {why}"),
            }
        }
        self.notes.iter().for_each(|note| println!("\n{note}"));
    }

    /// The same for programs.
    pub(crate) fn write_json(&self, file: &Path, bench: &Bench) {
        let line = |line: &Line| match &line.outcome {
            Outcome::Figure { value, range, wanted } => json!({
                "line": line.name,
                "ours": line.values[0],
                "peer": line.values[1],
                "value": value,
                "range": range,
                "wanted": wanted.to_string(),
                "reached": wanted.is_reached(*value),
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

/// Milliseconds of nanoseconds.
pub(crate) fn milliseconds(ns: f64) -> String {
    format!("{} ms", short(ns * 1e-6))
}

/// Three digits or a few more.
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
