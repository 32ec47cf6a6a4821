//! Entities, nodes and elements of MSH 4.1.

use super::super::draft::{Cell, DraftNode};
use super::collect::{Collector, shape};
use super::source::MeshText;
use crate::error::Result;

/// `$Entities`: points, curves, surfaces and volumes, each with its physical groups.
pub(super) fn entities(source: &mut MeshText<'_>, into: &mut Collector) -> Result<()> {
    source.open("the numbers of entities")?;
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = source.size("the number of entities of a dimension")?;
    }
    source.close()?;
    for (dimension, count) in (0i64..).zip(counts) {
        for _ in 0..count {
            source.open("an entity")?;
            let tag = source.int("an entity's number")?;
            let bounds = if dimension == 0 { 3 } else { 6 };
            for _ in 0..bounds {
                source.any_real("a bound of an entity")?;
            }
            let groups = source.size("the number of an entity's physical groups")?;
            for _ in 0..groups {
                let group = source.int("a physical group")?;
                into.entity(dimension, tag, group);
            }
            if dimension > 0 {
                let bounding = source.size("the number of an entity's bounding entities")?;
                for _ in 0..bounding {
                    source.int("a bounding entity")?;
                }
            }
            source.close()?;
        }
    }
    into.sort_entities();
    Ok(())
}

/// The four counts that `$Nodes` and `$Elements` begin with; the number of blocks.
fn blocks(source: &mut MeshText<'_>) -> Result<u64> {
    source.open("the numbers of blocks and of what they hold")?;
    let blocks = source.size("the number of blocks")?;
    for _ in 0..3 {
        source.size("a count or a number")?;
    }
    source.close()?;
    Ok(blocks)
}

/// `$Nodes`: blocks of an entity each, first all numbers, then all coordinates.
pub(super) fn nodes(source: &mut MeshText<'_>, into: &mut Collector) -> Result<()> {
    for _ in 0..blocks(source)? {
        source.open("a block of nodes")?;
        let dimension = source.int("an entity's dimension")?;
        source.int("an entity's number")?;
        let parametric = source.int("0, or 1 for nodes with parameters")?;
        let count = source.size("the number of nodes in a block")?;
        source.close()?;
        let first = into.draft.nodes.len();
        for _ in 0..count {
            source.open("a node's number")?;
            let number = source.size("a node's number")?;
            source.close()?;
            let spot = source.spot();
            let at = [0.0; 3];
            into.draft.nodes.push(DraftNode { number, at, spot });
        }
        let parameters = if parametric == 0 {
            0
        } else {
            dimension.clamp(0, 3)
        };
        for node in into.draft.nodes.iter_mut().skip(first) {
            source.open("a node's coordinates")?;
            for x in &mut node.at {
                *x = source.real("a coordinate of a node")?;
            }
            for _ in 0..parameters {
                source.any_real("a parameter of a node")?;
            }
            source.close()?;
            node.spot = source.spot();
        }
    }
    Ok(())
}

/// `$Elements`: blocks of an entity and a type each.
pub(super) fn elements(source: &mut MeshText<'_>, into: &mut Collector) -> Result<()> {
    for _ in 0..blocks(source)? {
        source.open("a block of elements")?;
        let dimension = source.int("an entity's dimension")?;
        let entity = source.int("an entity's number")?;
        let gmsh_type = source.int("the type of a block's elements")?;
        let count = source.size("the number of elements in a block")?;
        source.close()?;
        let block = format!("elements of entity {entity}");
        let shape = shape(source, gmsh_type, block)?;
        let groups = into.groups_of(dimension, entity);
        for _ in 0..count {
            source.open("an element")?;
            let number = source.size("an element's number")?;
            let mut nodes = [Cell::NONE; 9];
            for node in nodes.iter_mut().take(shape.nodes()) {
                *node = source.size("the number of a node")?;
            }
            source.close()?;
            into.element(number, shape, nodes, source.spot(), &groups)?;
        }
    }
    Ok(())
}
