//! Enums that are stored as numbers in messages and as names in reports, metrics and recordings.

/// Defines such an enum from a table with code, name and meaning of each value. The meaning is also the doc comment of
/// the value.
macro_rules! codes {
    (
        $(#[$attribute:meta])*
        pub enum $Enum:ident {
            $($Value:ident = $code:literal, $name:literal, $meaning:literal;)*
        }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(u32)]
        pub enum $Enum {
            $(#[doc = $meaning] $Value = $code,)*
        }

        impl $Enum {
            /// All values, in the order of their codes.
            pub const ALL: [Self; [$($code),*].len()] = [$(Self::$Value),*];

            /// Returns the value with this code; `None` for an unknown code.
            #[must_use]
            pub fn from_code(code: u32) -> Option<Self> {
                Self::ALL.into_iter().find(|value| *value as u32 == code)
            }

            /// Returns the value with this name; `None` for an unknown name.
            #[must_use]
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|value| value.name() == name)
            }

            /// Name in reports, metrics and recordings.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$Value => $name,)*
                }
            }

            /// Explanation of the name for users.
            #[must_use]
            pub fn meaning(self) -> &'static str {
                match self {
                    $(Self::$Value => $meaning,)*
                }
            }
        }
    };
}

pub(crate) use codes;
