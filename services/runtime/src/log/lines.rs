//! Events to lines, those that repeat themselves left out.

use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Mutex, PoisonError};

use tracing::{Event, Level, Subscriber};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::registry::LookupSpan;

use super::LogFormat;
use super::line::{Circumstances, Said};
use super::repeats::Repeats;
use crate::clock::now_ns;

/// Formats events; one that is left out becomes nothing.
#[derive(Debug)]
pub(super) struct Lines {
    format: LogFormat,
    process: &'static str,
    repeats: Mutex<Repeats>,
    now_ns: fn() -> u64,
}

impl Lines {
    pub(super) fn new(format: LogFormat, process: &'static str) -> Self {
        Self { format, process, repeats: Mutex::default(), now_ns }
    }

    /// How often an event was left out before; `None` if it is to be left out.
    fn say(&self, event: &Event<'_>, said: &Said) -> Option<u64> {
        // Each is about an item of its own, and so many would push out all others.
        if *event.metadata().level() == Level::TRACE {
            return Some(0);
        }
        let mut hash = DefaultHasher::new();
        event.metadata().callsite().hash(&mut hash);
        said.text.hash(&mut hash);
        let mut repeats = self.repeats.lock().unwrap_or_else(PoisonError::into_inner);
        repeats.say(hash.finish(), (self.now_ns)())
    }
}

impl<S, N> FormatEvent<S, N> for Lines
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, _: &FmtContext<'_, S, N>, mut out: Writer<'_>, event: &Event<'_>) -> fmt::Result {
        let mut said = Said::default();
        event.record(&mut said);
        let Some(left_out) = self.say(event, &said) else { return Ok(()) };
        let mut time = String::new();
        SystemTime.format_time(&mut Writer::new(&mut time))?;
        let (level, process) = (*event.metadata().level(), self.process);
        let about = Circumstances { time: &time, level, process, left_out };
        match self.format {
            LogFormat::Text => said.write_text(&mut out, &about),
            LogFormat::Json => said.write_json(&mut out, &about),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::io::{self, Write};
    use std::sync::Arc;

    use serde_json::Value;

    use super::*;

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

    /// The lines that come of some events; the times at their beginning are left out.
    fn lines(format: LogFormat, events: impl FnOnce()) -> Vec<String> {
        let written = Written::default();
        let writer = written.clone();
        let lines = Lines { now_ns: || NOW_NS.get(), ..Lines::new(format, "phase") };
        let subscriber = tracing_subscriber::fmt().with_max_level(Level::TRACE).with_writer(move || writer.clone());
        tracing::subscriber::with_default(subscriber.event_format(lines).finish(), events);
        let text = String::from_utf8(written.0.lock().unwrap().clone()).unwrap();
        let without_time = |line: &str| match format {
            LogFormat::Text => line.split_once(' ').unwrap().1.to_owned(),
            LogFormat::Json => line.to_owned(),
        };
        text.lines().map(without_time).collect()
    }

    #[test]
    fn an_event_is_one_line() {
        let said = lines(LogFormat::Text, || {
            tracing::info!(service = "phase", count = 3, ok = true, "came\nback");
            tracing::warn!(error = %"a\u{1b}[2Jb", "no report");
            tracing::error!("disk full");
        });
        assert_eq!(
            said,
            [
                r#" INFO came\nback service="phase" count=3 ok=true"#,
                r" WARN no report error=a\u{1b}[2Jb",
                "ERROR disk full"
            ]
        );
    }

    #[test]
    fn json_keeps_the_types_and_every_name() {
        let said = lines(LogFormat::Json, || {
            tracing::warn!(service = "phase", count = 3, sd = 0.5, not = f64::NAN, level = "own", "it is\n{}", "gone");
        });
        let line: Value = serde_json::from_str(&said[0]).unwrap();
        assert_eq!(
            (&line["level"], &line["process"], &line["message"]),
            (&"WARN".into(), &"phase".into(), &"it is\ngone".into())
        );
        let fields = serde_json::json!({"service": "phase", "count": 3, "sd": 0.5, "not": "NaN", "level": "own"});
        assert_eq!((&line["fields"], line.get("repeated")), (&fields, None));
        assert!(line["time"].as_str().unwrap().ends_with('Z'));
    }

    #[test]
    fn what_repeats_itself_is_counted() {
        let repeated = || {
            for second in 0..12 {
                NOW_NS.set(second * SECOND_NS);
                tracing::warn!(camera = 1, "no image");
                tracing::warn!(frame = second, "no image");
            }
        };
        let said = lines(LogFormat::Text, repeated);
        let of_one: Vec<_> = said.iter().filter(|line| line.contains("camera")).collect();
        assert_eq!(of_one, [" WARN no image camera=1", " WARN no image camera=1 (9 times more since)"]);
        assert_eq!(said.len(), 2 + 12);
        let said = lines(LogFormat::Json, repeated);
        let numbers = said.iter().filter_map(|line| serde_json::from_str::<Value>(line).unwrap()["repeated"].as_u64());
        assert_eq!(numbers.collect::<Vec<_>>(), [9]);
    }

    #[test]
    fn every_item_is_told_at_the_lowest_level() {
        NOW_NS.set(0);
        let said = lines(LogFormat::Text, || (0..3).for_each(|_| tracing::trace!("item")));
        assert_eq!(said, ["TRACE item"; 3]);
    }
}
