//! What the comments of CmdStan and RStan say of the draws below them.

use std::path::Path;

use crate::error::{Error, Result};

/// Settings of the program that wrote a file of draws.
#[derive(Default)]
pub(super) struct StanSettings {
    warmup: usize,
    thin: usize,
    saved: bool,
    /// Name of the model.
    pub model: Option<String>,
    /// Largest depth of a trajectory's tree that the user allowed.
    pub max_depth: Option<f64>,
}

impl StanSettings {
    /// What a comment says.
    ///
    /// # Errors
    /// The input's fault: a method whose rows are no draws of a Markov chain.
    pub fn read(&mut self, comment: &str) -> Result<()> {
        const OTHER: [&str; 4] = ["optimize", "variational", "pathfinder", "laplace"];
        let Some((key, value)) = comment.split_once('=') else {
            return Ok(());
        };
        let value = value.split_whitespace().next().unwrap_or_default();
        let number = value.parse().unwrap_or(0);
        match key.trim() {
            // of RStan the second
            "num_warmup" | "warmup" => self.warmup = number,
            "thin" => self.thin = number,
            "save_warmup" => self.saved = ["1", "true"].contains(&value),
            "model" | "model_name" => self.model = Some(value.into()),
            "max_depth" | "max_treedepth" => self.max_depth = value.parse().ok(),
            "method" if OTHER.contains(&value) => {
                return Err(
                    Error::input("method", "draws of a Markov chain (method = sample)")
                        .found(value)
                        .hint("this file has no chain, so that nothing converges"),
                );
            }
            _ => {}
        }
        Ok(())
    }

    /// Draws of the warm-up that a chain begins with.
    fn stored(&self) -> usize {
        match self.saved {
            true => self.warmup.div_ceil(self.thin.max(1)),
            false => 0,
        }
    }

    pub fn leave_out_warmup(&self, rows: &mut Vec<f64>, width: usize) {
        let end = (self.stored() * width).min(rows.len());
        rows.drain(..end);
    }

    pub fn remark(&self, path: &Path) -> Option<String> {
        let stored = self.stored();
        let path = path.display();
        (stored > 0).then(|| format!("{path}: the first {stored} draws are left out (save_warmup)"))
    }
}
