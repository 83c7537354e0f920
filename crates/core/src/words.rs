//! Enums with a word for each variant, read and written in one place.

/// Error of a word that names no variant.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{word}` is none of {known}")]
pub struct UnknownWord {
    /// The word as written.
    pub word: String,
    /// Every known word, separated by commas.
    pub known: String,
}

/// Gives an enum its words: `ALL`, `name`, [`std::fmt::Display`] and [`std::str::FromStr`], which reads what
/// that writes.
#[macro_export]
macro_rules! words {
    ($type:ident { $($variant:ident => $word:literal),+ $(,)? }) => {
        impl $type {
            /// Every variant, in the order of help and documents.
            pub const ALL: [Self; [$($word),+].len()] = [$(Self::$variant),+];

            /// The word for it, as on the command line and in files.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $word),+
                }
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::words::UnknownWord;

            fn from_str(word: &str) -> Result<Self, Self::Err> {
                Self::ALL.into_iter().find(|variant| variant.name().eq_ignore_ascii_case(word)).ok_or_else(|| {
                    let known = Self::ALL.map(Self::name).join(", ");
                    $crate::words::UnknownWord { word: word.to_owned(), known }
                })
            }
        }
    };
}
