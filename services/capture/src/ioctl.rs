//! The calls to a V4L2 device, and the memory it shares: the only unsafe code of the capture.
//!
//! In: plain structs of the kernel's interface. Out: the same, filled in by the driver, and the bytes of buffers. Everything
//! that could break memory is here, so that the rest of the crate is safe code: calls whose argument holds pointers are made
//! by functions of their own, unions are read here, and the bytes of a buffer are lent only to whoever shows that the driver
//! does not have it.
//!
//! Sending buffers on as DMABUF (`VIDIOC_EXPBUF`) would be one more call here and a second memory type of [`Mapping`].

#![allow(unsafe_code)]

use std::cell::Cell;
use std::ffi::CString;
use std::io;
use std::marker::PhantomData;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::os::raw::{c_int, c_void};
use std::path::Path;
use std::ptr;

use rustix::fs::{Mode, OFlags};
use v4l::v4l_sys::{
    V4L2_CTRL_WHICH_CUR_VAL, v4l2_bt_timings, v4l2_buffer, v4l2_capability, v4l2_captureparm, v4l2_dv_timings,
    v4l2_enum_dv_timings, v4l2_ext_control, v4l2_ext_controls, v4l2_fmtdesc, v4l2_format, v4l2_fract, v4l2_frmivalenum,
    v4l2_frmsize_discrete, v4l2_frmsizeenum, v4l2_input, v4l2_memory_V4L2_MEMORY_MMAP as MEMORY_MMAP, v4l2_pix_format,
    v4l2_pix_format_mplane, v4l2_plane, v4l2_query_ext_ctrl, v4l2_querymenu, v4l2_requestbuffers, v4l2_streamparm,
};
use v4l::v4l2::vidioc;

/// Most planes of a buffer.
const MAX_PLANES: usize = 8;
/// Longest text of a control that is read, bytes.
const LONGEST_TEXT: u32 = 4096;
/// Protection and sharing of a mapping: the driver writes, this program reads.
const PROT_READ: c_int = 1;
const MAP_SHARED: c_int = 1;

/// Structs of the kernel's interface for which all zeros is a value: numbers, arrays of numbers and unions of them, and null
/// pointers.
///
/// # Safety
/// Only for types of which that is true.
pub(crate) unsafe trait Plain: Copy {}

/// A call without pointers in its argument: its code, its name, and the type of its argument.
pub(crate) struct Request<T> {
    code: vidioc::_IOC_TYPE,
    name: &'static str,
    argument: PhantomData<fn(&mut T)>,
}

impl<T> Request<T> {
    /// `code` must belong to the type: the kernel writes as many bytes as the code says.
    const fn new(code: vidioc::_IOC_TYPE, name: &'static str) -> Self {
        Self { code, name, argument: PhantomData }
    }
}

macro_rules! plain {
    ($($name:ty),* $(,)?) => {
        // SAFETY: structs of integers, arrays and unions of them, and (in those two with pointers) null pointers.
        $(unsafe impl Plain for $name {})*
    };
}

plain! {
    v4l2_buffer, v4l2_capability, v4l2_dv_timings, v4l2_enum_dv_timings, v4l2_ext_control, v4l2_ext_controls, v4l2_fmtdesc,
    v4l2_format, v4l2_frmivalenum, v4l2_frmsizeenum, v4l2_input, v4l2_plane, v4l2_query_ext_ctrl, v4l2_querymenu,
    v4l2_requestbuffers, v4l2_streamparm,
}

macro_rules! requests {
    ($($name:ident: $argument:ty = $code:expr),* $(,)?) => {
        $(pub(crate) const $name: Request<$argument> = Request::new($code, concat!("VIDIOC_", stringify!($name)));)*
    };
}

// Each code was made of the size of the very type that stands beside it: by the crate, or by `code` below.
requests! {
    QUERYCAP: v4l2_capability = vidioc::VIDIOC_QUERYCAP,
    ENUM_FMT: v4l2_fmtdesc = vidioc::VIDIOC_ENUM_FMT,
    ENUM_FRAMESIZES: v4l2_frmsizeenum = vidioc::VIDIOC_ENUM_FRAMESIZES,
    ENUM_FRAMEINTERVALS: v4l2_frmivalenum = vidioc::VIDIOC_ENUM_FRAMEINTERVALS,
    G_FMT: v4l2_format = vidioc::VIDIOC_G_FMT,
    S_FMT: v4l2_format = vidioc::VIDIOC_S_FMT,
    G_PARM: v4l2_streamparm = vidioc::VIDIOC_G_PARM,
    S_PARM: v4l2_streamparm = vidioc::VIDIOC_S_PARM,
    ENUMINPUT: v4l2_input = vidioc::VIDIOC_ENUMINPUT,
    G_INPUT: c_int = vidioc::VIDIOC_G_INPUT,
    QUERY_EXT_CTRL: v4l2_query_ext_ctrl = vidioc::VIDIOC_QUERY_EXT_CTRL,
    QUERYMENU: v4l2_querymenu = vidioc::VIDIOC_QUERYMENU,
    REQBUFS: v4l2_requestbuffers = vidioc::VIDIOC_REQBUFS,
    STREAMON: c_int = vidioc::VIDIOC_STREAMON,
    STREAMOFF: c_int = vidioc::VIDIOC_STREAMOFF,
    S_DV_TIMINGS: v4l2_dv_timings = code::<v4l2_dv_timings>(READ_WRITE, 87),
    G_DV_TIMINGS: v4l2_dv_timings = code::<v4l2_dv_timings>(READ_WRITE, 88),
    ENUM_DV_TIMINGS: v4l2_enum_dv_timings = code::<v4l2_enum_dv_timings>(READ_WRITE, 98),
    QUERY_DV_TIMINGS: v4l2_dv_timings = code::<v4l2_dv_timings>(READ, 99),
}

// These hold pointers and are called by functions here alone.
const QUERYBUF: Request<v4l2_buffer> = Request::new(vidioc::VIDIOC_QUERYBUF, "VIDIOC_QUERYBUF");
const QBUF: Request<v4l2_buffer> = Request::new(vidioc::VIDIOC_QBUF, "VIDIOC_QBUF");
const DQBUF: Request<v4l2_buffer> = Request::new(vidioc::VIDIOC_DQBUF, "VIDIOC_DQBUF");
const G_EXT_CTRLS: Request<v4l2_ext_controls> = Request::new(vidioc::VIDIOC_G_EXT_CTRLS, "VIDIOC_G_EXT_CTRLS");
const S_EXT_CTRLS: Request<v4l2_ext_controls> = Request::new(vidioc::VIDIOC_S_EXT_CTRLS, "VIDIOC_S_EXT_CTRLS");

/// Directions of a call, as in the kernel's `_IOC`.
const READ: vidioc::_IOC_TYPE = 2;
const READ_WRITE: vidioc::_IOC_TYPE = 3;

/// Code of a call that the crate lacks.
const fn code<T>(direction: vidioc::_IOC_TYPE, number: vidioc::_IOC_TYPE) -> vidioc::_IOC_TYPE {
    direction << 30 | (size_of::<T>() as vidioc::_IOC_TYPE) << 16 | (b'V' as vidioc::_IOC_TYPE) << 8 | number
}

/// A call that the driver refused.
#[derive(Debug, thiserror::Error)]
#[error("{call}: {source}{}", hint(source))]
pub struct CallError {
    /// Name of the call.
    pub call: &'static str,
    /// What the driver said.
    #[source]
    pub source: io::Error,
}

/// What an error means where its usual words do not say so.
fn hint(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::ResourceBusy => "; another program uses the device",
        _ => "",
    }
}

impl CallError {
    /// Number of the error.
    #[must_use]
    pub(crate) fn errno(&self) -> Option<rustix::io::Errno> {
        rustix::io::Errno::from_io_error(&self.source)
    }
}

/// All zeros.
pub(crate) fn zeroed<T: Plain>() -> T {
    // SAFETY: `Plain` is only implemented for types of which this is a value.
    unsafe { std::mem::zeroed() }
}

/// An open device.
#[derive(Debug)]
pub(crate) struct Device {
    fd: OwnedFd,
    /// Calls that a signal cut short, and that were made again.
    interrupted: Cell<u64>,
}

/// Which kind of buffers a device has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BufferKind {
    /// `v4l2_buf_type`.
    pub(crate) code: u32,
    /// Planes of a buffer in memory of their own; `None` for a single-planar device.
    pub(crate) planes: Option<u32>,
}

/// Memory of one plane of a buffer.
#[derive(Debug)]
pub(crate) struct Mapping {
    start: *const u8,
    length: usize,
    /// The buffer it belongs to.
    stream: u64,
    index: u32,
}

/// Shows that the driver does not have a buffer: it was not given away yet, or was taken back. There is one for each buffer.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Held {
    stream: u64,
    pub(crate) index: u32,
}

/// What the driver says of a buffer that it filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Filled {
    /// `V4L2_BUF_FLAG_…`.
    pub(crate) flags: u32,
    /// Number of the image.
    pub(crate) sequence: u32,
    /// Time stamp: seconds and microseconds of the clock that the flags tell.
    pub(crate) stamp: [i64; 2],
    /// Where the image begins and ends in its (first) plane.
    pub(crate) bytes: [usize; 2],
}

impl Device {
    /// Opens a device; calls do not wait.
    ///
    /// # Errors
    /// As `open(2)`.
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        let flags = OFlags::RDWR | OFlags::NONBLOCK | OFlags::CLOEXEC;
        Ok(Self { fd: rustix::fs::open(path, flags, Mode::empty())?, interrupted: Cell::new(0) })
    }

    /// Makes a call; one that a signal cut short is made again.
    ///
    /// # Errors
    /// The driver refuses it.
    pub(crate) fn call<T>(&self, request: &Request<T>, argument: &mut T) -> Result<(), CallError> {
        loop {
            let argument = ptr::from_mut(argument).cast::<c_void>();
            // SAFETY: the code belongs to the type, see `Request`, so the kernel reads and writes this argument alone. Where
            // it holds pointers, the functions below made them, and they are valid for the call.
            let done = unsafe { v4l::v4l2::ioctl(self.fd.as_raw_fd(), request.code, argument) };
            match done {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => self.count_interruption(),
                done => return done.map_err(|source| CallError { call: request.name, source }),
            }
        }
    }

    /// Counts a wait or a call that a signal cut short.
    pub(crate) fn count_interruption(&self) {
        self.interrupted.set(self.interrupted.get() + 1);
    }

    /// Interruptions since this was asked last.
    pub(crate) fn take_interruptions(&self) -> u64 {
        self.interrupted.take()
    }

    /// Value of a control that is a number: 32 bits, or 64.
    ///
    /// # Errors
    /// The driver refuses it.
    pub(crate) fn number(&self, id: u32, is_64: bool) -> Result<i64, CallError> {
        let mut control = v4l2_ext_control { id, ..zeroed() };
        self.call_controls(&G_EXT_CTRLS, &mut control)?;
        let value = control.__bindgen_anon_1;
        // SAFETY: both are integers in bytes that were zeros or written by the kernel.
        Ok(unsafe { if is_64 { value.value64 } else { i64::from(value.value) } })
    }

    /// Sets a control that is a number. What does not fit 32 bits of a control that has no more is refused as out of range.
    ///
    /// # Errors
    /// The driver refuses it.
    pub(crate) fn set_number(&self, id: u32, is_64: bool, value: i64) -> Result<(), CallError> {
        let mut control: v4l2_ext_control = v4l2_ext_control { id, ..zeroed() };
        if is_64 {
            control.__bindgen_anon_1.value64 = value;
        } else {
            let out_of_range = || CallError { call: S_EXT_CTRLS.name, source: rustix::io::Errno::RANGE.into() };
            control.__bindgen_anon_1.value = i32::try_from(value).map_err(|_| out_of_range())?;
        }
        self.call_controls(&S_EXT_CTRLS, &mut control)
    }

    /// Value of a control that is a text of at most `longest` bytes.
    ///
    /// # Errors
    /// The driver refuses it.
    pub(crate) fn text(&self, id: u32, longest: u32) -> Result<String, CallError> {
        let size = longest.min(LONGEST_TEXT) + 1;
        let mut bytes = vec![0_u8; size as usize];
        let mut control = v4l2_ext_control { id, size, ..zeroed() };
        control.__bindgen_anon_1.string = bytes.as_mut_ptr().cast();
        self.call_controls(&G_EXT_CTRLS, &mut control)?;
        let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
        Ok(String::from_utf8_lossy(&bytes[..end]).into_owned())
    }

    /// Sets a control that is a text.
    ///
    /// # Errors
    /// The driver refuses it.
    pub(crate) fn set_text(&self, id: u32, value: &CString) -> Result<(), CallError> {
        let mut bytes = value.as_bytes_with_nul().to_vec();
        let mut control = v4l2_ext_control { id, size: bytes.len() as u32, ..zeroed() };
        // The kernel may only write as many bytes as `size` says, into bytes that are ours.
        control.__bindgen_anon_1.string = bytes.as_mut_ptr().cast();
        self.call_controls(&S_EXT_CTRLS, &mut control)
    }

    fn call_controls(
        &self,
        request: &Request<v4l2_ext_controls>,
        control: &mut v4l2_ext_control,
    ) -> Result<(), CallError> {
        let mut controls: v4l2_ext_controls = zeroed();
        controls.__bindgen_anon_1.which = V4L2_CTRL_WHICH_CUR_VAL;
        controls.count = 1;
        // Outlives the call, as does the text it may point to.
        controls.controls = control;
        self.call(request, &mut controls)
    }

    /// Maps the planes of a buffer of a stream, and shows that the driver does not have it: that is so after `REQBUFS`.
    ///
    /// # Errors
    /// The driver refuses it, or the memory cannot be mapped.
    pub(crate) fn map_buffer(
        &self,
        kind: BufferKind,
        stream: u64,
        index: u32,
    ) -> Result<(Vec<Mapping>, Held), CallError> {
        let mut planes = [zeroed(); MAX_PLANES];
        let mut buffer = v4l2_buffer { index, ..buffer(kind, &mut planes) };
        self.call(&QUERYBUF, &mut buffer)?;
        // SAFETY: integers in bytes that the kernel wrote.
        let single = unsafe { [buffer.m.offset, buffer.length] };
        // SAFETY: as above.
        let places: Vec<[u32; 2]> = match kind.planes {
            None => vec![single],
            Some(n) => planes.iter().take(n as usize).map(|p| unsafe { [p.m.mem_offset, p.length] }).collect(),
        };
        let map = |[offset, length]: [u32; 2]| self.map(i64::from(offset), length as usize, stream, index);
        let mappings = places.into_iter().map(map).collect::<Result<_, _>>()?;
        Ok((mappings, Held { stream, index }))
    }

    fn map(&self, offset: i64, length: usize, stream: u64, index: u32) -> Result<Mapping, CallError> {
        let fd = self.fd.as_raw_fd();
        // SAFETY: a new mapping at a place that the kernel chooses touches no memory of this program.
        let start = unsafe { v4l::v4l2::mmap(ptr::null_mut(), length, PROT_READ, MAP_SHARED, fd, offset) };
        let start = start.map_err(|source| CallError { call: "mmap", source })?.cast();
        Ok(Mapping { start, length, stream, index })
    }

    /// Gives a buffer to the driver. One that it refuses stays held.
    ///
    /// # Errors
    /// The driver refuses it; the buffer comes back with the error.
    pub(crate) fn queue_buffer(&self, kind: BufferKind, held: Held) -> Result<(), (CallError, Held)> {
        let mut planes = [zeroed(); MAX_PLANES];
        let mut buffer = v4l2_buffer { index: held.index, ..buffer(kind, &mut planes) };
        self.call(&QBUF, &mut buffer).map_err(|error| (error, held))
    }

    /// Takes a buffer of a stream back from the driver.
    ///
    /// # Errors
    /// The driver refuses it: `EAGAIN` where none is filled.
    pub(crate) fn dequeue_buffer(&self, kind: BufferKind, stream: u64) -> Result<(Held, Filled), CallError> {
        let mut planes = [zeroed(); MAX_PLANES];
        let mut buffer = buffer(kind, &mut planes);
        self.call(&DQBUF, &mut buffer)?;
        let [start, end] = match kind.planes {
            None => [0, buffer.bytesused],
            Some(_) => [planes[0].data_offset, planes[0].bytesused],
        };
        let filled = Filled {
            flags: buffer.flags,
            sequence: buffer.sequence,
            stamp: [buffer.timestamp.tv_sec, buffer.timestamp.tv_usec],
            bytes: [start as usize, end as usize],
        };
        Ok((Held { stream, index: buffer.index }, filled))
    }
}

impl AsFd for Device {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

/// A buffer of a kind, its planes in `planes`, which must outlive it.
fn buffer(kind: BufferKind, planes: &mut [v4l2_plane; MAX_PLANES]) -> v4l2_buffer {
    let mut buffer = v4l2_buffer { type_: kind.code, memory: MEMORY_MMAP, ..zeroed() };
    if let Some(count) = kind.planes {
        // No more than there are, whatever the driver says of its format.
        buffer.length = count.min(MAX_PLANES as u32);
        buffer.m.planes = planes.as_mut_ptr();
    }
    buffer
}

impl Mapping {
    /// The bytes from one place to another, as far as they exist; none without the buffer they belong to.
    pub(crate) fn bytes<'a>(&'a self, held: &'a Held, [start, end]: [usize; 2]) -> &'a [u8] {
        if (held.stream, held.index) != (self.stream, self.index) {
            return &[];
        }
        let end = end.min(self.length);
        // SAFETY: mapped for reading until this is dropped, `length` bytes long; while the buffer is held, the driver writes
        // nothing: giving it away takes the `Held` that is lent here.
        let all = unsafe { std::slice::from_raw_parts(self.start, self.length) };
        all.get(start..end).unwrap_or(&[])
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: mapped by `Device::map` with this length, and nobody has its bytes any more. It cannot fail for such a
        // mapping, and if it did, the memory would stay mapped, which harms nobody.
        let _ = unsafe { v4l::v4l2::munmap(self.start.cast_mut().cast(), self.length) };
    }
}

/// The format of a single-planar device.
pub(crate) fn single_planar(format: &mut v4l2_format) -> &mut v4l2_pix_format {
    // SAFETY: integers only, in bytes that are initialized.
    unsafe { &mut format.fmt.pix }
}

/// The format of a multi-planar device; it is packed, so it is copied.
pub(crate) fn multi_planar(format: &v4l2_format) -> v4l2_pix_format_mplane {
    // SAFETY: as above.
    unsafe { format.fmt.pix_mp }
}

/// Sets the format of a multi-planar device.
pub(crate) fn set_multi_planar(format: &mut v4l2_format, value: v4l2_pix_format_mplane) {
    format.fmt.pix_mp = value;
}

/// Parameters of a capture stream.
pub(crate) fn capture_parameters(parameters: &mut v4l2_streamparm) -> &mut v4l2_captureparm {
    // SAFETY: as above.
    unsafe { &mut parameters.parm.capture }
}

/// A size of an enumeration: least and greatest width and height; the same where there is one.
pub(crate) fn sizes(size: &v4l2_frmsizeenum) -> [v4l2_frmsize_discrete; 2] {
    // SAFETY: as above.
    unsafe {
        if size.type_ == v4l::v4l_sys::v4l2_frmsizetypes_V4L2_FRMSIZE_TYPE_DISCRETE {
            return [size.__bindgen_anon_1.discrete; 2];
        }
        let steps = size.__bindgen_anon_1.stepwise;
        let least = v4l2_frmsize_discrete { width: steps.min_width, height: steps.min_height };
        [least, v4l2_frmsize_discrete { width: steps.max_width, height: steps.max_height }]
    }
}

/// A frame interval of an enumeration: shortest and longest, seconds; the same where there is one.
pub(crate) fn intervals(interval: &v4l2_frmivalenum) -> [v4l2_fract; 2] {
    // SAFETY: as above.
    unsafe {
        if interval.type_ == v4l::v4l_sys::v4l2_frmivaltypes_V4L2_FRMIVAL_TYPE_DISCRETE {
            return [interval.__bindgen_anon_1.discrete; 2];
        }
        let steps = interval.__bindgen_anon_1.stepwise;
        [steps.min, steps.max]
    }
}

/// Name and number of an item of a menu: which of both counts depends on the kind of menu.
pub(crate) fn menu_item(item: &v4l2_querymenu) -> ([u8; 32], i64) {
    let content = item.__bindgen_anon_1;
    // SAFETY: as above.
    unsafe { (content.name, content.value) }
}

/// Timings of a digital video signal.
pub(crate) fn video_timings(timings: &v4l2_dv_timings) -> v4l2_bt_timings {
    let content = timings.__bindgen_anon_1;
    // SAFETY: as above.
    unsafe { content.bt }
}
