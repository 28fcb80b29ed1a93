//! The markers of ChArUco boards and the tags of AprilGrids. In: the name of a dictionary. Out: the cells of each
//! marker. The codes are those of OpenCV, from the crate `calib-targets-aruco`.

use calib_targets_aruco::{Dictionary, builtins};

/// A dictionary of square markers with a black border of one cell.
#[derive(Clone, Debug)]
pub struct Tags {
    name: String,
    dictionary: Dictionary,
}

/// A marker on a board.
#[derive(Clone, Debug, PartialEq)]
pub struct Marker {
    /// Its number in the dictionary.
    pub id: usize,
    /// Its top left corner in the frame of the board, millimetres.
    pub corner_mm: [f64; 2],
    /// Its side with the black border, millimetres.
    pub side_mm: f64,
    /// Whether each of its cells is black, row by row, with the border.
    pub cells: Vec<bool>,
}

impl PartialEq for Tags {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Tags {
    /// The dictionary with a name such as `4x4_250` or `apriltag_36h11`, in the spelling of OpenCV or without its
    /// `DICT_`; `None` for an unknown one.
    pub(super) fn named(name: &str) -> Option<Self> {
        let plain = |name: &str| name.to_ascii_lowercase().trim_start_matches("dict_").to_owned();
        let known = builtins::BUILTIN_DICTIONARY_NAMES.iter().find(|known| plain(known) == plain(name))?;
        Some(Self { name: plain(name), dictionary: builtins::builtin_dictionary(known)? })
    }

    /// Names of all dictionaries.
    pub(super) fn names() -> Vec<String> {
        let short = |name: &&str| name.to_ascii_lowercase().trim_start_matches("dict_").to_owned();
        builtins::BUILTIN_DICTIONARY_NAMES.iter().map(short).collect()
    }

    /// All dictionaries.
    pub(crate) fn all() -> Vec<Self> {
        Self::names().iter().filter_map(|name| Self::named(name)).collect()
    }

    /// The marker whose inner cells, row by row, are black where `is_black` says.
    pub(crate) fn id_of(&self, is_black: &[bool]) -> Option<usize> {
        let code = is_black.iter().enumerate().fold(0, |code, (k, &black)| code | u64::from(black) << k);
        self.dictionary.codes().iter().position(|&known| known == code)
    }

    /// Name, such as `4x4_250`.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of markers.
    #[must_use]
    pub fn count(&self) -> usize {
        self.dictionary.codes().len()
    }

    /// Cells along a side of a marker, with the border.
    pub(crate) fn side_cells(&self) -> usize {
        self.dictionary.marker_size() + 2
    }

    pub(crate) fn dictionary(&self) -> Dictionary {
        self.dictionary
    }

    /// Whether a marker is black at a point; `x` and `y` are shares of its side.
    pub(super) fn is_black(&self, id: usize, x: f64, y: f64) -> bool {
        let side = self.side_cells();
        let inside = (0.0..1.0).contains(&x) && (0.0..1.0).contains(&y);
        inside && self.is_black_cell(id, (x * side as f64) as usize, (y * side as f64) as usize)
    }

    fn is_black_cell(&self, id: usize, column: usize, row: usize) -> bool {
        let bits = self.dictionary.marker_size();
        if !(1..=bits).contains(&column) || !(1..=bits).contains(&row) {
            return true;
        }
        self.dictionary.codes().get(id).is_some_and(|code| code >> ((row - 1) * bits + column - 1) & 1 == 1)
    }

    pub(super) fn marker(&self, id: usize, corner_mm: [f64; 2], side_mm: f64) -> Marker {
        let side = self.side_cells();
        let cells = (0..side * side).map(|k| self.is_black_cell(id, k % side, k / side)).collect();
        Marker { id, corner_mm, side_mm, cells }
    }
}
