//! States of health.

/// State of a quantity or of the scanner, in the order from better to worse.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum HealthState {
    /// Too few windows had a value.
    #[default]
    NotKnown = 0,
    /// Within its limits.
    Ok = 1,
    /// Above the warning limit. Results are still valid.
    Warn = 2,
    /// Above the bad limit. Results are less accurate than they claim.
    Bad = 3,
}

impl HealthState {
    /// All states.
    pub const ALL: [Self; 4] = [Self::NotKnown, Self::Ok, Self::Warn, Self::Bad];

    /// Returns the state for a code in a message, or [`Self::NotKnown`] if the code is unknown.
    #[must_use]
    pub fn from_code(code: u32) -> Self {
        Self::ALL.into_iter().find(|state| *state as u32 == code).unwrap_or_default()
    }

    /// Name shown to people and used in files and recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NotKnown => "not known",
            Self::Ok => "ok",
            Self::Warn => "warn",
            Self::Bad => "bad",
        }
    }

    /// Returns the state with this name, or `None` if the name is unknown.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.name() == name)
    }
}
