//! What may be wrong with the steps of a window, and which steps its images show then.

use fringeflow_base::limits::MAX_IMAGES;

/// What is wrong with the images of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SequenceFaultKind {
    /// Images are missing behind one.
    Lost {
        /// The image before them, from 0.
        after: usize,
        /// How many, 1 to N − 2.
        images: usize,
    },
    /// The image behind one shows the same step.
    Duplicated {
        /// The image that comes twice, from 0.
        image: usize,
    },
    /// An image and the one behind it are exchanged.
    Swapped {
        /// The first of both, from 0.
        first: usize,
    },
    /// One image shows something else.
    Wrong {
        /// Which one, from 0.
        image: usize,
    },
    /// The images fit neither the steps that are said of them nor any of these faults.
    Unexplained,
}

/// A fault, and how clearly it shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SequenceFault {
    /// What it is.
    pub kind: SequenceFaultKind,
    /// What the said steps leave unexplained, a share of the modulation.
    pub residual_share: f64,
    /// What is left with the fault.
    pub explained_share: f64,
}

impl std::fmt::Display for SequenceFaultKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Lost { after, images: 1 } => write!(f, "an image was lost behind image {}", after + 1),
            Self::Lost { after, images } => write!(f, "{images} images were lost behind image {}", after + 1),
            Self::Duplicated { image } => write!(f, "image {} came twice", image + 1),
            Self::Swapped { first } => write!(f, "images {} and {} are exchanged", first + 1, first + 2),
            Self::Wrong { image } => write!(f, "image {} shows something else", image + 1),
            Self::Unexplained => write!(f, "no order of the steps explains them"),
        }
    }
}

/// The images as a fault, or none, would have it. Only as many numbers as there are images have a meaning.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hypothesis {
    /// The fault; `None` where all is as said.
    pub(super) kind: Option<SequenceFaultKind>,
    /// Number of images, [`MAX_IMAGES`] at most.
    pub(super) images: usize,
    /// Step of every image, counted on from that of the first.
    pub(super) steps: [usize; MAX_IMAGES],
    /// Time of every image, in images.
    pub(super) times: [usize; MAX_IMAGES],
}

impl Hypothesis {
    /// Nothing is wrong.
    pub(super) fn nominal(images: usize) -> Self {
        let order = std::array::from_fn(|image| image);
        Self { kind: None, images, steps: order, times: order }
    }

    /// Nothing is wrong but an image, which is left out.
    pub(super) fn without(image: usize, images: usize) -> Self {
        let kept = std::array::from_fn(|place| if place < image { place } else { place + 1 });
        Self { kind: None, images: images - 1, steps: kept, times: kept }
    }

    /// All faults of order in a window of so many images and a cycle of N steps, those that are the likeliest first. A camera
    /// that errs shifts the times with the steps, a projector that errs does not.
    pub(super) fn all_of_order(images: usize, cycle: usize) -> impl Iterator<Item = Self> {
        let pairs = images.saturating_sub(1);
        let lost = move |lost: usize| (0..pairs).map(move |after| SequenceFaultKind::Lost { after, images: lost });
        let duplicated = (0..pairs).map(|image| SequenceFaultKind::Duplicated { image });
        let swapped = (0..pairs).map(|first| SequenceFaultKind::Swapped { first });
        let longest = cycle.saturating_sub(2);
        let few = (1..=longest.min(1)).flat_map(lost);
        let many = (2..=longest).flat_map(lost);
        few.chain(duplicated).chain(swapped).chain(many).flat_map(move |kind| Self::all_of_kind(kind, images))
    }

    /// The ways in which a fault of order may have come about.
    pub(super) fn all_of_kind(kind: SequenceFaultKind, images: usize) -> impl Iterator<Item = Self> {
        let nominal = Self::nominal(images);
        let steps_by = |step: &dyn Fn(usize) -> usize| std::array::from_fn(step);
        // The steps, and those of another way that keeps its times.
        let [steps, instead] = match kind {
            SequenceFaultKind::Lost { after, images: lost } => {
                [Some(steps_by(&|i| if i > after { i + lost } else { i })), None]
            }
            SequenceFaultKind::Duplicated { image } => [
                Some(steps_by(&|i| if i > image { i - 1 } else { i })),
                // The second may also have taken the place of the image behind.
                Some(steps_by(&|i| if i == image + 1 { image } else { i })),
            ],
            SequenceFaultKind::Swapped { first } => {
                let mut steps = nominal.steps;
                if first + 1 < images {
                    steps.swap(first, first + 1);
                }
                [Some(steps), None]
            }
            SequenceFaultKind::Wrong { .. } | SequenceFaultKind::Unexplained => [None, None],
        };
        let of = move |steps, times| Self { kind: Some(kind), images, steps, times };
        let [both, of_projector] = [steps.map(|steps| of(steps, steps)), steps.map(|steps| of(steps, nominal.times))];
        [both, of_projector, instead.map(|steps| of(steps, steps))].into_iter().flatten()
    }
}
