//! Writes one event as one line.

use std::fmt::{self, Debug, Write};

use serde_json::{Map, Value};
use tracing::Level;
use tracing::field::{Field, Visit};

/// Name of the field that holds the message.
const MESSAGE: &str = "message";

/// Message and fields of an event.
#[derive(Default)]
pub(super) struct EventContent {
    /// Text form: the message, then the fields.
    pub(super) text: String,
    message: String,
    pub(super) fields: Map<String, Value>,
    /// Name and fields of the innermost span, then those of the spans around it that have other names.
    span: Map<String, Value>,
}

/// The other parts of a line.
pub(super) struct LineContext<'a> {
    pub(super) time: &'a str,
    pub(super) level: Level,
    pub(super) process: &'a str,
    /// How often the event was left out since its previous line.
    pub(super) left_out: u64,
}

impl EventContent {
    fn add(&mut self, field: &Field, text: &dyn fmt::Display, value: Value) {
        // Writing to a string never fails.
        if field.name() == MESSAGE {
            let fields = std::mem::take(&mut self.text);
            let _ = write!(self.text, "{}{fields}", Escaped(text));
            self.message = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        } else {
            let _ = write!(self.text, " {}={}", field.name(), Escaped(text));
            self.fields.insert(field.name().to_owned(), value);
        }
    }

    /// Adds the fields of a span in which the event happened, as [`SpanFields`](super::span_fields::SpanFields) keeps
    /// them. Spans are added from the innermost one.
    pub(super) fn add_span(&mut self, name: &str, fields: &str) {
        let objects = serde_json::Deserializer::from_str(fields).into_iter::<Map<String, Value>>();
        let fields = objects.flatten().flatten();
        for (key, value) in std::iter::once(("name".to_owned(), Value::from(name))).chain(fields) {
            self.span.entry(key).or_insert(value);
        }
    }

    /// Writes the line as text.
    pub(super) fn write_text(&self, out: &mut impl Write, context: &LineContext<'_>) -> fmt::Result {
        write!(out, "{} {:>5} {}", context.time, context.level, self.text.trim_start())?;
        for (key, value) in &self.span {
            match value {
                Value::String(name) if key == "name" => write!(out, " span={}", Escaped(name))?,
                value => write!(out, " {key}={value}")?,
            }
        }
        if context.left_out > 0 {
            write!(out, " ({} repeats left out)", context.left_out)?;
        }
        writeln!(out)
    }

    /// Writes the line as a JSON object.
    pub(super) fn write_json(self, out: &mut impl Write, context: &LineContext<'_>) -> fmt::Result {
        let mut line = Map::new();
        line.insert("time".to_owned(), context.time.into());
        line.insert("level".to_owned(), context.level.as_str().into());
        line.insert("process".to_owned(), context.process.into());
        line.insert(MESSAGE.to_owned(), self.message.into());
        line.insert("fields".to_owned(), self.fields.into());
        if !self.span.is_empty() {
            line.insert("span".to_owned(), self.span.into());
        }
        if context.left_out > 0 {
            line.insert("repeated".to_owned(), context.left_out.into());
        }
        writeln!(out, "{}", Value::Object(line))
    }
}

impl Visit for EventContent {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let text = format!("{value:?}");
        self.add(field, &text, text.as_str().into());
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        // Fields are quoted: their values may contain spaces.
        if field.name() == MESSAGE {
            self.add(field, &value, value.into());
        } else {
            self.add(field, &format_args!("{value:?}"), value.into());
        }
    }

    fn record_u64(&mut self, field: &Field, value: u64) {
        self.add(field, &value, value.into());
    }

    fn record_i64(&mut self, field: &Field, value: i64) {
        self.add(field, &value, value.into());
    }

    fn record_f64(&mut self, field: &Field, value: f64) {
        // JSON has no NaN and no infinity; they become strings.
        let number = Value::from(value);
        let number = if number.is_null() { value.to_string().into() } else { number };
        self.add(field, &value, number);
    }

    fn record_bool(&mut self, field: &Field, value: bool) {
        self.add(field, &value, value.into());
    }
}

/// Escapes control characters. Names of devices and files may contain some, and would break the line or move the
/// cursor.
struct Escaped<'a>(&'a dyn fmt::Display);

impl fmt::Display for Escaped<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for character in self.0.to_string().chars() {
            if character.is_control() {
                write!(f, "{}", character.escape_default())?;
            } else {
                f.write_char(character)?;
            }
        }
        Ok(())
    }
}
