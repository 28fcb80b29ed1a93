//! The formats in which metrics are served: the text format of Prometheus, or OpenMetrics where a client asks for it.
//!
//! In: OpenMetrics as the registry writes it, and the header `Accept` of a request. Out: a media type and the text. In the text
//! format a counter is declared under the name of its series, with `_total`, and there are no units and no end mark.

use std::collections::HashSet;

/// Format of metrics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exposition {
    /// OpenMetrics.
    OpenMetrics,
    /// The text format of Prometheus.
    Text,
}

/// Media type of OpenMetrics, without its parameters.
const OPEN_METRICS: &str = "application/openmetrics-text";

impl Exposition {
    /// The format that a client accepts: text, unless it names OpenMetrics as Prometheus does.
    pub(crate) fn accepted(accept: &str) -> Self {
        if accept.contains(OPEN_METRICS) { Self::OpenMetrics } else { Self::Text }
    }

    /// Its media type.
    pub(crate) fn media_type(self) -> &'static str {
        match self {
            Self::OpenMetrics => "application/openmetrics-text; version=1.0.0; charset=utf-8",
            Self::Text => "text/plain; version=0.0.4; charset=utf-8",
        }
    }

    /// OpenMetrics in this format.
    pub(crate) fn of(self, open_metrics: String) -> String {
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
    fn text_is_served_unless_open_metrics_is_asked_for() {
        let prometheus = "application/openmetrics-text;version=1.0.0;q=0.6,text/plain;version=0.0.4;q=0.5,*/*;q=0.1";
        assert_eq!(Exposition::accepted(prometheus), Exposition::OpenMetrics);
        for accept in ["text/plain", "*/*", "", "text/html"] {
            assert_eq!(Exposition::accepted(accept), Exposition::Text, "{accept}");
        }
    }

    #[test]
    fn counters_are_declared_by_the_name_of_their_series() {
        let open_metrics = "# HELP a_seconds Time.\n# TYPE a_seconds counter\n# UNIT a_seconds seconds\n\
                            a_seconds_total{of=\"b\"} 1\n# HELP b Level.\n# TYPE b gauge\nb NaN\n# EOF\n";
        assert_eq!(
            Exposition::Text.of(open_metrics.to_owned()),
            "# HELP a_seconds_total Time.\n# TYPE a_seconds_total counter\na_seconds_total{of=\"b\"} 1\n\
             # HELP b Level.\n# TYPE b gauge\nb NaN\n"
        );
    }
}
