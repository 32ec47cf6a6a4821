//! Sets of nodes or elements as the file writes them, and what they hold.

use std::collections::HashMap;

use super::super::draft::{Allowance, Draft, FileSpot, Index};
use super::keyword::{key, number};
use crate::error::{Error, Result};

/// Whose names and numbers are meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum SetScope {
    /// The part's, or those of a file without parts.
    Part,
    Assembly,
}

/// What a line of a set adds to it.
#[derive(Debug)]
pub(super) enum SetMember {
    One(u64),
    /// First, last, step.
    Range(u64, u64, u64),
    Set(String),
    /// The nodes of a set of elements.
    NodesOf(String),
}

/// A set of nodes or of elements.
#[derive(Debug)]
pub(super) struct DeckSet {
    pub name: String,
    pub scope: SetScope,
    pub is_internal: bool,
    /// With the place where each stands.
    pub members: Vec<(SetMember, FileSpot)>,
}

/// All sets of nodes, or of elements.
#[derive(Debug, Default)]
pub(super) struct Sets {
    pub all: Vec<DeckSet>,
    by_name: HashMap<(SetScope, String), usize>,
}

impl Sets {
    /// The index of a set, which is made if it is not there.
    pub fn entry(&mut self, name: &str, scope: SetScope, is_internal: bool) -> usize {
        let sets = &mut self.all;
        *self.by_name.entry((scope, key(name))).or_insert_with(|| {
            sets.push(DeckSet {
                name: super::keyword::unquoted(name).to_string(),
                scope,
                is_internal,
                members: Vec::new(),
            });
            sets.len() - 1
        })
    }

    /// Put a node or an element into the set that its keyword names, if it names one.
    pub fn add(&mut self, set: Option<usize>, number: u64, spot: FileSpot) {
        if let Some(set) = set {
            let member = SetMember::One(number);
            self.all[set].members.push((member, spot));
        }
    }

    /// The index of the set that a name means, seen from a scope.
    pub fn find(&self, name: &str, scope: SetScope) -> Option<usize> {
        let at = |scope| self.by_name.get(&(scope, key(name))).copied();
        at(scope).or_else(|| at(SetScope::Part))
    }

    /// Whether both the part and the assembly have a set of this name.
    pub fn is_ambiguous(&self, name: &str) -> bool {
        let has = |scope| self.by_name.contains_key(&(scope, key(name)));
        has(SetScope::Part) && has(SetScope::Assembly)
    }
}

/// A line of `*NSET` or `*ELSET`; `instance` is the prefix that names may have.
///
/// # Errors
/// The text of what was expected.
pub(super) fn members(
    fields: &[&str],
    generate: bool,
    instance: &[String],
) -> std::result::Result<Vec<SetMember>, &'static str> {
    if !generate {
        let member = |field: &&str| {
            let field = without_prefix(field, instance);
            number(field).map_or_else(|| SetMember::Set(field.to_string()), SetMember::One)
        };
        return Ok(fields
            .iter()
            .filter(|f| !f.is_empty())
            .map(member)
            .collect());
    }
    let wanted = "first, last and step of GENERATE, whole numbers";
    let numbers: Option<Vec<u64>> = fields.iter().map(|f| number(f)).collect();
    match numbers.as_deref() {
        Some([first]) => Ok(vec![SetMember::One(*first)]),
        Some([first, last]) => Ok(vec![SetMember::Range(*first, *last, 1)]),
        Some([first, last, step]) => Ok(vec![SetMember::Range(*first, *last, *step)]),
        _ => Err(wanted),
    }
}

/// A name or number without the name of the part or instance before it.
pub(super) fn without_prefix<'a>(field: &'a str, instance: &[String]) -> &'a str {
    let field = super::keyword::unquoted(field);
    match field.split_once('.') {
        Some((prefix, rest)) if instance.contains(&key(prefix)) => rest,
        _ => field,
    }
}

/// The nodes of the set of elements that a name means, seen from a scope.
pub(super) type NodesOf<'a> = dyn Fn(&str, SetScope) -> Option<Vec<u32>> + 'a;

/// The members of every set, as increasing indices. A set may have those above it as members; `nodes_of` are the nodes of a set of elements.
///
/// # Errors
/// The input's fault: numbers that are not there, names that are not those of sets above, too many members.
pub(super) fn resolve(
    draft: &Draft,
    sets: &Sets,
    index: &Index,
    (what, nodes_of): (&str, &NodesOf),
    allowance: &mut Allowance,
) -> Result<Vec<Vec<u32>>> {
    let size = draft.nodes.len() + draft.cells.len() + draft.lines.len();
    let mut resolved: Vec<Vec<u32>> = Vec::with_capacity(sets.all.len());
    for set in &sets.all {
        let mut own: Vec<u32> = Vec::new();
        for (member, spot) in &set.members {
            let place = || format!("{}: {what} set {}", draft.place(*spot), set.name);
            let before = own.len();
            let scanned = match member {
                SetMember::One(n) if what == "element" && draft.left_out.contains(n) => 1,
                SetMember::One(n) => {
                    own.push(index.get(*n).ok_or_else(|| {
                        Error::input(place(), format!("{what}s that the file defines"))
                            .found(format!("{what} {n}, which it does not"))
                            .hint("the file is cut short, or the set is older than the mesh: write it again")
                    })?);
                    1
                }
                SetMember::Range(first, last, step) => {
                    range(index, [*first, *last, *step], &mut own)
                }
                SetMember::NodesOf(name) => {
                    let nodes = nodes_of(name, set.scope).ok_or_else(|| {
                        Error::input(place(), "the name of a set of elements in ELSET")
                            .found(name)
                            .hint("the set is missing in the file: write it again")
                    })?;
                    own.extend(&nodes);
                    nodes.len()
                }
                SetMember::Set(name) => {
                    let at = sets.find(name, set.scope).filter(|at| *at < resolved.len());
                    let other = at.and_then(|at| resolved.get(at)).ok_or_else(|| {
                        Error::input(place(), format!("numbers, or {what} sets defined above"))
                            .found(name)
                            .hint("put the set before those that have it as a member")
                    })?;
                    own.extend(other);
                    other.len()
                }
            };
            allowance.take(scanned.max(own.len() - before), size, place)?;
        }
        own.sort_unstable();
        own.dedup();
        resolved.push(own);
    }
    Ok(resolved)
}

/// Those of a range that are there; how many places were looked at, which is never more than there are numbers in it.
fn range(index: &Index, [first, last, step]: [u64; 3], own: &mut Vec<u32>) -> usize {
    let there = index.range(first, last);
    let steps = (last.saturating_sub(first) / step).saturating_add(1);
    if steps < there.len() as u64 {
        let numbers = (0..steps).filter_map(|k| index.get(first + k * step));
        own.extend(numbers);
        return steps as usize;
    }
    let on_step = there
        .iter()
        .filter(|(n, _)| (n - first).is_multiple_of(step));
    own.extend(on_step.map(|(_, i)| *i));
    there.len()
}
