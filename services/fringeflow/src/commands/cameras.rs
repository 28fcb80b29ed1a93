//! `fringeflow cameras`: lists the V4L2 cameras and their capabilities.

use std::io::{self, Write};

use fringeflow_capture::{ListedControl, Listing, OfferedFormat, cameras, describe, rates_text};
use fringeflow_config::DeviceName;

use crate::acting_options::ActingOptions;
use crate::failure::Failure;
use crate::json;

/// Arguments of `fringeflow cameras`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Device to show: a path, "bus:" and a `bus_info`, or "serial:" and a serial number. The default is all cameras.
    device: Option<DeviceName>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(serde::Serialize)]
struct Listings {
    cameras: Vec<Listing>,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions::all(&["device", "json"]);

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        let listings = match &self.device {
            Some(device) => vec![describe(device).map_err(Failure::unusable)?],
            None => cameras(),
        };
        if self.json {
            return json::print(&Listings { cameras: listings });
        }
        let mut out = io::stdout().lock();
        if listings.is_empty() {
            writeln!(
                out,
                "No V4L2 camera was found. Check the cable. Check that the driver is loaded (`lsmod`; USB cameras use \
                 uvcvideo). In a container, check that it has access to /dev/video*."
            )?;
        }
        for listing in &listings {
            print(&mut out, listing)?;
        }
        Ok(())
    }
}

fn print(out: &mut impl Write, listing: &Listing) -> io::Result<()> {
    let named = !listing.card.is_empty() || !listing.driver.is_empty();
    let name = if named { format!(" {} ({})", listing.card, listing.driver) } else { String::new() };
    writeln!(out, "{}:{name}", listing.path.display())?;
    writeln!(out, "  device = {:?}", listing.device)?;
    let bus = (!listing.bus_info.is_empty()).then(|| format!("  bus:{}", listing.bus_info));
    let serial = listing.serial.as_ref().map(|serial| format!("  serial:{serial}"));
    if bus.is_some() || serial.is_some() {
        writeln!(out, "{}{}", bus.unwrap_or_default(), serial.unwrap_or_default())?;
    }
    for problem in &listing.problems {
        writeln!(out, "  problem: {problem}")?;
    }
    if let Some(signal) = &listing.video_signal {
        writeln!(out, "  video signal: set to {}, detected {}", signal.set, signal.seen)?;
    }
    if let Some(stamps) = &listing.time_stamps {
        writeln!(out, "  {stamps}")?;
    }
    let (taken, others): (Vec<_>, Vec<_>) = listing.formats.iter().partition(|format| format.is_taken);
    if !taken.is_empty() {
        writeln!(out, "  formats for cameras.format, with images per second in brackets")?;
    }
    taken.into_iter().try_for_each(|format| print_format(out, format))?;
    if !others.is_empty() {
        let names: Vec<&str> = others.iter().map(|format| format.name.as_str()).collect();
        writeln!(out, "  other formats: {}", names.join(", "))?;
    }
    if !listing.controls.is_empty() {
        writeln!(out, "  controls")?;
    }
    listing.controls.iter().try_for_each(|control| print_control(out, control))?;
    writeln!(out)
}

fn print_format(out: &mut impl Write, format: &OfferedFormat) -> io::Result<()> {
    let emulated = if format.is_emulated { ", emulated" } else { "" };
    writeln!(out, "    {:<4}  {}{emulated}", format.name, format.description)?;
    for size in &format.sizes {
        let rates = rates_text(&size.rates_hz);
        let rates = if rates.is_empty() { rates } else { format!(" ({rates})") };
        writeln!(out, "          {size}{rates}")?;
    }
    Ok(())
}

fn print_control(out: &mut impl Write, listed: &ListedControl) -> io::Result<()> {
    let ListedControl { control, value } = listed;
    let value = value.as_ref().map_or_else(String::new, |value| format!(" = {}", control.value_text(value)));
    let flags = listed.flags();
    let flags = if flags.is_empty() { String::new() } else { format!(" [{}]", flags.join(", ")) };
    writeln!(out, "    {}{value}: {control}{flags}", control.name)
}
