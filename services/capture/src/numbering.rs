//! The driver's numbers of the images, made to count on: in go 32 bits that wrap, out come 64 that do not, and gaps.

/// Most images that can be missing at once; a longer way ahead is a numbering that began anew.
const LONGEST_GAP: u32 = 1 << 20;

/// Numbers of the images of one stream.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Numbering {
    last: Option<u64>,
}

/// What the number of an image says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Numbered {
    /// It is this one, and so many before it are missing.
    Next {
        /// Number without wrap.
        number: u64,
        /// Images of which none came.
        missing: u64,
    },
    /// It has the number of the image before.
    Repeated,
    /// The driver counts anew; numbers before and after say nothing of each other.
    Anew {
        /// Number without wrap.
        number: u64,
    },
}

impl Numbering {
    /// Takes the driver's number of the next image.
    pub(crate) fn take(&mut self, sequence: u32) -> Numbered {
        let Some(last) = self.last else {
            self.last = Some(sequence.into());
            return Numbered::Next { number: sequence.into(), missing: 0 };
        };
        match sequence.wrapping_sub(last as u32) {
            0 => Numbered::Repeated,
            ahead @ 1..=LONGEST_GAP => {
                let number = last + u64::from(ahead);
                self.last = Some(number);
                Numbered::Next { number, missing: u64::from(ahead - 1) }
            }
            _ => {
                self.last = Some(sequence.into());
                Numbered::Anew { number: sequence.into() }
            }
        }
    }

    /// Takes the number of a damaged image, as far as it can be believed: how many before it are missing.
    pub(crate) fn take_damaged(&mut self, sequence: u32) -> u64 {
        let mut next = *self;
        match next.take(sequence) {
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

    fn taken(sequences: &[u32]) -> Vec<Numbered> {
        let mut numbering = Numbering::default();
        sequences.iter().map(|&sequence| numbering.take(sequence)).collect()
    }

    fn next(number: u64, missing: u64) -> Numbered {
        Numbered::Next { number, missing }
    }

    #[test]
    fn a_gap_is_so_many_images() {
        assert_eq!(taken(&[7, 8, 12, 13]), [next(7, 0), next(8, 0), next(12, 3), next(13, 0)]);
    }

    #[test]
    fn numbers_go_on_beyond_32_bits() {
        let wrapped = 1_u64 << 32;
        assert_eq!(
            taken(&[u32::MAX - 1, u32::MAX, 0, 2]),
            [next(wrapped - 2, 0), next(wrapped - 1, 0), next(wrapped, 0), next(wrapped + 2, 1)]
        );
    }

    #[test]
    fn a_repeated_number_is_told_and_forgotten() {
        assert_eq!(taken(&[3, 3, 4]), [next(3, 0), Numbered::Repeated, next(4, 0)]);
    }

    #[test]
    fn a_damaged_image_counts_if_its_number_can_be_believed() {
        let mut numbering = Numbering::default();
        assert_eq!(numbering.take_damaged(9), 0);
        assert_eq!(numbering.take(3), next(3, 0));
        assert_eq!(numbering.take_damaged(0), 0);
        assert_eq!(numbering.take_damaged(6), 2);
        assert_eq!(numbering.take(7), next(7, 0));
    }

    #[test]
    fn a_number_that_runs_back_begins_anew() {
        assert_eq!(taken(&[1000, 0, 1]), [next(1000, 0), Numbered::Anew { number: 0 }, next(1, 0)]);
        assert_eq!(taken(&[0, 1 << 30]), [next(0, 0), Numbered::Anew { number: 1 << 30 }]);
        assert_eq!(taken(&[0, 1 << 20]), [next(0, 0), next(1 << 20, (1 << 20) - 1)]);
    }
}
