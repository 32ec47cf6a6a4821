//! How long work tells how far it has come. The command line draws bars; tests watch nothing.

/// Watches work in progress.
pub trait Watch: Sync {
    /// A stage begins; `steps` is how many ticks it takes, if that is known.
    fn begin(&self, what: &str, steps: Option<u64>);

    /// One step of the stage is done.
    fn tick(&self);

    /// Something worth saying about the stage in a few words.
    fn say(&self, what: &str);

    /// The stage is done.
    fn end(&self);
}

/// Watches nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unwatched;

impl Watch for Unwatched {
    fn begin(&self, _what: &str, _steps: Option<u64>) {}

    fn tick(&self) {}

    fn say(&self, _what: &str) {}

    fn end(&self) {}
}
