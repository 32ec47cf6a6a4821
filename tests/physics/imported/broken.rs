//! Broken meshes of Gmsh: each is refused at a place, with what to do.

use plychain::error::Blame;
use plychain::mesh_files::ElementKind;

use super::gmsh::{PLATE, squares};
use super::model::{Model, rectangle};
use super::round_trips::parse;
use super::writers::{msh22, msh41};

/// The error of a file, with its hint, in one line.
pub fn refused(name: &str, bytes: &[u8]) -> String {
    let error = parse(name, bytes).expect_err(name);
    assert_eq!(error.blame(), Blame::Input);
    format!("{error} | {}", error.hint_text().unwrap_or_default())
}

/// Check that a file's error says all of this.
pub fn says(name: &str, text: impl AsRef<[u8]>, expected: &[&str]) {
    let error = refused(name, text.as_ref());
    assert!(error.starts_with(name), "{error}");
    for part in expected {
        assert!(error.contains(part), "{error}\nlacks {part}");
    }
}

fn msh(text: &str, expected: &[&str]) {
    says("plate.msh", text, expected);
}

/// A model through 2.2 and 4.1, ASCII and binary.
fn model(model: &Model, expected: &[&str]) {
    for bytes in [
        msh22(model, false),
        msh22(model, true),
        msh41(model, false),
        msh41(model, true),
    ] {
        says("plate.msh", bytes, expected);
    }
}

#[test]
fn names_of_groups_that_hold_nothing() {
    let text = squares("2 3 2 0 1 1 2 5 4\n3 3 2 0 1 2 3 6 5\n");
    msh(&text, &["no elements in them", "Mesh.SaveAll = 0"]);
}

#[test]
fn folded_elements() {
    msh(
        &squares(&PLATE.replace("1 2 5 4", "1 5 2 4")),
        &["element 2", "folded", "corners go around"],
    );
    let mut bulged = rectangle(ElementKind::Q8, [2, 2]);
    let middle = bulged.cells[0].1[4];
    bulged.nodes[middle][1] += 9.0;
    model(&bulged, &["element", "folded"]);
}

#[test]
fn a_node_twice_in_an_element() {
    msh(
        &squares(&PLATE.replace("1 2 5 4", "1 2 2 4")),
        &["plate.msh:21: element 2", "4 different nodes", "triangles"],
    );
}

#[test]
fn unknown_types_space_and_higher_orders() {
    let with = |kind: &str| squares(&PLATE.replace("2 3 2 2 1", &format!("2 {kind} 2 2 1")));
    msh(
        &with("4"),
        &[
            "plate.msh:21: element 2",
            "type 4",
            "three-dimensional",
            "Mesh > 2D",
        ],
    );
    msh(
        &with("21"),
        &["type 21", "order above 2", "ElementOrder = 2"],
    );
    msh(&with("999"), &["type 999", "unknown"]);
    msh(&with("-7"), &["type -7", "unknown"]);
}

#[test]
fn mixed_orders() {
    let mut mixed = rectangle(ElementKind::Q8, [2, 1]);
    let (kind, nodes) = &mut mixed.cells[1];
    *kind = ElementKind::Q4;
    nodes.truncate(4);
    model(
        &mixed,
        &[
            "where element",
            "all linear (T3, Q4) or all quadratic (T6, Q8)",
            "Set order 2",
        ],
    );
}

#[test]
fn coincident_nodes_along_a_seam() {
    for kind in [ElementKind::T3, ElementKind::Q8] {
        let seam = rectangle(kind, [3, 2]).twice([30.0, 0.0]);
        model(
            &seam,
            &[
                "the place of node",
                "one node at a place",
                "Gmsh: Coherence Mesh; Abaqus: Tools > merge",
            ],
        );
        let nearly = rectangle(kind, [3, 2]).twice([30.0 + 1e-6, 0.0]);
        model(&nearly, &["merge coincident nodes"]);
    }
}

#[test]
fn separate_parts() {
    let apart = rectangle(ElementKind::T6, [3, 2]).twice([30.5, 0.0]);
    model(
        &apart,
        &[
            "element",
            "12 of 24 elements that nothing connects",
            "one part",
        ],
    );
}

#[test]
fn hanging_nodes() {
    // two small squares beside a large one
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n1 0 0 0\n2 10 0 0\n3 10 10 0\n4 0 10 0\n5 15 0 0\n6 15 5 0\n7 15 10 0\n8 10 5 0\n$EndNodes\n\
                $Elements\n3\n1 3 1 5 1 2 3 4\n2 3 1 5 2 5 6 8\n3 3 1 5 8 6 7 3\n$EndElements\n";
    msh(
        text,
        &[
            "node 8",
            "hanging node, within a side of element 1",
            "BooleanFragments",
        ],
    );
}

#[test]
fn a_midside_node_that_is_another_s_corner() {
    let mut hanging = rectangle(ElementKind::Q8, [1, 1]);
    // along u1: corners 1 and 2, midside node 5; two elements beside it
    let at: Vec<usize> = hanging.cells[0].1.clone();
    let (low, high, middle) = (at[1], at[2], at[5]);
    let mut add = |x: f64, y: f64| {
        hanging.nodes.push([x, y, 0.0]);
        hanging.nodes.len() - 1
    };
    let corners: Vec<usize> = [5.0, 10.0, 15.0].map(|y| add(24.0, y)).to_vec();
    let mids: Vec<usize> = [
        [22.0, 5.0],
        [24.0, 7.5],
        [22.0, 10.0],
        [20.0, 7.5],
        [24.0, 12.5],
        [22.0, 15.0],
        [20.0, 12.5],
    ]
    .map(|[x, y]| add(x, y))
    .to_vec();
    hanging.cells.push((
        ElementKind::Q8,
        vec![
            low, corners[0], corners[1], middle, mids[0], mids[1], mids[2], mids[3],
        ],
    ));
    hanging.cells.push((
        ElementKind::Q8,
        vec![
            middle, corners[1], corners[2], high, mids[2], mids[4], mids[5], mids[6],
        ],
    ));
    hanging.edges.remove("u1");
    model(&hanging, &["hanging node", "corner to corner"]);
}

#[test]
fn overlapping_elements() {
    msh(
        &squares(&format!("{PLATE}4 2 2 2 1 1 2 6\n")),
        &["element", "do not overlap", "same side of it"],
    );
}

#[test]
fn missing_and_repeated_nodes_and_elements() {
    msh(
        &squares(&PLATE.replace("2 3 6 5", "2 3 66 5")),
        &[
            "plate.msh:22: element 3: found node 66",
            "nodes that the file defines",
        ],
    );
    msh(
        &squares(PLATE).replace("4 0 10 0", "3 0 10 0"),
        &["plate.msh:14: node 3", "every node number once", "renumber"],
    );
    msh(
        &squares(&PLATE.replace("3 3 2 2", "2 3 2 2")),
        &["plate.msh:22: element 2", "every element number once"],
    );
}

#[test]
fn a_mesh_that_is_not_flat() {
    msh(
        &squares(PLATE).replace("6 20 10 0", "6 20 10 3"),
        &[
            "plate.msh:16: node 6: found z = 3",
            "flat mesh",
            "x-y plane",
        ],
    );
}

#[test]
fn no_elements_or_nothing_at_all() {
    msh(
        &squares("1 1 2 1 1 4 1\n"),
        &["only nodes and lines", "Mesh > 2D"],
    );
    msh(&squares(""), &["only nodes"]);
    msh("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", &["an empty mesh"]);
    msh("", &["plate.msh:1", "$MeshFormat"]);
}

#[test]
fn numbers_that_are_not_finite_or_not_numbers() {
    for bad in ["nan", "inf", "1e999"] {
        msh(
            &squares(PLATE).replace("6 20 10 0", &format!("6 {bad} 10 0")),
            &["plate.msh:16", "a finite number"],
        );
    }
    msh(
        &squares(PLATE).replace("6 20 10 0", "6 2O 10 0"),
        &["plate.msh:16: found 2O", "a coordinate"],
    );
    msh(
        &squares(PLATE).replace("6 20 10 0", "6 1e300 10 0"),
        &["node 6", "below 1e9 mm"],
    );
    let mut nan = rectangle(ElementKind::T3, [2, 2]);
    nan.nodes[3][0] = f64::NAN;
    says(
        "plate.msh",
        msh41(&nan, true),
        &["plate.msh: byte", "a finite number"],
    );
}

#[test]
fn files_cut_short_anywhere() {
    let whole = rectangle(ElementKind::Q8, [2, 2]);
    for bytes in [
        msh22(&whole, false),
        msh22(&whole, true),
        msh41(&whole, false),
        msh41(&whole, true),
    ] {
        // the last line may lose its end
        for cut in 0..bytes.len() - 1 {
            let error = refused("plate.msh", &bytes[..cut]);
            assert!(error.starts_with("plate.msh"), "{error}");
        }
        let error = refused("plate.msh", &bytes[..bytes.len() - 60]);
        assert!(error.contains("cut short"), "{error}");
    }
}

#[test]
fn counts_that_do_not_fit() {
    msh(
        &squares(PLATE).replace("$Nodes\n6", "$Nodes\n7"),
        &[
            "plate.msh:17: found $EndNodes, expected a node",
            "fewer lines",
        ],
    );
    msh(
        &squares(PLATE).replace("$Nodes\n6", "$Nodes\n5"),
        &["plate.msh:16", "expected $EndNodes", "more lines"],
    );
    msh(
        &squares(PLATE).replace("6 20 10 0", "6 20 10"),
        &["plate.msh:16: found the end of the line"],
    );
    msh(
        &squares(PLATE).replace("6 20 10 0", "6 20 10 0 1"),
        &["plate.msh:16: found 1, expected the end of the line"],
    );
}

#[test]
fn foreign_versions_byte_orders_and_partitions() {
    for version in ["1.0", "4.0", "3", "5.0"] {
        msh(
            &squares(PLATE).replace("2.2 0 8", &format!("{version} 0 8")),
            &["plate.msh:2", version, "MshFileVersion = 4.1"],
        );
    }
    for bytes in [
        msh22(&rectangle(ElementKind::T3, [1, 1]), true),
        msh41(&rectangle(ElementKind::T3, [1, 1]), true),
    ] {
        let mut foreign = bytes.clone();
        let at = foreign.windows(4).position(|w| w == [1, 0, 0, 0]).unwrap();
        foreign[at..at + 4].copy_from_slice(&[0, 0, 0, 1]);
        says("plate.msh", &foreign, &["big-endian", "Mesh.Binary = 0"]);
        let text = String::from_utf8_lossy(&bytes[..60]).replace(" 1 8\n", " 1 4\n");
        says("plate.msh", text, &["8 bytes", "4 bytes", "save as ASCII"]);
    }
    let text = squares(PLATE).replace(
        "$Nodes",
        "$PartitionedEntities\n2\n$EndPartitionedEntities\n$Nodes",
    );
    msh(&text, &["plate.msh:9", "not partitioned", "Delete"]);
}

#[test]
fn a_line_whose_surface_is_missing() {
    msh(
        &squares(&format!("{PLATE}4 1 2 1 1 1 6\n")),
        &[
            "plate.msh:23: line element 4",
            "\"low end\"",
            "put it into a physical group",
        ],
    );
}
