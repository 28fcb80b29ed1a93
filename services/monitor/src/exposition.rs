//! The formats of the metrics: the text format of Prometheus, or OpenMetrics if a client asks for it.
//!
//! In: the OpenMetrics text of the registry, and the header `Accept` of a request. Out: a media type and the text. The
//! text format declares a counter under the name of its series, with `_total`, and has no units and no end mark.

use std::collections::HashSet;

/// Format of the metrics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exposition {
    /// OpenMetrics.
    OpenMetrics,
    /// The text format of Prometheus.
    Text,
}

/// Media type of OpenMetrics without parameters.
const OPEN_METRICS: &str = "application/openmetrics-text";

impl Exposition {
    /// Chooses the format for a header `Accept`: OpenMetrics if the header names it, as that of Prometheus does, else
    /// text.
    pub(crate) fn from_accept(accept: &str) -> Self {
        if accept.contains(OPEN_METRICS) { Self::OpenMetrics } else { Self::Text }
    }

    /// Returns the media type of the format.
    pub(crate) fn media_type(self) -> &'static str {
        match self {
            Self::OpenMetrics => "application/openmetrics-text; version=1.0.0; charset=utf-8",
            Self::Text => "text/plain; version=0.0.4; charset=utf-8",
        }
    }

    /// Converts OpenMetrics text to this format.
    pub(crate) fn convert(self, open_metrics: String) -> String {
        match self {
            Self::OpenMetrics => open_metrics,
            Self::Text => to_text(&open_metrics),
        }
    }
}

fn to_text(open_metrics: &str) -> String {
    let counter = |line: &'_ str| Some(line.strip_prefix("# TYPE ")?.strip_suffix(" counter")?.to_owned());
    let counters: HashSet<String> = open_metrics.lines().filter_map(counter).collect();
    let line = |line: &str| match line.splitn(4, ' ').collect::<Vec<_>>()[..] {
        ["#", "EOF"] | ["#", "UNIT", ..] => String::new(),
        ["#", keyword, name, rest] if counters.contains(name) => format!("# {keyword} {name}_total {rest}\n"),
        _ => format!("{line}\n"),
    };
    open_metrics.lines().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_served_unless_the_client_asks_for_open_metrics() {
        let prometheus = "application/openmetrics-text;version=1.0.0;q=0.6,text/plain;version=0.0.4;q=0.5,*/*;q=0.1";
        assert_eq!(Exposition::from_accept(prometheus), Exposition::OpenMetrics);
        for accept in ["text/plain", "*/*", "", "text/html"] {
            assert_eq!(Exposition::from_accept(accept), Exposition::Text, "{accept}");
        }
    }

    #[test]
    fn counters_are_declared_under_the_name_of_their_series() {
        let open_metrics = "# HELP a_seconds Time.\n# TYPE a_seconds counter\n# UNIT a_seconds seconds\n\
                            a_seconds_total{of=\"b\"} 1\n# HELP b Level.\n# TYPE b gauge\nb NaN\n# EOF\n";
        assert_eq!(
            Exposition::Text.convert(open_metrics.to_owned()),
            "# HELP a_seconds_total Time.\n# TYPE a_seconds_total counter\na_seconds_total{of=\"b\"} 1\n\
             # HELP b Level.\n# TYPE b gauge\nb NaN\n"
        );
    }
}
