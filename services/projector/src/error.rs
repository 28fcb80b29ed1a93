//! Why patterns cannot be shown.

use std::io;

use x11rb::errors::{ConnectError, ConnectionError, ReplyError, ReplyOrIdError};

use fringeflow_transport::TransportError;

/// Patterns cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum ProjectorError {
    /// There is no X server.
    #[error(
        "no X server {}: {source}; log in to a desktop with X11, or name the display with --display",
        name.as_deref().unwrap_or("in DISPLAY")
    )]
    Connect {
        /// Its name, if one was given.
        name: Option<String>,
        /// The system error.
        #[source]
        source: ConnectError,
    },
    /// The X server lacks an extension.
    #[error("the X server has no extension {0}, which tells when an image was shown; use X.Org 1.15 or later")]
    NoExtension(&'static str),
    /// The pixels of the X server are not grey levels of 8 bits in 32.
    #[error("the screen has {depth} bits a pixel in {bits_per_pixel}; set it to a depth of 24 (32 bits per pixel)")]
    Depth {
        /// Bits of a colour.
        depth: u8,
        /// Bits of a pixel in memory.
        bits_per_pixel: u8,
    },
    /// No monitor has this name.
    #[error("there is no monitor {wanted:?}; connected: {known}")]
    NoMonitor {
        /// The wanted name.
        wanted: String,
        /// The known ones.
        known: String,
    },
    /// Several monitors could be the projector.
    #[error("which of these monitors is the projector? Name it with --monitor: {known}")]
    WhichMonitor {
        /// The known ones.
        known: String,
    },
    /// The patterns have another size than the monitor.
    #[error(
        "the patterns have {} × {} pixels, monitor {monitor} {} × {}; set the resolution of the projector, or write \
         patterns of its size (fringeflow patterns --size)",
        patterns_px[0], patterns_px[1], monitor_px[0], monitor_px[1]
    )]
    Size {
        /// Name of the monitor.
        monitor: String,
        /// Size of the patterns as they are handed over, pixels.
        patterns_px: [usize; 2],
        /// Size of the monitor, pixels.
        monitor_px: [usize; 2],
    },
    /// The rate of the images is no divisor of the refresh rate.
    #[error(
        "{rate_hz} images a second do not divide the {refresh_hz:.2} refreshes of monitor {monitor}; set cameras.rate_hz to \
         {refresh_hz:.2} divided by a whole number"
    )]
    Rate {
        /// Name of the monitor.
        monitor: String,
        /// Images per second.
        rate_hz: f64,
        /// Refreshes per second.
        refresh_hz: f64,
    },
    /// The X server tells no refreshes.
    #[error("the X server did not answer for {seconds} s; is monitor {monitor} switched on?")]
    Silent {
        /// Name of the monitor.
        monitor: String,
        /// How long it was waited for.
        seconds: u64,
    },
    /// The times of the X server are those of another clock.
    #[error(
        "the times of the X server are {off_s:.1} s off CLOCK_MONOTONIC; run this command on the machine of the X server"
    )]
    Clock {
        /// Difference, seconds.
        off_s: f64,
    },
    /// A request to the X server failed.
    #[error("the X server: {0}")]
    Server(String),
    /// The system refused a call.
    #[error("waiting for the X server: {0}")]
    Wait(#[from] io::Error),
    /// The channels of the instance.
    #[error(transparent)]
    Transport(#[from] TransportError),
}

impl ProjectorError {
    /// Returns whether arguments, settings or the machine must change before another try.
    #[must_use]
    pub fn is_lasting(&self) -> bool {
        match self {
            Self::Server(_) | Self::Wait(_) | Self::Silent { .. } => false,
            Self::Transport(error) => error.is_lasting(),
            _ => true,
        }
    }
}

impl From<ConnectionError> for ProjectorError {
    fn from(error: ConnectionError) -> Self {
        Self::Server(error.to_string())
    }
}

impl From<ReplyError> for ProjectorError {
    fn from(error: ReplyError) -> Self {
        Self::Server(error.to_string())
    }
}

impl From<ReplyOrIdError> for ProjectorError {
    fn from(error: ReplyOrIdError) -> Self {
        Self::Server(error.to_string())
    }
}
