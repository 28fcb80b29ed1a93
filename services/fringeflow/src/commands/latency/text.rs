//! The latencies of a run as tables for the terminal.

use std::io::{self, Write};
use std::time::{Duration, UNIX_EPOCH};

use fringeflow_telemetry::Latency;

use crate::failure::Failure;
use crate::report::{RunFigures, StageLine, WindowLine};

/// Prints the figures.
pub(super) fn print(figures: &RunFigures<'_>) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    print_head(&mut out, figures)?;
    print_stages(&mut out, figures)?;
    print_segments(&mut out, figures)?;
    print_worst(&mut out, &figures.worst)?;
    Ok(())
}

fn print_head(out: &mut impl Write, figures: &RunFigures<'_>) -> io::Result<()> {
    let info = &figures.info;
    let instance = info.instance.unwrap_or("an instance without a name");
    let start =
        figures.started_wall_ms.map_or_else(|| "without an image".to_owned(), |ms| format!("from {}", wall_clock(ms)));
    writeln!(out, "{instance}: {:.1} s {start}, fringeflow {}", figures.duration_s, info.version)?;
    if figures.replayed {
        writeln!(
            out,
            "This run was a replay. Times count from the completion of a window. There is no latency from exposure to \
             cloud."
        )?;
    }
    if figures.windows_incomplete > 0 {
        let (left_out, windows) = (figures.windows_incomplete, figures.windows + figures.windows_incomplete);
        writeln!(
            out,
            "{left_out} of {windows} windows are left out below, because reports of their earlier stages are missing"
        )?;
    }
    Ok(())
}

fn print_stages(out: &mut impl Write, figures: &RunFigures<'_>) -> io::Result<()> {
    writeln!(out, "\n{:<21} {:>8}  {}", "stage", "count", titles())?;
    for StageLine { figures: stage, .. } in &figures.stages {
        if let Some(latency) = stage.latency {
            writeln!(out, "{:<21} {:>8}  {}", stage.stage, latency.count, times(latency))?;
        }
    }
    Ok(())
}

fn print_segments(out: &mut impl Write, figures: &RunFigures<'_>) -> io::Result<()> {
    if figures.windows == 0 {
        return writeln!(out, "\nNo window has the reports of all stages from exposure to cloud.");
    }
    writeln!(out, "\n{:<21} {:>8}  {}", "segment", "share %", titles())?;
    for line in &figures.segments {
        if let Some(latency) = line.latency {
            writeln!(out, "{:<21} {:>8.1}  {}", line.segment, line.share, times(latency))?;
        }
    }
    if let Some(total) = figures.exposure_to_cloud {
        writeln!(out, "{:<21} {:>8}  {}", "exposure to cloud", "", times(total))?;
    }
    Ok(())
}

fn print_worst(out: &mut impl Write, worst: &[WindowLine]) -> io::Result<()> {
    if worst.is_empty() {
        return Ok(());
    }
    writeln!(out, "\n{:<25} {:>8} {:>9}  cause", "slowest windows", "at s", "ms")?;
    for WindowLine { wall_ms, time_s, total_ms, cause, .. } in worst {
        writeln!(out, "{:<25} {time_s:>8.2} {total_ms:>9.1}  {cause}", wall_clock(*wall_ms))?;
    }
    Ok(())
}

fn titles() -> String {
    format!("{:>9} {:>9} {:>9} {:>9}", "p50 ms", "p90 ms", "p99 ms", "max ms")
}

fn times(latency: Latency) -> String {
    let Latency { p50_ms, p90_ms, p99_ms, max_ms, .. } = latency;
    [p50_ms, p90_ms, p99_ms, max_ms].map(|ms| format!("{ms:>9.2}")).join(" ")
}

/// A time in Unix milliseconds as UTC text.
fn wall_clock(unix_ms: f64) -> String {
    // A negative or non-finite time becomes the epoch.
    let since = Duration::try_from_secs_f64(unix_ms * 1e-3).unwrap_or_default();
    UNIX_EPOCH.checked_add(since).map_or_else(String::new, |time| humantime::format_rfc3339_millis(time).to_string())
}
