//! Sizes of pages.

/// A page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Page {
    /// As large as the board with its margins needs.
    Own,
    /// A format with its name, width and height in millimetres.
    Format(&'static str, [f64; 2]),
}

/// There is no page with this name.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("page {name:?} is not known; use {}", Page::ALL.map(Page::name).join(", "))]
pub struct UnknownPage {
    name: String,
}

/// Millimetres of an inch.
const INCH_MM: f64 = 25.4;

impl Page {
    /// All pages.
    pub const ALL: [Self; 9] = [
        Self::Format("a5", [148.0, 210.0]),
        Self::Format("a4", [210.0, 297.0]),
        Self::Format("a3", [297.0, 420.0]),
        Self::Format("a2", [420.0, 594.0]),
        Self::Format("a1", [594.0, 841.0]),
        Self::Format("a0", [841.0, 1189.0]),
        Self::Format("letter", [8.5 * INCH_MM, 11.0 * INCH_MM]),
        Self::Format("tabloid", [11.0 * INCH_MM, 17.0 * INCH_MM]),
        Self::Own,
    ];

    /// Name, such as `a4`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Own => "own",
            Self::Format(name, _) => name,
        }
    }

    /// Width and height of the page for what needs `needed_mm`, upright if possible.
    ///
    /// # Errors
    /// The size of the page, turned as needed, if it is too small.
    pub(super) fn size_for(self, needed_mm: [f64; 2]) -> Result<[f64; 2], [f64; 2]> {
        let Self::Format(_, [w, h]) = self else { return Ok(needed_mm.map(f64::ceil)) };
        let fits = |size: &[f64; 2]| needed_mm[0] <= size[0] && needed_mm[1] <= size[1];
        let turned = if needed_mm[0] > needed_mm[1] { [h, w] } else { [w, h] };
        [[w, h], [h, w]].into_iter().find(fits).ok_or(turned)
    }
}

impl std::str::FromStr for Page {
    type Err = UnknownPage;

    fn from_str(name: &str) -> Result<Self, UnknownPage> {
        let known = Self::ALL.into_iter().find(|page| page.name() == name.to_ascii_lowercase());
        known.ok_or_else(|| UnknownPage { name: name.to_owned() })
    }
}
