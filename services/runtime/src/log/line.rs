//! One event as one line.

use std::fmt::{self, Debug, Write};

use serde_json::{Map, Value};
use tracing::Level;
use tracing::field::{Field, Visit};

/// Name of the field that holds the message.
const MESSAGE: &str = "message";

/// What an event says.
#[derive(Default)]
pub(super) struct Said {
    /// As people read it: the message, then the fields.
    pub(super) text: String,
    message: String,
    fields: Map<String, Value>,
}

/// What stands in a line beside what the event says.
pub(super) struct Circumstances<'a> {
    pub(super) time: &'a str,
    pub(super) level: Level,
    pub(super) process: &'a str,
    /// How often the event was left out before.
    pub(super) left_out: u64,
}

impl Said {
    fn take(&mut self, field: &Field, text: &dyn fmt::Display, value: Value) {
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

    /// The line for people.
    pub(super) fn write_text(&self, out: &mut impl Write, about: &Circumstances<'_>) -> fmt::Result {
        write!(out, "{} {:>5} {}", about.time, about.level, self.text.trim_start())?;
        if about.left_out > 0 {
            write!(out, " ({} times more since)", about.left_out)?;
        }
        writeln!(out)
    }

    /// The line for programs.
    pub(super) fn write_json(self, out: &mut impl Write, about: &Circumstances<'_>) -> fmt::Result {
        let mut line = Map::new();
        line.insert("time".to_owned(), about.time.into());
        line.insert("level".to_owned(), about.level.as_str().into());
        line.insert("process".to_owned(), about.process.into());
        line.insert(MESSAGE.to_owned(), self.message.into());
        line.insert("fields".to_owned(), self.fields.into());
        if about.left_out > 0 {
            line.insert("repeated".to_owned(), about.left_out.into());
        }
        writeln!(out, "{}", Value::Object(line))
    }
}

impl Visit for Said {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let text = format!("{value:?}");
        self.take(field, &text, text.as_str().into());
    }

    fn record_str(&mut self, field: &Field, value: &str) {
        // Quoted, so that one with blanks is told from two fields; a message stands by itself.
        if field.name() == MESSAGE {
            self.take(field, &value, value.into());
        } else {
            self.take(field, &format_args!("{value:?}"), value.into());
        }
    }

    fn record_u64(&mut self, field: &Field, value: u64) {
        self.take(field, &value, value.into());
    }

    fn record_i64(&mut self, field: &Field, value: i64) {
        self.take(field, &value, value.into());
    }

    fn record_f64(&mut self, field: &Field, value: f64) {
        // What is no number for JSON is a text.
        let number = Value::from(value);
        let number = if number.is_null() { value.to_string().into() } else { number };
        self.take(field, &value, number);
    }

    fn record_bool(&mut self, field: &Field, value: bool) {
        self.take(field, &value, value.into());
    }
}

/// A text of one line, which moves no cursor: names of devices and files are not ours.
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
