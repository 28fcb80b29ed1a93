//! The tables of the paper.

/// A row of Table 1: completeness of the method without Gray code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CompletenessRow {
    /// The measured object, by our name.
    pub(super) object: &'static str,
    /// Its name in the paper.
    pub(super) title: &'static str,
    /// Completeness, percent.
    pub(super) com_percent: f64,
    /// Completeness error, percent.
    pub(super) miss_percent: f64,
    /// False positive correspondences, percent.
    pub(super) fpc_percent: f64,
    /// Number of reference points.
    pub(super) points: u64,
}

/// Table 1 of the paper.
pub(super) const TABLE_1: [CompletenessRow; 7] = [
    row("plane", "Plane", 100.00, 0.00, 0.00, 6384),
    row("prism", "Prism", 99.96, 0.03, 0.02, 19307),
    row("machine", "Machine tool", 99.99, 0.01, 0.03, 28568),
    row("teeth", "Set of teeth", 99.99, 0.01, 0.03, 70249),
    row("tooth", "Plaster tooth", 100.00, 0.00, 0.13, 6769),
    row("nose", "Nose", 99.92, 0.06, 2.02, 22709),
    row("elephant", "Elephant", 99.99, 0.01, 0.00, 11412),
];

/// Table 2 of the paper: images of the conventional method (CGC), of full Gray code with epipolar lines (EGC) and of
/// the proposed algorithm (PA), with 16, 8 and 4 steps and a Gray code of 7 images.
pub(super) const TABLE_2: [(&str, [u64; 3]); 3] = [("CGC", [46, 30, 22]), ("EGC", [23, 15, 11]), ("PA", [16, 8, 4])];

const fn row(
    object: &'static str,
    title: &'static str,
    com_percent: f64,
    miss_percent: f64,
    fpc_percent: f64,
    points: u64,
) -> CompletenessRow {
    CompletenessRow { object, title, com_percent, miss_percent, fpc_percent, points }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_lab::simulation::Object;

    #[test]
    fn table_1_has_the_objects_of_the_virtual_scanner_in_their_order() {
        assert_eq!(TABLE_1.map(|row| row.object), Object::PAPER.map(Object::name));
    }
}
