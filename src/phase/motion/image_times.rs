//! The images of a window in time: when each is taken, and which runs of them a fit can use.

use fringeflow_base::limits::MIN_STEPS;

/// Fewest samples whose fit has a residual.
pub(super) const LEAST_FITTED: usize = MIN_STEPS + 1;

/// Time of an image since the centre of the window, counted in images.
pub(super) fn time(image: usize, images: usize) -> f64 {
    image as f64 - (images as f64 - 1.0) / 2.0
}

/// −1 for images before the centre of the window, otherwise 1.
pub(super) fn side(image: usize, images: usize) -> f32 {
    if image < images / 2 { -1.0 } else { 1.0 }
}

/// Index of the pair of images at the same distance from the centre of the window, starting with the nearest.
pub(super) fn pair(image: usize, images: usize) -> usize {
    let middle = images / 2;
    match (image < middle, images.is_multiple_of(2)) {
        (true, true) => middle - 1 - image,
        (true, false) => middle - image,
        (false, _) => image - middle,
    }
}

/// Runs of images that include the centre of the window and have a residual, the longest first.
pub(super) fn runs(images: usize) -> Vec<[usize; 2]> {
    let has_centre = |first: usize, last: usize| 2 * first < images && 2 * last + 2 > images;
    let mut lengths: Vec<usize> = [images, images.saturating_sub(2), images.div_ceil(2) + 1].into();
    lengths.retain(|&length| length >= LEAST_FITTED);
    lengths.dedup();
    let runs = |length: usize| (0..=images - length).map(move |first| [first, first + length - 1]);
    lengths.into_iter().flat_map(runs).filter(|&[first, last]| has_centre(first, last)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_include_the_centre_and_have_a_residual() {
        assert_eq!(runs(6), [[0, 5], [0, 3], [1, 4], [2, 5]]);
        assert_eq!(runs(5), [[0, 4], [0, 3], [1, 4]]);
        for images in 5..24 {
            for [first, last] in runs(images) {
                let middle = (images - 1) as f64 / 2.0;
                assert!(first as f64 <= middle + 0.5 && last as f64 >= middle - 0.5 && last < images);
            }
        }
    }
}
