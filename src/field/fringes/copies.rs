//! Pictures that are there under two names: noise makes every picture another one, so one of the names is wrong.

use std::collections::HashMap;
use std::path::PathBuf;

use super::images::ImageStack;
use super::spec::{COMPONENTS, STATES};
use crate::error::{Error, Result};

/// Refuse pictures that are the same pixel by pixel. Without noise, which a simulation may leave out, those of one phase are alike.
///
/// # Errors
/// Of the input, with both names.
pub fn check(paths: &[[Vec<PathBuf>; 2]; 2], stack: &ImageStack, step_deg: f64) -> Result<()> {
    let mut seen: HashMap<&[u16], (usize, usize, usize)> = HashMap::new();
    let all = stack.frames.iter().enumerate().flat_map(|(c, states)| {
        let states = states.iter().enumerate();
        states.flat_map(move |(s, frames)| {
            let frames = frames.iter().enumerate();
            frames.map(move |(n, picture)| ((c, s, n), picture))
        })
    });
    for (own, picture) in all {
        // one without fringes is another error
        if picture.windows(2).all(|w| w[0] == w[1]) {
            continue;
        }
        let Some(other) = seen.insert(picture, own) else {
            continue;
        };
        let turns = step_deg * (own.2.abs_diff(other.2)) as f64 / 360.0;
        let one_phase = (turns - turns.round()).abs() < 1e-9;
        if one_phase && own.1 == other.1 && (own.0 == other.0 || own.1 == 0) {
            continue;
        }
        let [own, other] = [own, other].map(|(c, s, n)| {
            let path = paths[c][s][n].display();
            format!("{path} ({} {}, {})", COMPONENTS[c], STATES[s], n + 1)
        });
        return Err(Error::input(own, "a picture of its own")
            .found(format!("the same pixels as {other}"))
            .hint("one picture was copied under two names, or a name is listed for another: look at both"));
    }
    Ok(())
}
