//! Possible faults of a window. In: a fault. Out: the steps and times that its images then show. Cost: negligible.

use fringeflow_base::limits::MAX_IMAGES;

/// Kind of fault in the images of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SequenceFaultKind {
    /// Images are missing after one.
    Lost {
        /// Index of the image before them, from 0.
        after: usize,
        /// Number of lost images, 1 to N − 2.
        images: usize,
    },
    /// An image and the next one show the same step.
    Duplicated {
        /// Index of the first of both, from 0.
        image: usize,
    },
    /// An image and the next one are exchanged.
    Swapped {
        /// Index of the first of both, from 0.
        first: usize,
    },
    /// One image shows something else.
    Wrong {
        /// Index of the image, from 0.
        image: usize,
    },
    /// The images fit neither the declared steps nor any of these faults.
    Unexplained,
}

/// A fault, and how clear it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SequenceFault {
    /// The kind of fault.
    pub kind: SequenceFaultKind,
    /// Residual with the declared steps, a share of the modulation.
    pub residual_share: f64,
    /// Residual with the steps of the fault.
    pub explained_share: f64,
}

impl std::fmt::Display for SequenceFaultKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Lost { after, images: 1 } => write!(f, "an image was lost after image {}", after + 1),
            Self::Lost { after, images } => write!(f, "{images} images were lost after image {}", after + 1),
            Self::Duplicated { image } => write!(f, "image {} is repeated", image + 1),
            Self::Swapped { first } => write!(f, "images {} and {} are exchanged", first + 1, first + 2),
            Self::Wrong { image } => write!(f, "image {} shows something else", image + 1),
            Self::Unexplained => write!(f, "no order of the steps explains the images"),
        }
    }
}

/// Assumed steps and times of the images of a window. Only the first `images` entries have a meaning.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hypothesis {
    /// The assumed fault; `None` without a fault.
    pub(super) kind: Option<SequenceFaultKind>,
    /// Number of images, [`MAX_IMAGES`] at most.
    pub(super) images: usize,
    /// Step of every image, counted from the first image.
    pub(super) steps: [usize; MAX_IMAGES],
    /// Time of every image, counted in images.
    pub(super) times: [usize; MAX_IMAGES],
}

impl Hypothesis {
    /// The declared steps.
    pub(super) fn nominal(images: usize) -> Self {
        let order = std::array::from_fn(|image| image);
        Self { kind: None, images, steps: order, times: order }
    }

    /// The declared steps without one image.
    pub(super) fn without(image: usize, images: usize) -> Self {
        let kept = std::array::from_fn(|place| if place < image { place } else { place + 1 });
        Self { kind: None, images: images - 1, steps: kept, times: kept }
    }

    /// All faults of order (lost, repeated, exchanged images) in a window of an N-step cycle, the most likely first.
    ///
    /// Each occurs in several ways: a fault of the camera shifts times and steps, a fault of the projector only steps.
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

    /// The ways in which a fault of order may have happened.
    pub(super) fn all_of_kind(kind: SequenceFaultKind, images: usize) -> impl Iterator<Item = Self> {
        let nominal = Self::nominal(images);
        let steps_by = |step: &dyn Fn(usize) -> usize| std::array::from_fn(step);
        // The steps, and the steps of an alternative.
        let [steps, alternative] = match kind {
            SequenceFaultKind::Lost { after, images: lost } => {
                [Some(steps_by(&|i| if i > after { i + lost } else { i })), None]
            }
            SequenceFaultKind::Duplicated { image } => [
                Some(steps_by(&|i| if i > image { i - 1 } else { i })),
                // The repeated image may also have replaced the next one, instead of delaying it.
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
        let with = move |steps, times| Self { kind: Some(kind), images, steps, times };
        let camera_fault = steps.map(|steps| with(steps, steps));
        let projector_fault = steps.map(|steps| with(steps, nominal.times));
        [camera_fault, projector_fault, alternative.map(|steps| with(steps, steps))].into_iter().flatten()
    }
}
