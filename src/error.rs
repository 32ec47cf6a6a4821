//! The one error type: what went wrong, where, with which value, and what to do about it.

use std::fmt;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Result of every fallible call in this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// Exit code of work that was told to stop (SIGTERM) and is gone on with by `--resume`: `EX_TEMPFAIL` of sysexits.h.
pub const TO_BE_RESUMED: u8 = 75;

/// What a mutex protects, also where a thread panicked that held it: every holder leaves it whole.
pub fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whose fault an error is, which fixes the exit code of the program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Blame {
    /// The input's: a file, a key, an argument. Exit code 1.
    Input,
    /// Nobody's: a limit that the user set was reached. Exit code 1.
    Limit,
    /// The program's: a broken invariant, a failed factorisation. Exit code 2.
    Program,
    /// Nobody's: it was told to stop, and `--resume` goes on. Exit code 75.
    Stopped,
    /// Nobody's: a file could not be written, and `--resume` goes on. Exit code 1.
    Unwritable,
}

/// An error with its place, the offending value, what was expected, and a hint.
#[derive(Debug, Clone, thiserror::Error)]
pub struct Error(Box<Fault>);

#[derive(Debug, Clone)]
struct Fault {
    blame: Blame,
    place: String,
    found: Option<String>,
    expected: String,
    hint: Option<String>,
}

impl Error {
    /// An error of the input at `place` (file and line or key, or an argument), which should have been `expected`.
    pub fn input(place: impl fmt::Display, expected: impl fmt::Display) -> Self {
        Self::new(Blame::Input, place, expected)
    }

    /// An error of the input at `place`, which should have been one of some names.
    pub fn one_of<'a>(
        place: impl fmt::Display,
        names: impl IntoIterator<Item = &'a str>,
        found: impl fmt::Display,
    ) -> Self {
        let names: Vec<&str> = names.into_iter().collect();
        Self::input(place, format!("one of {}", names.join(", "))).found(found)
    }

    /// The limit at `place` left too little; it would have to allow what was `expected`.
    pub fn limit(place: impl fmt::Display, expected: impl fmt::Display) -> Self {
        Self::new(Blame::Limit, place, expected)
    }

    /// An error of the program at `place`; `expected` is the invariant that failed.
    pub fn program(place: impl fmt::Display, expected: impl fmt::Display) -> Self {
        Self::new(Blame::Program, place, expected)
    }

    /// The work at `place` was told to stop before what was `expected`; it can be gone on with.
    pub fn stopped(place: impl fmt::Display, expected: impl fmt::Display) -> Self {
        Self::new(Blame::Stopped, place, expected)
    }

    /// The file at `place` could not be written, which should have been `expected`.
    pub fn unwritable(place: impl fmt::Display, expected: impl fmt::Display) -> Self {
        Self::new(Blame::Unwritable, place, expected)
    }

    fn new(blame: Blame, place: impl fmt::Display, expected: impl fmt::Display) -> Self {
        Self(Box::new(Fault {
            blame,
            place: place.to_string(),
            found: None,
            expected: expected.to_string(),
            hint: None,
        }))
    }

    /// The value that was found instead; long values are cut.
    #[must_use]
    pub fn found(mut self, value: impl fmt::Display) -> Self {
        const LONGEST: usize = 120;
        let text = value.to_string().replace(['\n', '\r'], " ");
        // the system's number for what its words say
        let text = text.split(" (os error ").next().unwrap_or_default();
        self.0.found = Some(match text.char_indices().nth(LONGEST) {
            Some((cut, _)) => format!("{}...", &text[..cut]),
            None => text.to_string(),
        });
        self
    }

    /// What the user can do about it.
    #[must_use]
    pub fn hint(mut self, hint: impl fmt::Display) -> Self {
        self.0.hint = Some(hint.to_string());
        self
    }

    /// The same error seen from further out: `outer` is put before the place.
    #[must_use]
    pub fn within(mut self, outer: impl fmt::Display) -> Self {
        self.0.place = format!("{outer}: {}", self.0.place);
        self
    }

    /// The same error with its place as a key of the object `outer`, which ends in a dot or is empty.
    #[must_use]
    pub fn below(mut self, outer: impl fmt::Display) -> Self {
        self.0.place = format!("{outer}{}", self.0.place);
        self
    }

    /// Whose fault it is.
    pub fn blame(&self) -> Blame {
        self.0.blame
    }

    /// Whether nothing that is tried in place of what failed can be right: the work has to end here, and to be gone on with.
    pub fn ends_all(&self) -> bool {
        matches!(self.0.blame, Blame::Stopped | Blame::Unwritable)
    }

    /// The exit code of the program that ends with this error.
    pub fn exit_code(&self) -> u8 {
        match self.0.blame {
            Blame::Input | Blame::Limit | Blame::Unwritable => 1,
            Blame::Program => 2,
            Blame::Stopped => TO_BE_RESUMED,
        }
    }

    /// The hint, if there is one.
    pub fn hint_text(&self) -> Option<&str> {
        self.0.hint.as_deref()
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Fault {
            place,
            found,
            expected,
            ..
        } = &*self.0;
        match found {
            Some(value) => write!(f, "{place}: found {value}, expected {expected}"),
            None => write!(f, "{place}: expected {expected}"),
        }
    }
}
