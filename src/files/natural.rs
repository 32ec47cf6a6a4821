//! Names in their natural order.

use std::cmp::Ordering;

/// Text by characters, numbers in it by their size: `step-2` before `step-10`, `1.25` before `1.5`.
pub fn natural(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    while let (Some(x), Some(y)) = (left.chars().next(), right.chars().next()) {
        let order = if x.is_ascii_digit() && y.is_ascii_digit() {
            let ((m, rest), (n, other)) = (decimal(left), decimal(right));
            (left, right) = (rest, other);
            m[0].len().cmp(&n[0].len()).then(m.cmp(&n))
        } else {
            left = &left[x.len_utf8()..];
            right = &right[y.len_utf8()..];
            x.cmp(&y)
        };
        if order != Ordering::Equal {
            return order;
        }
    }
    left.len().cmp(&right.len()).then_with(|| a.cmp(b))
}

/// The number that a text begins with, without leading zeros, its decimals without those at the end, and the rest of the text. Digits
/// behind two points are a version.
fn decimal(text: &str) -> ([&str; 2], &str) {
    let (whole, rest) = digits(text);
    let whole = whole.trim_start_matches('0');
    let (decimals, after) = rest.strip_prefix(['.', ',']).map_or(("", rest), digits);
    let again = after
        .strip_prefix('.')
        .is_some_and(|t| t.starts_with(|c: char| c.is_ascii_digit()));
    if decimals.is_empty() || again {
        return ([whole, ""], rest);
    }
    ([whole, decimals.trim_end_matches('0')], after)
}

fn digits(text: &str) -> (&str, &str) {
    text.split_at(
        text.find(|c: char| !c.is_ascii_digit())
            .unwrap_or(text.len()),
    )
}
