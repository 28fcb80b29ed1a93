//! Sequence numbers of a stream.
//!
//! In: the driver's numbers of 32 bits, which wrap. Out: numbers of 64 bits, which do not, and the number of missing
//! images.

/// Longest step from one image to the next; after a longer one the driver has restarted its numbers.
const MAX_STEP: u32 = 1 << 20;

/// Extends the sequence numbers of one stream.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Numbering {
    /// Number of the last image.
    last: Option<u64>,
}

/// An image number, compared with that of the image before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Numbered {
    /// The next image, possibly after a gap.
    Next {
        /// Number of 64 bits.
        number: u64,
        /// Number of images missing before it.
        missing: u64,
    },
    /// The image has the number of the image before.
    Repeated,
    /// The driver has restarted its numbers; numbers before and after cannot be compared.
    Restarted {
        /// Number of 64 bits.
        number: u64,
    },
}

impl Numbering {
    /// Extends the driver's number of the next image.
    pub(crate) fn extend(&mut self, sequence: u32) -> Numbered {
        let Some(last) = self.last else {
            self.last = Some(sequence.into());
            return Numbered::Next { number: sequence.into(), missing: 0 };
        };
        match sequence.wrapping_sub(last as u32) {
            0 => Numbered::Repeated,
            ahead @ 1..=MAX_STEP => {
                let number = last + u64::from(ahead);
                self.last = Some(number);
                Numbered::Next { number, missing: u64::from(ahead - 1) }
            }
            _ => {
                self.last = Some(sequence.into());
                Numbered::Restarted { number: sequence.into() }
            }
        }
    }

    /// Extends the number of a damaged image if it is plausible. Returns the number of images missing before it.
    pub(crate) fn extend_damaged(&mut self, sequence: u32) -> u64 {
        let mut next = *self;
        match next.extend(sequence) {
            Numbered::Next { missing, .. } if self.last.is_some() => {
                *self = next;
                missing
            }
            _ => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extended(sequences: &[u32]) -> Vec<Numbered> {
        let mut numbering = Numbering::default();
        sequences.iter().map(|&sequence| numbering.extend(sequence)).collect()
    }

    fn next(number: u64, missing: u64) -> Numbered {
        Numbered::Next { number, missing }
    }

    #[test]
    fn a_gap_counts_the_missing_images() {
        assert_eq!(extended(&[7, 8, 12, 13]), [next(7, 0), next(8, 0), next(12, 3), next(13, 0)]);
    }

    #[test]
    fn numbers_continue_beyond_32_bits() {
        let wrapped = 1_u64 << 32;
        assert_eq!(
            extended(&[u32::MAX - 1, u32::MAX, 0, 2]),
            [next(wrapped - 2, 0), next(wrapped - 1, 0), next(wrapped, 0), next(wrapped + 2, 1)]
        );
    }

    #[test]
    fn a_repeated_number_is_reported_and_ignored() {
        assert_eq!(extended(&[3, 3, 4]), [next(3, 0), Numbered::Repeated, next(4, 0)]);
    }

    #[test]
    fn a_damaged_image_counts_if_its_number_is_plausible() {
        let mut numbering = Numbering::default();
        assert_eq!(numbering.extend_damaged(9), 0);
        assert_eq!(numbering.extend(3), next(3, 0));
        assert_eq!(numbering.extend_damaged(0), 0);
        assert_eq!(numbering.extend_damaged(6), 2);
        assert_eq!(numbering.extend(7), next(7, 0));
    }

    #[test]
    fn a_number_that_runs_back_or_far_ahead_is_a_restart() {
        assert_eq!(extended(&[1000, 0, 1]), [next(1000, 0), Numbered::Restarted { number: 0 }, next(1, 0)]);
        assert_eq!(extended(&[0, 1 << 30]), [next(0, 0), Numbered::Restarted { number: 1 << 30 }]);
        assert_eq!(extended(&[0, 1 << 20]), [next(0, 0), next(1 << 20, (1 << 20) - 1)]);
    }
}
