//! A window that covers a monitor, and the images that it shows. The images are stored in the X server once.

use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use x11rb::connection::Connection as _;
use x11rb::protocol::Event;
use x11rb::protocol::present::{CompleteKind, CompleteMode, ConnectionExt as _, EventMask};
use x11rb::protocol::xproto::{
    ConnectionExt as _, CreateGCAux, CreateWindowAux, Gcontext, ImageFormat, Pixmap, PropMode, StackMode, Window as Id,
    WindowClass,
};
use x11rb::wrapper::ConnectionExt as _;

use fringeflow_patterns::PatternImage;
use fringeflow_runtime::clock::now_ns;

use crate::{Monitor, ProjectorError, Screen};

/// Bytes of a pixel in the X server.
const PIXEL_BYTES: usize = 4;
/// Rows of an image that one request carries at most, bytes; every server takes so much.
const REQUEST_BYTES: usize = 200_000;
/// Longest wait for a refresh.
const SILENCE: Duration = Duration::from_secs(5);
/// Largest difference between the times of the server and the clock of this machine, seconds.
const MAX_OFF_S: f64 = 1.0;

/// A window over a whole monitor.
#[derive(Debug)]
pub(crate) struct Window<'a> {
    screen: &'a Screen,
    monitor: Monitor,
    id: Id,
    context: Gcontext,
    black: Pixmap,
}

/// An image in the X server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stored(Pixmap);

/// What the server tells of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Completion {
    /// Number of the request.
    pub(crate) serial: u32,
    /// What became of it.
    pub(crate) kind: Completed,
    /// Refreshes of the monitor so far.
    pub(crate) refresh: u64,
    /// Time of the vertical blank of that refresh, ns of `CLOCK_MONOTONIC`.
    pub(crate) time_ns: u64,
}

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Completed {
    /// The image is shown from this refresh on. Flipped images go straight to the monitor, others are copied.
    Shown {
        /// Whether it was flipped.
        flipped: bool,
    },
    /// A later image took its place.
    Skipped,
    /// The request asked for the time alone.
    Time,
}

impl<'a> Window<'a> {
    /// Covers a monitor in black, without a pointer.
    pub(crate) fn open(screen: &'a Screen, monitor: &Monitor) -> Result<Self, ProjectorError> {
        let (connection, root) = (&screen.connection, screen.root());
        let formats = &connection.setup().pixmap_formats;
        let bits_per_pixel =
            formats.iter().find(|format| format.depth == root.root_depth).map_or(0, |format| format.bits_per_pixel);
        if root.root_depth != 24 || bits_per_pixel != 32 {
            return Err(ProjectorError::Depth { depth: root.root_depth, bits_per_pixel });
        }
        let [width, height] = monitor.size_px.map(|side| side as u16);
        let [x, y] = monitor.place_px;
        let id = connection.generate_id()?;
        // No window manager may move, decorate or cover it.
        let values = CreateWindowAux::new().override_redirect(1).background_pixel(root.black_pixel);
        let class = WindowClass::INPUT_OUTPUT;
        connection.create_window(root.root_depth, id, root.root, x, y, width, height, 0, class, 0, &values)?;
        let context = connection.generate_id()?;
        connection.create_gc(context, id, &CreateGCAux::new())?;
        let black = connection.generate_id()?;
        connection.create_pixmap(root.root_depth, black, id, width, height)?;
        let window = Self { screen, monitor: monitor.clone(), id, context, black };
        window.fill_black()?;
        window.hide_pointer()?;
        // A compositor would show images later than the server tells.
        let bypass = connection.intern_atom(false, b"_NET_WM_BYPASS_COMPOSITOR")?.reply()?.atom;
        connection.change_property32(
            PropMode::REPLACE,
            id,
            bypass,
            x11rb::protocol::xproto::AtomEnum::CARDINAL,
            &[1],
        )?;
        connection.map_window(id)?;
        let raise = x11rb::protocol::xproto::ConfigureWindowAux::new().stack_mode(StackMode::ABOVE);
        connection.configure_window(id, &raise)?;
        let events = connection.generate_id()?;
        connection.present_select_input(events, id, EventMask::COMPLETE_NOTIFY)?.check()?;
        Ok(window)
    }

    fn fill_black(&self) -> Result<(), ProjectorError> {
        let connection = &self.screen.connection;
        let [width, height] = self.monitor.size_px.map(|side| side as u16);
        let area = x11rb::protocol::xproto::Rectangle { x: 0, y: 0, width, height };
        let black = x11rb::protocol::xproto::ChangeGCAux::new().foreground(self.screen.root().black_pixel);
        connection.change_gc(self.context, &black)?;
        connection.poly_fill_rectangle(self.black, self.context, &[area])?;
        Ok(())
    }

    fn hide_pointer(&self) -> Result<(), ProjectorError> {
        let connection = &self.screen.connection;
        let (mask, cursor) = (connection.generate_id()?, connection.generate_id()?);
        connection.create_pixmap(1, mask, self.id, 1, 1)?;
        let context = connection.generate_id()?;
        connection.create_gc(context, mask, &CreateGCAux::new().foreground(0))?;
        let pixel = x11rb::protocol::xproto::Rectangle { x: 0, y: 0, width: 1, height: 1 };
        connection.poly_fill_rectangle(mask, context, &[pixel])?;
        connection.create_cursor(cursor, mask, mask, 0, 0, 0, 0, 0, 0, 0, 0)?;
        let values = x11rb::protocol::xproto::ChangeWindowAttributesAux::new().cursor(cursor);
        connection.change_window_attributes(self.id, &values)?;
        connection.free_gc(context)?;
        connection.free_pixmap(mask)?;
        Ok(())
    }

    /// The dark image.
    pub(crate) fn black(&self) -> Stored {
        Stored(self.black)
    }

    /// Stores an image in the server.
    ///
    /// # Errors
    /// It has another size than the monitor.
    pub(crate) fn store(&self, image: &PatternImage) -> Result<Stored, ProjectorError> {
        let (connection, [width, height]) = (&self.screen.connection, self.monitor.size_px);
        if image.size_px != self.monitor.size_px {
            return Err(ProjectorError::Size {
                monitor: self.monitor.name.clone(),
                patterns_px: image.size_px,
                monitor_px: self.monitor.size_px,
            });
        }
        let depth = self.screen.root().root_depth;
        let pixmap = connection.generate_id()?;
        connection.create_pixmap(depth, pixmap, self.id, width as u16, height as u16)?.check()?;
        let rows = (REQUEST_BYTES / (width * PIXEL_BYTES)).max(1);
        for (part, levels) in image.levels.chunks(rows * width).enumerate() {
            // A grey level is the same in all colours, so their order does not matter.
            let pixels: Vec<u8> = levels.iter().flat_map(|&level| [level; PIXEL_BYTES]).collect();
            let (rows_here, top) = ((levels.len() / width) as u16, (part * rows) as i16);
            let format = ImageFormat::Z_PIXMAP;
            connection.put_image(format, pixmap, self.context, width as u16, rows_here, 0, top, 0, depth, &pixels)?;
        }
        Ok(Stored(pixmap))
    }

    /// Asks to show an image from a refresh on.
    pub(crate) fn present(&self, image: Stored, serial: u32, refresh: u64) -> Result<(), ProjectorError> {
        let none = x11rb::NONE;
        let connection = &self.screen.connection;
        connection.present_pixmap(
            self.id,
            image.0,
            serial,
            none,
            none,
            0,
            0,
            none,
            none,
            none,
            0,
            refresh,
            0,
            0,
            &[],
        )?;
        Ok(connection.flush()?)
    }

    /// Waits until a refresh, and returns its number and time. Discards what is told of images meanwhile.
    pub(crate) fn time(&self, refresh: u64) -> Result<Completion, ProjectorError> {
        let connection = &self.screen.connection;
        connection.present_notify_msc(self.id, 0, refresh, 0, 0)?;
        let start = Instant::now();
        while start.elapsed() < SILENCE {
            if let Some(told) = self.wait(SILENCE)?.filter(|told| told.kind == Completed::Time) {
                let off_s = (told.time_ns as f64 - now_ns() as f64) / 1e9;
                let is_near = off_s.abs() <= MAX_OFF_S;
                return is_near.then_some(told).ok_or(ProjectorError::Clock { off_s });
            }
        }
        Err(self.silent())
    }

    pub(crate) fn silent(&self) -> ProjectorError {
        ProjectorError::Silent { monitor: self.monitor.name.clone(), seconds: SILENCE.as_secs() }
    }

    /// Waits for what the server tells; `None` if it tells nothing in this time. A signal ends the wait.
    pub(crate) fn wait(&self, timeout: Duration) -> Result<Option<Completion>, ProjectorError> {
        let connection = &self.screen.connection;
        connection.flush()?;
        let end = Instant::now() + timeout;
        loop {
            while let Some(event) = connection.poll_for_event()? {
                match event {
                    Event::PresentCompleteNotify(told) => return Ok(Some(completion(&told))),
                    Event::Error(error) => return Err(ProjectorError::Server(format!("{error:?}"))),
                    _ => {}
                }
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            let time = Timespec { tv_sec: left.as_secs() as i64, tv_nsec: i64::from(left.subsec_nanos()) };
            match poll(&mut [PollFd::new(connection.stream(), PollFlags::IN)], Some(&time)) {
                Ok(_) => {}
                Err(Errno::INTR) => return Ok(None),
                Err(error) => return Err(std::io::Error::from(error).into()),
            }
        }
    }
}

fn completion(told: &x11rb::protocol::present::CompleteNotifyEvent) -> Completion {
    let kind = match (told.kind, told.mode) {
        (CompleteKind::NOTIFY_MSC, _) => Completed::Time,
        (_, CompleteMode::SKIP) => Completed::Skipped,
        (_, mode) => Completed::Shown { flipped: mode == CompleteMode::FLIP },
    };
    Completion { serial: told.serial, kind, refresh: told.msc, time_ns: told.ust * 1000 }
}
