//! Fields of MCAP records, read from untrusted bytes.
//!
//! Every length in a file is checked against the available bytes before anything is allocated. (`mcap::parse_record`
//! panics on an attachment that is shorter than its checksum.)

use std::collections::BTreeMap;

/// The unread rest of a record. Each read consumes bytes, or returns `None` if there are too few.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }

    pub(super) fn u8(&mut self) -> Option<u8> {
        self.array::<1>().map(u8::from_le_bytes)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub(super) fn length(&mut self) -> Option<usize> {
        self.u64()?.try_into().ok()
    }

    pub(super) fn string(&mut self) -> Option<&'a str> {
        let length = self.u32()? as usize;
        std::str::from_utf8(self.bytes(length)?).ok()
    }

    /// Reads the next part with a 32-bit length, as separate fields.
    fn part(&mut self) -> Option<Self> {
        let length = self.u32()? as usize;
        self.bytes(length).map(Self)
    }

    pub(super) fn text_map(&mut self) -> Option<BTreeMap<String, String>> {
        let mut part = self.part()?;
        let mut map = BTreeMap::new();
        while !part.0.is_empty() {
            map.insert(part.string()?.to_owned(), part.string()?.to_owned());
        }
        Some(map)
    }

    /// Messages by channel, as in the statistics record.
    pub(super) fn count_map(&mut self) -> Option<BTreeMap<u16, u64>> {
        let mut part = self.part()?;
        let mut map = BTreeMap::new();
        while !part.0.is_empty() {
            map.insert(part.u16()?, part.u64()?);
        }
        Some(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_beyond_the_end_give_none_and_allocate_nothing() {
        let huge = [0xff; 8];
        assert!(Fields(&huge).string().is_none());
        assert!(Fields(&huge).text_map().is_none());
        assert!(Fields(&huge).count_map().is_none());
        assert!(Fields(&huge).bytes(9).is_none());
        assert_eq!(Fields(b"\x02\0\0\0abc").string(), Some("ab"));
        assert!(Fields(b"\x01\0\0\0\xff").string().is_none());
    }
}
