//! Experiments of several kinds in one model file: each is read by its own type, with the lines of the whole file in its errors.

use serde::Deserialize;
use serde_json::value::RawValue;

use crate::error::{Error, Result};
use crate::experiment::frequencies::FrequenciesSpec;
use crate::files::parse_json;

/// The `kind` of experiments that are no field.
const FREQUENCIES: &str = "frequencies";

/// The text of a model file without its frequencies, line by line where it was, and these.
pub(super) struct Apart {
    pub text: String,
    pub frequencies: Vec<FrequenciesSpec>,
}

#[derive(Deserialize)]
struct Peek<'a> {
    #[serde(borrow, default)]
    experiments: Vec<&'a RawValue>,
}

#[derive(Deserialize)]
struct Kind {
    #[serde(default)]
    kind: String,
}

/// Take the frequencies that stand beside other experiments out of a model file; `place` is the file. None where there are none, or nothing
/// else, or the text is no model at all: that is left to whoever reads it.
///
/// # Errors
/// The input's fault, with line and key.
pub(super) fn apart(text: &str, place: &str) -> Result<Option<Apart>> {
    let Ok(Peek { experiments }) = serde_json::from_str(text) else {
        return Ok(None);
    };
    let is_frequencies = |raw: &&RawValue| {
        serde_json::from_str::<Kind>(raw.get()).is_ok_and(|k| k.kind == FREQUENCIES)
    };
    let (own, others): (Vec<&RawValue>, Vec<&RawValue>) =
        experiments.iter().copied().partition(is_frequencies);
    let (Some(first), Some(last)) = (experiments.first(), experiments.last()) else {
        return Ok(None);
    };
    if own.is_empty() || others.is_empty() {
        return Ok(None);
    }
    let span = |raw: &RawValue| {
        let from = raw.get().as_ptr() as usize - text.as_ptr() as usize;
        from..from + raw.get().len()
    };
    let read = |raw: &&RawValue| {
        let mut alone = blank(&text[..span(raw).start]);
        alone.push_str(raw.get());
        parse_json(&alone, place)
    };
    let frequencies = own.iter().map(read).collect::<Result<_>>()?;
    let mut kept = text[..span(first).start].to_string();
    let mut at = kept.len();
    for (k, raw) in others.iter().enumerate() {
        let span = span(raw);
        let mut gap = blank(&text[at..span.start]);
        if k > 0 {
            // between two there was a comma, whose place is a blank now
            gap.pop();
            gap.push(',');
        }
        kept.push_str(&gap);
        kept.push_str(raw.get());
        at = span.end;
    }
    kept.push_str(&blank(&text[at..span(last).end]));
    kept.push_str(&text[span(last).end..]);
    Ok(Some(Apart {
        text: kept,
        frequencies,
    }))
}

/// As many lines and columns of nothing.
fn blank(text: &str) -> String {
    let of = |c: char| if c == '\n' { '\n' } else { ' ' };
    text.chars().map(of).collect()
}

/// Names keep experiments apart.
pub(super) fn names_differ<'a>(names: impl Iterator<Item = &'a str>) -> Result<()> {
    let mut seen: Vec<&str> = Vec::new();
    for name in names {
        if seen.contains(&name) {
            return Err(Error::input("experiments", "a name of its own for each")
                .found(format!("a second {name}")));
        }
        seen.push(name);
    }
    Ok(())
}
