//! How long work tells how far it has come. The command line draws bars; tests progress nothing.

/// Watches work in progress.
pub trait Progress: Sync {
    /// A stage begins; `steps` is how many ticks it takes, if that is known.
    fn begin(&self, what: &str, steps: Option<u64>);

    /// One step of the stage is done.
    fn step(&self);

    /// Something worth saying about the stage in a few words.
    fn say(&self, what: &str);

    fn end(&self);
}

/// Watches nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _what: &str, _steps: Option<u64>) {}

    fn step(&self) {}

    fn say(&self, _what: &str) {}

    fn end(&self) {}
}
