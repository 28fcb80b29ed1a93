//! Keeps the fields of a span until one of its lines is written.

use std::fmt;

use serde_json::Value;
use tracing_subscriber::field::RecordFields;
use tracing_subscriber::fmt::FormatFields;
use tracing_subscriber::fmt::format::Writer;

use super::event_content::EventContent;

/// Formats fields as a JSON object. Fields that a span gets later become further objects behind it.
#[derive(Debug)]
pub(super) struct SpanFields;

impl<'w> FormatFields<'w> for SpanFields {
    fn format_fields<R: RecordFields>(&self, mut out: Writer<'w>, fields: R) -> fmt::Result {
        let mut content = EventContent::default();
        fields.record(&mut content);
        write!(out, "{}", Value::Object(content.fields))
    }
}
