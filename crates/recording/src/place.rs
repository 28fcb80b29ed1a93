//! Places of bytes in a recording, and the reader that fetches them.
//!
//! Bytes outside of compressed chunks are read where they are. A compressed chunk has to be unpacked as a whole, so the
//! chunks unpacked last are kept: messages that follow each other are usually in the same chunk.

use std::collections::VecDeque;
use std::fs::File;
use std::os::unix::fs::FileExt as _;
use std::sync::{Arc, Mutex, PoisonError};

use crate::RecordingProblem;
use crate::scan::{RECORD_HEAD_BYTES, chunk_records};

/// Maximum size of the unpacked chunks that are kept, bytes; a single larger one is kept too.
const KEPT_BYTES: usize = 64 << 20;

/// A part of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Start of the part in the file; in a compressed chunk, start of the chunk.
    pub(super) offset: u64,
    /// In a compressed chunk, start of the part in the unpacked records.
    pub(super) within: Option<usize>,
    pub(super) bytes: usize,
}

impl Place {
    /// Returns the place of the first `bytes` of this part.
    pub(super) fn start(self, bytes: usize) -> Self {
        Self { bytes, ..self }
    }

    /// Returns the place of the last `bytes` of this part.
    pub(super) fn end(self, bytes: usize) -> Self {
        let skipped = self.bytes.saturating_sub(bytes);
        match self.within {
            Some(within) => Self { within: Some(within + skipped), bytes, ..self },
            None => Self { offset: self.offset + skipped as u64, bytes, ..self },
        }
    }
}

/// Reads parts of a file that has been scanned.
#[derive(Debug)]
pub(super) struct PlaceReader {
    file: File,
    /// Unpacked chunks by their offset, the last used one at the end.
    kept: Mutex<VecDeque<(u64, Arc<Vec<u8>>)>>,
}

impl PlaceReader {
    pub(super) fn new(file: File) -> Self {
        Self { file, kept: Mutex::default() }
    }

    /// Reads a part. The scan has already read it, so its size is valid.
    pub(super) fn read(&self, place: Place) -> Result<Vec<u8>, RecordingProblem> {
        let Some(within) = place.within else { return self.read_file(place.offset, place.bytes) };
        let records = self.unpacked(place.offset)?;
        let part = records.get(within..).and_then(|rest| rest.get(..place.bytes));
        part.map(<[u8]>::to_vec).ok_or_else(|| changed(place.offset))
    }

    fn read_file(&self, offset: u64, bytes: usize) -> Result<Vec<u8>, RecordingProblem> {
        let mut buffer = vec![0; bytes];
        self.file.read_exact_at(&mut buffer, offset).map_err(RecordingProblem::Unreadable)?;
        Ok(buffer)
    }

    /// Returns the records of a compressed chunk.
    fn unpacked(&self, offset: u64) -> Result<Arc<Vec<u8>>, RecordingProblem> {
        // The kept chunks are valid at any time, even after a panic.
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let known = kept.iter().position(|(start, _)| *start == offset).and_then(|i| kept.remove(i));
        let records = match known {
            Some((_, records)) => records,
            None => Arc::new(self.unpack(offset)?),
        };
        kept.push_back((offset, Arc::clone(&records)));
        while kept.len() > 1 && kept.iter().map(|(_, records)| records.len()).sum::<usize>() > KEPT_BYTES {
            kept.pop_front();
        }
        Ok(records)
    }

    fn unpack(&self, offset: u64) -> Result<Vec<u8>, RecordingProblem> {
        let head = self.read_file(offset, RECORD_HEAD_BYTES as usize)?;
        let length = head.last_chunk::<8>().map_or(0, |length| u64::from_le_bytes(*length));
        let length = self.fits(offset, length).ok_or_else(|| changed(offset))?;
        let body = self.read_file(offset + RECORD_HEAD_BYTES, length)?;
        Ok(chunk_records(&body, offset)?.bytes.into_owned())
    }

    /// Returns a length that the file has after `offset`.
    fn fits(&self, offset: u64, length: u64) -> Option<usize> {
        let end = offset.checked_add(RECORD_HEAD_BYTES)?.checked_add(length)?;
        (end <= self.file.metadata().ok()?.len()).then_some(length as usize)
    }
}

/// The problem of a file that another program has altered since the scan.
fn changed(offset: u64) -> RecordingProblem {
    RecordingProblem::Damaged { offset, what: "the chunk was changed while it was read".to_owned() }
}
