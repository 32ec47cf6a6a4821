//! Nodes and elements of MSH 2.2.

use super::super::draft::{Cell, DraftNode};
use super::collect::{Collector, EntityShape, shape};
use super::source::MeshText;
use crate::error::Result;

/// `$Nodes` or `$ParametricNodes`: a count, then number x y z; with parameters, also the entity's dimension and number and as
/// many parameters as it has.
pub(super) fn nodes(
    source: &mut MeshText<'_>,
    into: &mut Collector,
    is_parametric: bool,
) -> Result<()> {
    let count = source.count_line("the number of nodes")?;
    for _ in 0..count {
        source.open("a node")?;
        let number = positive(source, "a node's number")?;
        let mut at = [0.0; 3];
        for x in &mut at {
            *x = source.real("a coordinate of a node")?;
        }
        if is_parametric {
            let dimension = source.int("the dimension of a node's entity")?;
            source.int("the number of a node's entity")?;
            let parameters = if dimension < 3 { dimension } else { 0 };
            for _ in 0..parameters {
                source.any_real("a parameter of a node")?;
            }
        }
        source.close()?;
        let spot = source.spot();
        into.draft.nodes.push(DraftNode { number, at, spot });
    }
    Ok(())
}

fn positive(source: &mut MeshText<'_>, expected: &str) -> Result<u64> {
    let number = source.int(expected)?;
    let error = || source.error(expected).found(number);
    u64::try_from(number).map_err(|_| error())
}

/// `$Elements`: a count, then number, type, tags, nodes; binary files put elements of one type together.
pub(super) fn elements(source: &mut MeshText<'_>, into: &mut Collector) -> Result<()> {
    let count = source.count_line("the number of elements")?;
    if !source.is_binary() {
        for _ in 0..count {
            source.open("an element")?;
            let number = positive(source, "an element's number")?;
            let gmsh_type = source.int("an element's type")?;
            let tags = source.int("the number of an element's tags")?;
            let shape = shape(source, gmsh_type, format_args!("element {number}"))?;
            element(source, into, number, shape, tags)?;
            source.close()?;
        }
        return Ok(());
    }
    let mut done = 0;
    while done < count {
        let gmsh_type = source.int("an element's type")?;
        let following = positive(source, "a number of elements")?;
        let tags = source.int("the number of an element's tags")?;
        let shape = shape(
            source,
            gmsh_type,
            format_args!("block after {done} elements"),
        )?;
        for _ in 0..following {
            let number = positive(source, "an element's number")?;
            element(source, into, number, shape, tags)?;
        }
        done = done.saturating_add(following);
    }
    Ok(())
}

/// Tags (the physical group first, 0 for none) and nodes.
fn element(
    source: &mut MeshText<'_>,
    into: &mut Collector,
    number: u64,
    shape: EntityShape,
    tags: i64,
) -> Result<()> {
    let mut group = 0;
    for k in 0..tags {
        let tag = source.int("a tag of an element")?;
        if k == 0 {
            group = tag;
        }
    }
    let mut nodes = [Cell::NONE; 9];
    for node in nodes.iter_mut().take(shape.nodes()) {
        *node = positive(source, "the number of a node")?;
    }
    let groups: &[i64] = if group == 0 { &[] } else { &[group] };
    into.element(number, shape, nodes, source.spot(), groups)
}
