//! States of health.

/// State of a quantity or of the scanner, the better first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum HealthState {
    /// Too few windows had a value.
    #[default]
    NotKnown = 0,
    /// Within its limits.
    Ok = 1,
    /// Above the warning limit; results still hold.
    Warn = 2,
    /// Above the bad limit: results are less accurate than they claim.
    Bad = 3,
}

impl HealthState {
    /// All states.
    pub const ALL: [Self; 4] = [Self::NotKnown, Self::Ok, Self::Warn, Self::Bad];

    /// The state of a code in a message; not known for an unknown code.
    #[must_use]
    pub fn from_code(code: u32) -> Self {
        Self::ALL.into_iter().find(|state| *state as u32 == code).unwrap_or_default()
    }

    /// Name for people, files and recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NotKnown => "not known",
            Self::Ok => "ok",
            Self::Warn => "warn",
            Self::Bad => "bad",
        }
    }

    /// The state with this name; `None` for an unknown name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.name() == name)
    }
}
