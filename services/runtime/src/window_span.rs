//! The span of a window in a stage, for logs and other subscribers of `tracing`.

use tracing::field::Empty;

use fringeflow_message::{Stage, Window};

/// Target of the spans. The log selects them by it: `FRINGEFLOW_LOG=info,fringeflow::window=trace`.
const TARGET: &str = "fringeflow::window";

/// The work of one stage on one window. It is busy while the stage works on the window, and idle while the window
/// waits. Nothing is measured unless a subscriber asks for it.
#[derive(Debug)]
pub struct WindowSpan(tracing::Span);

impl WindowSpan {
    /// Begins the span of the window with number `window` in the input of the stage.
    #[must_use]
    pub fn new(stage: Stage, window: u64) -> Self {
        let stage = stage.name();
        Self(tracing::trace_span!(target: TARGET, "window", stage, window, session = Empty, first_image = Empty))
    }

    /// Records what identifies the window in all stages: the session and the first image of camera 1.
    pub fn identify(&self, window: &Window) {
        self.0.record("session", window.cam1_session).record("first_image", window.cam1_sequence[0]);
    }

    /// Does work on the window.
    pub fn work<T>(&self, work: impl FnOnce() -> T) -> T {
        self.0.in_scope(work)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use tracing_subscriber::fmt::format::FmtSpan;

    use super::*;

    #[test]
    fn a_subscriber_sees_stage_window_session_and_first_image() {
        let written = Arc::new(Mutex::new(Vec::new()));
        let writer = Arc::clone(&written);
        let subscriber = tracing_subscriber::fmt().with_max_level(tracing::Level::TRACE).with_ansi(false);
        let subscriber = subscriber.with_span_events(FmtSpan::CLOSE).with_writer(move || Writer(Arc::clone(&writer)));
        tracing::subscriber::with_default(subscriber.finish(), || {
            let span = WindowSpan::new(Stage::Cloud, 7);
            let mut window = Window { cam1_session: 3, ..Window::default() };
            window.cam1_sequence[0] = 28;
            span.identify(&window);
            assert_eq!(span.work(|| 5), 5);
        });
        let text = String::from_utf8(written.lock().unwrap().clone()).unwrap();
        for part in ["stage=\"cloud\"", "window=7", "session=3", "first_image=28", "fringeflow::window", "time.busy="] {
            assert!(text.contains(part), "{part} is missing in {text}");
        }
        assert_eq!(text.lines().count(), 1, "{text}");
    }

    struct Writer(Arc<Mutex<Vec<u8>>>);

    impl std::io::Write for Writer {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
}
