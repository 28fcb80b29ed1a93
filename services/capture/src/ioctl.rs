//! Calls to a V4L2 device, and its mapped buffers: the only unsafe code of the capture service.
//!
//! In: plain structs of the kernel interface. Out: the same structs, filled in by the driver, and the bytes of buffers.
//! Everything that could violate memory safety is in this file, so the rest of the crate is safe code:
//!
//! - Calls whose argument holds pointers have functions of their own.
//! - Unions are read here.
//! - The bytes of a buffer are borrowed together with its [`BufferToken`], the proof that the driver does not own it.
//!
//! To send buffers on as DMABUF, this file would need one more call (`VIDIOC_EXPBUF`) and a second memory type for
//! [`Mapping`].

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

/// Maximum number of planes of a buffer.
pub(crate) const MAX_PLANES: usize = 8;
/// Maximum length of a string control that is read, bytes.
const MAX_STRING_BYTES: u32 = 4096;
/// Protection and sharing of a mapping: the driver writes, and this program reads.
const PROT_READ: c_int = 1;
const MAP_SHARED: c_int = 1;

/// Structs of the kernel interface for which all zeros is a valid value: integers, arrays and unions of them, and null
/// pointers.
///
/// # Safety
/// All zeros must be a valid value of the type.
pub(crate) unsafe trait Zeroable: Copy {}

/// A call: its code, its name, and the type of its argument. In the public ones the argument holds no pointers.
pub(crate) struct Request<T> {
    code: vidioc::_IOC_TYPE,
    name: &'static str,
    argument: PhantomData<fn(&mut T)>,
}

impl<T> Request<T> {
    /// `code` must belong to the type `T`: the kernel writes as many bytes as the code states.
    const fn new(code: vidioc::_IOC_TYPE, name: &'static str) -> Self {
        Self { code, name, argument: PhantomData }
    }
}

macro_rules! zeroable {
    ($($name:ty),* $(,)?) => {
        // SAFETY: structs of integers, arrays and unions of them; in the two structs with pointers, null pointers.
        $(unsafe impl Zeroable for $name {})*
    };
}

zeroable! {
    v4l2_buffer, v4l2_capability, v4l2_dv_timings, v4l2_enum_dv_timings, v4l2_ext_control, v4l2_ext_controls,
    v4l2_fmtdesc, v4l2_format, v4l2_frmivalenum, v4l2_frmsizeenum, v4l2_input, v4l2_plane, v4l2_query_ext_ctrl,
    v4l2_querymenu, v4l2_requestbuffers, v4l2_streamparm,
}

macro_rules! requests {
    ($($name:ident: $argument:ty = $code:expr),* $(,)?) => {
        $(pub(crate) const $name: Request<$argument> = Request::new($code, concat!("VIDIOC_", stringify!($name)));)*
    };
}

// Each code contains the size of the type beside it, from which the `v4l` crate or `call_code` computed it.
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
    S_DV_TIMINGS: v4l2_dv_timings = call_code::<v4l2_dv_timings>(READ_WRITE, b'V', 87),
    G_DV_TIMINGS: v4l2_dv_timings = call_code::<v4l2_dv_timings>(READ_WRITE, b'V', 88),
    ENUM_DV_TIMINGS: v4l2_enum_dv_timings = call_code::<v4l2_enum_dv_timings>(READ_WRITE, b'V', 98),
    QUERY_DV_TIMINGS: v4l2_dv_timings = call_code::<v4l2_dv_timings>(READ, b'V', 99),
}

// The arguments of these calls hold pointers. Only functions of this file make the calls.
const QUERYBUF: Request<v4l2_buffer> = Request::new(vidioc::VIDIOC_QUERYBUF, "VIDIOC_QUERYBUF");
const QBUF: Request<v4l2_buffer> = Request::new(vidioc::VIDIOC_QBUF, "VIDIOC_QBUF");
const DQBUF: Request<v4l2_buffer> = Request::new(vidioc::VIDIOC_DQBUF, "VIDIOC_DQBUF");
const G_EXT_CTRLS: Request<v4l2_ext_controls> = Request::new(vidioc::VIDIOC_G_EXT_CTRLS, "VIDIOC_G_EXT_CTRLS");
const UVC_CTRL_QUERY: Request<UvcControlQuery> =
    Request::new(call_code::<UvcControlQuery>(READ_WRITE, b'u', 0x21), "UVCIOC_CTRL_QUERY");
const S_EXT_CTRLS: Request<v4l2_ext_controls> = Request::new(vidioc::VIDIOC_S_EXT_CTRLS, "VIDIOC_S_EXT_CTRLS");

/// Directions of a call, as in the kernel's `_IOC`.
const READ: vidioc::_IOC_TYPE = 2;
const READ_WRITE: vidioc::_IOC_TYPE = 3;

/// Computes the code of a call that the `v4l` crate lacks. `group` is the letter of its family.
const fn call_code<T>(direction: vidioc::_IOC_TYPE, group: u8, number: vidioc::_IOC_TYPE) -> vidioc::_IOC_TYPE {
    direction << 30 | (size_of::<T>() as vidioc::_IOC_TYPE) << 16 | (group as vidioc::_IOC_TYPE) << 8 | number
}

/// `uvc_xu_control_query`: the argument of a query to an extension unit.
#[repr(C)]
struct UvcControlQuery {
    unit: u8,
    selector: u8,
    query: u8,
    size: u16,
    data: *mut u8,
}

/// A call that the driver refused.
#[derive(Debug, thiserror::Error)]
#[error("{call}: {source}{}", hint(source))]
pub struct CallError {
    /// Name of the call.
    pub call: &'static str,
    /// Error of the driver.
    #[source]
    pub source: io::Error,
}

/// Explains an error whose usual text is unclear.
fn hint(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::ResourceBusy => "; another program uses the device: close it",
        _ => "",
    }
}

impl CallError {
    /// Returns the number of the error.
    #[must_use]
    pub(crate) fn errno(&self) -> Option<rustix::io::Errno> {
        rustix::io::Errno::from_io_error(&self.source)
    }
}

/// Returns a value of all zeros.
pub(crate) fn zeroed<T: Zeroable>() -> T {
    // SAFETY: `Zeroable` is only implemented for types of which all zeros is a valid value.
    unsafe { std::mem::zeroed() }
}

/// An open device.
#[derive(Debug)]
pub(crate) struct Device {
    fd: OwnedFd,
    /// Number of calls and waits that a signal interrupted.
    interrupted: Cell<u64>,
}

/// Kind of the buffers of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BufferKind {
    /// `v4l2_buf_type`.
    pub(crate) code: u32,
    /// Number of planes of a buffer, each with its own memory; `None` for a single-planar device.
    pub(crate) planes: Option<u32>,
}

/// Mapped memory of one plane of a buffer.
#[derive(Debug)]
pub(crate) struct Mapping {
    start: *const u8,
    length: usize,
    /// Stream and index of the buffer.
    stream: u64,
    index: u32,
}

/// Proof that the driver does not own a buffer: it was not queued yet, or it was dequeued. Each buffer has at most one
/// token.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct BufferToken {
    stream: u64,
    pub(crate) index: u32,
}

/// Metadata of a buffer that the driver filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BufferMetadata {
    /// `V4L2_BUF_FLAG_…`.
    pub(crate) flags: u32,
    /// Sequence number of the image; it wraps.
    pub(crate) sequence: u32,
    /// Time stamp, seconds and microseconds of the clock that the flags name.
    pub(crate) stamp: [i64; 2],
    /// Start and end of the image in its (first) plane, bytes.
    pub(crate) bytes: [usize; 2],
}

impl Device {
    /// Opens a device in non-blocking mode.
    ///
    /// # Errors
    /// As `open(2)`.
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        let flags = OFlags::RDWR | OFlags::NONBLOCK | OFlags::CLOEXEC;
        Ok(Self { fd: rustix::fs::open(path, flags, Mode::empty())?, interrupted: Cell::new(0) })
    }

    /// Makes a call, and repeats it if a signal interrupts it.
    ///
    /// # Errors
    /// The driver refuses it.
    pub(crate) fn call<T>(&self, request: &Request<T>, argument: &mut T) -> Result<(), CallError> {
        loop {
            let argument = ptr::from_mut(argument).cast::<c_void>();
            // SAFETY: the code belongs to the type, see `Request`, so the kernel reads and writes only this argument.
            // If the argument holds pointers, the functions below set them, and they are valid during the call.
            let done = unsafe { v4l::v4l2::ioctl(self.fd.as_raw_fd(), request.code, argument) };
            match done {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => self.count_interruption(),
                done => return done.map_err(|source| CallError { call: request.name, source }),
            }
        }
    }

    /// Counts a wait or a call that a signal interrupted.
    pub(crate) fn count_interruption(&self) {
        self.interrupted.set(self.interrupted.get() + 1);
    }

    /// Returns the number of interruptions since the last call of this method.
    pub(crate) fn take_interruptions(&self) -> u64 {
        self.interrupted.take()
    }

    /// Reads an integer control of 32 bits, or of 64 bits if `is_64`.
    ///
    /// # Errors
    /// The driver refuses it.
    pub(crate) fn integer_control(&self, id: u32, is_64: bool) -> Result<i64, CallError> {
        let mut control = v4l2_ext_control { id, ..zeroed() };
        self.call_controls(&G_EXT_CTRLS, &mut control)?;
        let value = control.__bindgen_anon_1;
        // SAFETY: both variants are integers, in bytes that were zeroed or written by the kernel.
        Ok(unsafe { if is_64 { value.value64 } else { i64::from(value.value) } })
    }

    /// Sets an integer control of 32 bits, or of 64 bits if `is_64`.
    ///
    /// # Errors
    /// The driver refuses the value, or it does not fit into 32 bits.
    pub(crate) fn set_integer_control(&self, id: u32, is_64: bool, value: i64) -> Result<(), CallError> {
        let mut control: v4l2_ext_control = v4l2_ext_control { id, ..zeroed() };
        if is_64 {
            control.__bindgen_anon_1.value64 = value;
        } else {
            let out_of_range = || CallError { call: S_EXT_CTRLS.name, source: rustix::io::Errno::RANGE.into() };
            control.__bindgen_anon_1.value = i32::try_from(value).map_err(|_| out_of_range())?;
        }
        self.call_controls(&S_EXT_CTRLS, &mut control)
    }

    /// Reads a string control of at most `max_bytes`.
    ///
    /// # Errors
    /// The driver refuses it.
    pub(crate) fn string_control(&self, id: u32, max_bytes: u32) -> Result<String, CallError> {
        let size = max_bytes.min(MAX_STRING_BYTES) + 1;
        let mut bytes = vec![0_u8; size as usize];
        let mut control = v4l2_ext_control { id, size, ..zeroed() };
        control.__bindgen_anon_1.string = bytes.as_mut_ptr().cast();
        self.call_controls(&G_EXT_CTRLS, &mut control)?;
        let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
        Ok(String::from_utf8_lossy(&bytes[..end]).into_owned())
    }

    /// Sets a string control.
    ///
    /// # Errors
    /// The driver refuses it.
    pub(crate) fn set_string_control(&self, id: u32, value: &CString) -> Result<(), CallError> {
        let mut bytes = value.as_bytes_with_nul().to_vec();
        let mut control = v4l2_ext_control { id, size: bytes.len() as u32, ..zeroed() };
        // The kernel may write up to `size` bytes, so it gets a copy of that size.
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
        // The control and the string that it may point to outlive the call.
        controls.controls = control;
        self.call(request, &mut controls)
    }

    /// Queries a control of an extension unit of a UVC device. `query` is the code of the UVC request; `data` is sent
    /// by a request that sets the control, and filled by all others.
    ///
    /// # Errors
    /// The driver refuses it, or `data` is longer than a request can be.
    pub(crate) fn query_extension_unit(
        &self,
        [unit, selector]: [u8; 2],
        query: u8,
        data: &mut [u8],
    ) -> Result<(), CallError> {
        let too_long = |_| CallError { call: UVC_CTRL_QUERY.name, source: rustix::io::Errno::RANGE.into() };
        let size = u16::try_from(data.len()).map_err(too_long)?;
        // The data outlives the call, and the driver reads or writes `size` bytes of it.
        self.call(&UVC_CTRL_QUERY, &mut UvcControlQuery { unit, selector, query, size, data: data.as_mut_ptr() })
    }

    /// Returns the flags of a buffer that was requested.
    ///
    /// # Errors
    /// The driver refuses it.
    pub(crate) fn buffer_flags(&self, kind: BufferKind, index: u32) -> Result<u32, CallError> {
        let mut planes = [zeroed(); MAX_PLANES];
        let mut buffer = v4l2_buffer { index, ..buffer_argument(kind, &mut planes) };
        self.call(&QUERYBUF, &mut buffer)?;
        Ok(buffer.flags)
    }

    /// Maps the planes of a buffer of a stream, and returns its token: after `REQBUFS` the driver owns no buffer.
    ///
    /// # Errors
    /// The driver refuses it, or the memory cannot be mapped.
    pub(crate) fn map_buffer(
        &self,
        kind: BufferKind,
        stream: u64,
        index: u32,
    ) -> Result<(Vec<Mapping>, BufferToken), CallError> {
        let mut planes = [zeroed(); MAX_PLANES];
        let mut buffer = v4l2_buffer { index, ..buffer_argument(kind, &mut planes) };
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
        Ok((mappings, BufferToken { stream, index }))
    }

    fn map(&self, offset: i64, length: usize, stream: u64, index: u32) -> Result<Mapping, CallError> {
        let fd = self.fd.as_raw_fd();
        // SAFETY: a new mapping at an address that the kernel chooses overlaps no memory of this program.
        let start = unsafe { v4l::v4l2::mmap(ptr::null_mut(), length, PROT_READ, MAP_SHARED, fd, offset) };
        let start = start.map_err(|source| CallError { call: "mmap", source })?.cast();
        Ok(Mapping { start, length, stream, index })
    }

    /// Gives a buffer to the driver.
    ///
    /// # Errors
    /// The driver refuses it; its token is returned with the error.
    pub(crate) fn queue_buffer(&self, kind: BufferKind, token: BufferToken) -> Result<(), (CallError, BufferToken)> {
        let mut planes = [zeroed(); MAX_PLANES];
        let mut buffer = v4l2_buffer { index: token.index, ..buffer_argument(kind, &mut planes) };
        self.call(&QBUF, &mut buffer).map_err(|error| (error, token))
    }

    /// Takes a filled buffer of a stream back from the driver.
    ///
    /// # Errors
    /// The driver refuses the call, with `EAGAIN` if no buffer is filled.
    pub(crate) fn dequeue_buffer(
        &self,
        kind: BufferKind,
        stream: u64,
    ) -> Result<(BufferToken, BufferMetadata), CallError> {
        let mut planes = [zeroed(); MAX_PLANES];
        let mut buffer = buffer_argument(kind, &mut planes);
        self.call(&DQBUF, &mut buffer)?;
        let [start, end] = match kind.planes {
            None => [0, buffer.bytesused],
            Some(_) => [planes[0].data_offset, planes[0].bytesused],
        };
        let metadata = BufferMetadata {
            flags: buffer.flags,
            sequence: buffer.sequence,
            stamp: [buffer.timestamp.tv_sec, buffer.timestamp.tv_usec],
            bytes: [start as usize, end as usize],
        };
        Ok((BufferToken { stream, index: buffer.index }, metadata))
    }
}

impl AsFd for Device {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

/// Returns the argument of a call about a buffer. It points to `planes`, which must outlive it.
fn buffer_argument(kind: BufferKind, planes: &mut [v4l2_plane; MAX_PLANES]) -> v4l2_buffer {
    let mut buffer = v4l2_buffer { type_: kind.code, memory: MEMORY_MMAP, ..zeroed() };
    if let Some(count) = kind.planes {
        // At most the length of `planes`, whatever number the driver reports.
        buffer.length = count.min(MAX_PLANES as u32);
        buffer.m.planes = planes.as_mut_ptr();
    }
    buffer
}

impl Mapping {
    /// Returns the bytes of a range, as far as they exist. Returns none if the token is that of another buffer.
    pub(crate) fn bytes<'a>(&'a self, token: &'a BufferToken, [start, end]: [usize; 2]) -> &'a [u8] {
        if (token.stream, token.index) != (self.stream, self.index) {
            return &[];
        }
        let end = end.min(self.length);
        // SAFETY: the memory is mapped for reading until this is dropped, and `length` bytes long. The driver does not
        // write while the token is borrowed, because queueing the buffer would consume the token.
        let all = unsafe { std::slice::from_raw_parts(self.start, self.length) };
        all.get(start..end).unwrap_or(&[])
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: `Device::map` mapped the memory with this length, and no slice of it exists any more. Unmapping such
        // a mapping cannot fail; if it did, the memory would only stay mapped.
        let _ = unsafe { v4l::v4l2::munmap(self.start.cast_mut().cast(), self.length) };
    }
}

/// Returns the format of a single-planar device.
pub(crate) fn single_planar(format: &mut v4l2_format) -> &mut v4l2_pix_format {
    // SAFETY: integers only, in bytes that are initialized.
    unsafe { &mut format.fmt.pix }
}

/// Returns a copy of the format of a multi-planar device; its struct is packed.
pub(crate) fn multi_planar(format: &v4l2_format) -> v4l2_pix_format_mplane {
    // SAFETY: as above.
    unsafe { format.fmt.pix_mp }
}

/// Sets the format of a multi-planar device.
pub(crate) fn set_multi_planar(format: &mut v4l2_format, value: v4l2_pix_format_mplane) {
    format.fmt.pix_mp = value;
}

/// Returns the parameters of a capture stream.
pub(crate) fn capture_parameters(parameters: &mut v4l2_streamparm) -> &mut v4l2_captureparm {
    // SAFETY: as above.
    unsafe { &mut parameters.parm.capture }
}

/// Returns the least and the greatest size of an enumerated item; they are equal if the size is discrete.
pub(crate) fn frame_sizes(size: &v4l2_frmsizeenum) -> [v4l2_frmsize_discrete; 2] {
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

/// Returns the shortest and the longest frame interval of an enumerated item, seconds; they are equal if the interval
/// is discrete.
pub(crate) fn frame_intervals(interval: &v4l2_frmivalenum) -> [v4l2_fract; 2] {
    // SAFETY: as above.
    unsafe {
        if interval.type_ == v4l::v4l_sys::v4l2_frmivaltypes_V4L2_FRMIVAL_TYPE_DISCRETE {
            return [interval.__bindgen_anon_1.discrete; 2];
        }
        let steps = interval.__bindgen_anon_1.stepwise;
        [steps.min, steps.max]
    }
}

/// Returns the name and the number of a menu item. The kind of the menu decides which of them is valid.
pub(crate) fn menu_item(item: &v4l2_querymenu) -> ([u8; 32], i64) {
    let content = item.__bindgen_anon_1;
    // SAFETY: as above.
    unsafe { (content.name, content.value) }
}

/// Returns the timings of a digital video signal.
pub(crate) fn video_timings(timings: &v4l2_dv_timings) -> v4l2_bt_timings {
    let content = timings.__bindgen_anon_1;
    // SAFETY: as above.
    unsafe { content.bt }
}
