//! Units of length in files. In: `mm` or `m`. Out: a factor. Inside the program all lengths are in metres.

use std::str::FromStr;

/// Unit of length of a calibration file, a volume or an exported cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Millimetres.
    Millimetre,
    /// Metres.
    Metre,
}

/// A unit that is neither `mm` nor `m`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unit {0:?} is not known; use mm or m")]
pub struct UnknownUnit(pub String);

impl Unit {
    /// Length of this unit in metres.
    #[must_use]
    pub fn in_metres(self) -> f64 {
        match self {
            Self::Millimetre => 1e-3,
            Self::Metre => 1.0,
        }
    }

    /// Its name in files.
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Millimetre => "mm",
            Self::Metre => "m",
        }
    }
}

impl FromStr for Unit {
    type Err = UnknownUnit;

    fn from_str(text: &str) -> Result<Self, UnknownUnit> {
        match text {
            "mm" => Ok(Self::Millimetre),
            "m" => Ok(Self::Metre),
            other => Err(UnknownUnit(other.to_owned())),
        }
    }
}
