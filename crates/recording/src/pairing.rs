//! Pairs headers with the messages that they describe.
//!
//! A header and its message have the same MCAP sequence number. Fringeflow writes the header first, but a program that
//! sorts a recording may change the order. Where a number repeats, the first header describes the first message.

use std::collections::{BTreeMap, VecDeque};

use crate::Topic;

/// Topic and sequence number of a header.
pub(super) type HeaderKey = (Topic, u32);

/// Headers and messages whose partner has not been found yet.
#[derive(Debug)]
pub(super) struct Pairing<H, M> {
    headers: BTreeMap<HeaderKey, VecDeque<H>>,
    messages: BTreeMap<HeaderKey, VecDeque<M>>,
}

impl<H, M> Default for Pairing<H, M> {
    fn default() -> Self {
        Self { headers: BTreeMap::new(), messages: BTreeMap::new() }
    }
}

impl<H, M> Pairing<H, M> {
    /// Adds a header. Returns it with its message if the message came before.
    pub(super) fn add_header(&mut self, key: HeaderKey, header: H) -> Option<(M, H)> {
        match take(&mut self.messages, key) {
            Some(message) => Some((message, header)),
            None => {
                self.headers.entry(key).or_default().push_back(header);
                None
            }
        }
    }

    /// Adds a message; `key` is that of its header. Returns it with its header if the header came before.
    pub(super) fn add_message(&mut self, key: HeaderKey, message: M) -> Option<(M, H)> {
        match take(&mut self.headers, key) {
            Some(header) => Some((message, header)),
            None => {
                self.messages.entry(key).or_default().push_back(message);
                None
            }
        }
    }

    /// The first header without its message.
    pub(super) fn first_header(&self) -> Option<(HeaderKey, &H)> {
        let (key, headers) = self.headers.first_key_value()?;
        Some((*key, headers.front()?))
    }

    /// The header that the first message lacks.
    pub(super) fn first_message(&self) -> Option<HeaderKey> {
        self.messages.first_key_value().map(|(key, _)| *key)
    }

    /// Number of headers and messages without their partner.
    pub(super) fn count(&self) -> u64 {
        let headers = self.headers.values().map(VecDeque::len).sum::<usize>();
        (headers + self.messages.values().map(VecDeque::len).sum::<usize>()) as u64
    }
}

fn take<T>(waiting: &mut BTreeMap<HeaderKey, VecDeque<T>>, key: HeaderKey) -> Option<T> {
    let queue = waiting.get_mut(&key)?;
    let first = queue.pop_front();
    if queue.is_empty() {
        waiting.remove(&key);
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn partners_are_found_in_any_order_and_repetitions_in_turn() {
        let mut pairing: Pairing<char, u32> = Pairing::default();
        let key = |sequence| (Topic::Cam1Header, sequence);
        assert_eq!(pairing.add_header(key(5), 'a'), None);
        assert_eq!(pairing.add_message(key(6), 60), None);
        assert_eq!(pairing.add_header(key(5), 'b'), None);
        assert_eq!(
            (pairing.count(), pairing.first_message(), pairing.first_header()),
            (3, Some(key(6)), Some((key(5), &'a')))
        );
        assert_eq!(pairing.add_message(key(5), 50), Some((50, 'a')));
        assert_eq!(pairing.add_message(key(5), 51), Some((51, 'b')));
        assert_eq!(pairing.add_header(key(6), 'c'), Some((60, 'c')));
        assert_eq!((pairing.count(), pairing.first_message(), pairing.first_header()), (0, None, None));
    }
}
