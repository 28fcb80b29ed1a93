//! Formats events as lines, and leaves out repeated ones.

use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Mutex, PoisonError};

use tracing::{Event, Level, Subscriber};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields, FormattedFields};
use tracing_subscriber::registry::LookupSpan;

use super::event_content::{EventContent, LineContext};
use super::format::LogFormat;
use super::repeats::RepeatFilter;
use crate::clock::now_ns;

/// Formats events. An event that is left out becomes an empty text.
#[derive(Debug)]
pub(super) struct LineFormatter {
    format: LogFormat,
    process: &'static str,
    repeats: Mutex<RepeatFilter>,
    now_ns: fn() -> u64,
}

impl LineFormatter {
    pub(super) fn new(format: LogFormat, process: &'static str) -> Self {
        Self { format, process, repeats: Mutex::default(), now_ns }
    }

    /// Returns how often an event was left out since its previous line, or `None` if it is left out now.
    fn admit(&self, event: &Event<'_>, content: &EventContent) -> Option<u64> {
        // Each trace event and each span is about another item; so many would displace all others in the filter.
        if *event.metadata().level() == Level::TRACE || event.metadata().is_span() {
            return Some(0);
        }
        let mut hash = DefaultHasher::new();
        event.metadata().callsite().hash(&mut hash);
        content.text.hash(&mut hash);
        let mut repeats = self.repeats.lock().unwrap_or_else(PoisonError::into_inner);
        repeats.admit(hash.finish(), (self.now_ns)())
    }
}

impl<S, N> FormatEvent<S, N> for LineFormatter
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, context: &FmtContext<'_, S, N>, mut out: Writer<'_>, event: &Event<'_>) -> fmt::Result {
        let mut content = EventContent::default();
        event.record(&mut content);
        let Some(left_out) = self.admit(event, &content) else { return Ok(()) };
        for span in context.event_scope().into_iter().flatten() {
            if let Some(fields) = span.extensions().get::<FormattedFields<N>>() {
                content.add_span(span.name(), &fields.fields);
            }
        }
        let mut time = String::new();
        SystemTime.format_time(&mut Writer::new(&mut time))?;
        let (level, process) = (*event.metadata().level(), self.process);
        let line = LineContext { time: &time, level, process, left_out };
        match self.format {
            LogFormat::Text => content.write_text(&mut out, &line),
            LogFormat::Json => content.write_json(&mut out, &line),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::io::{self, Write};
    use std::sync::Arc;

    use serde_json::Value;

    use tracing_subscriber::fmt::format::FmtSpan;

    use super::*;
    use crate::log::span_fields::SpanFields;

    const SECOND_NS: u64 = 1_000_000_000;

    thread_local! {
        static NOW_NS: Cell<u64> = const { Cell::new(0) };
    }

    #[derive(Clone, Default)]
    struct Written(Arc<Mutex<Vec<u8>>>);

    impl Write for Written {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// Returns the log lines of some events, without the times at the start of text lines.
    fn lines(format: LogFormat, events: impl FnOnce()) -> Vec<String> {
        let written = Written::default();
        let writer = written.clone();
        let formatter = LineFormatter { now_ns: || NOW_NS.get(), ..LineFormatter::new(format, "phase") };
        let subscriber = tracing_subscriber::fmt().with_max_level(Level::TRACE).with_writer(move || writer.clone());
        let subscriber = subscriber.fmt_fields(SpanFields).with_span_events(FmtSpan::CLOSE);
        tracing::subscriber::with_default(subscriber.event_format(formatter).finish(), events);
        let text = String::from_utf8(written.0.lock().unwrap().clone()).unwrap();
        let without_time = |line: &str| match format {
            LogFormat::Text => line.split_once(' ').unwrap().1.to_owned(),
            LogFormat::Json => line.to_owned(),
        };
        text.lines().map(without_time).collect()
    }

    #[test]
    fn an_event_is_one_line() {
        let written = lines(LogFormat::Text, || {
            tracing::info!(service = "phase", count = 3, ok = true, "came\nback");
            tracing::warn!(error = %"a\u{1b}[2Jb", "no report");
            tracing::error!("disk full");
        });
        assert_eq!(
            written,
            [
                r#" INFO came\nback service="phase" count=3 ok=true"#,
                r" WARN no report error=a\u{1b}[2Jb",
                "ERROR disk full"
            ]
        );
    }

    #[test]
    fn json_keeps_types_and_names() {
        let written = lines(LogFormat::Json, || {
            tracing::warn!(service = "phase", count = 3, sd = 0.5, not = f64::NAN, level = "own", "it is\n{}", "gone");
        });
        let line: Value = serde_json::from_str(&written[0]).unwrap();
        assert_eq!(
            (&line["level"], &line["process"], &line["message"]),
            (&"WARN".into(), &"phase".into(), &"it is\ngone".into())
        );
        let fields = serde_json::json!({"service": "phase", "count": 3, "sd": 0.5, "not": "NaN", "level": "own"});
        assert_eq!((&line["fields"], line.get("repeated")), (&fields, None));
        assert!(line["time"].as_str().unwrap().ends_with('Z'));
    }

    #[test]
    fn repeats_are_left_out_and_counted() {
        let repeated = || {
            for second in 0..12 {
                NOW_NS.set(second * SECOND_NS);
                tracing::warn!(camera = 1, "no image");
                tracing::warn!(frame = second, "no image");
            }
        };
        let written = lines(LogFormat::Text, repeated);
        let with_camera: Vec<_> = written.iter().filter(|line| line.contains("camera")).collect();
        assert_eq!(with_camera, [" WARN no image camera=1", " WARN no image camera=1 (9 repeats left out)"]);
        assert_eq!(written.len(), 2 + 12);
        let written = lines(LogFormat::Json, repeated);
        let numbers =
            written.iter().filter_map(|line| serde_json::from_str::<Value>(line).unwrap()["repeated"].as_u64());
        assert_eq!(numbers.collect::<Vec<_>>(), [9]);
    }

    #[test]
    fn a_line_within_a_span_has_its_fields_and_the_end_of_the_span_its_times() {
        NOW_NS.set(0);
        let spans = || {
            for window in [7_u64, 8] {
                let span = tracing::debug_span!("window", stage = "phase", window, session = tracing::field::Empty);
                span.record("session", 3);
                span.in_scope(|| tracing::warn!("no image"));
            }
        };
        let written = lines(LogFormat::Json, spans);
        let written: Vec<Value> = written.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
        let messages: Vec<&str> = written.iter().filter_map(|line| line["message"].as_str()).collect();
        // The second warning repeats the first.
        assert_eq!(messages, ["no image", "close", "close"]);
        for (line, window) in written.iter().zip([7, 7, 8]) {
            let span = serde_json::json!({"name": "window", "stage": "phase", "window": window, "session": 3});
            assert_eq!(line["span"], span);
        }
        assert!(written[1]["fields"]["time.busy"].is_string() && written[1]["fields"]["time.idle"].is_string());
        let written = lines(LogFormat::Text, spans);
        assert_eq!(written[0], " WARN no image span=window session=3 stage=\"phase\" window=7");
        assert!(written[1].starts_with("DEBUG close time.busy="), "{}", written[1]);
        assert!(written[2].ends_with(" span=window session=3 stage=\"phase\" window=8"), "{}", written[2]);
    }

    #[test]
    fn trace_events_are_never_left_out() {
        NOW_NS.set(0);
        let written = lines(LogFormat::Text, || (0..3).for_each(|_| tracing::trace!("item")));
        assert_eq!(written, ["TRACE item"; 3]);
    }
}
