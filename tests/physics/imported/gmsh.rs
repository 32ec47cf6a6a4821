//! What only files of Gmsh have.

use std::path::Path;

use plychain::mesh_files::{ElementKind, ImportedMesh, gmsh};

use super::model::rectangle;
use super::sizes::{edge_length, whole_area};
use super::writers::{msh22, msh41};

fn read(text: &str) -> ImportedMesh {
    gmsh::parse(text.as_bytes(), Path::new("plate.msh")).unwrap()
}

/// Two squares of one element each; further elements after them.
pub fn squares(elements: &str) -> String {
    let count = elements.lines().count();
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 1 \"low end\"\n2 2 \"plate\"\n$EndPhysicalNames\n\
         $Nodes\n6\n1 0 0 0\n2 10 0 0\n3 20 0 0\n4 0 10 0\n5 10 10 0\n6 20 10 0\n$EndNodes\n\
         $Elements\n{count}\n{elements}$EndElements\n"
    )
}

pub const PLATE: &str = "1 1 2 1 1 4 1\n2 3 2 2 1 1 2 5 4\n3 3 2 2 1 2 3 6 5\n";

#[test]
fn names_may_have_blanks_and_groups_without_a_name_go_by_their_number() {
    let mesh = read(&squares(&format!("{PLATE}4 1 2 9 1 3 6\n")));
    assert_eq!(mesh.edges.keys().collect::<Vec<_>>(), ["9", "low end"]);
}

#[test]
fn lines_inside_the_mesh_are_left_out_with_a_remark() {
    let mesh = read(&squares(&format!("{PLATE}4 1 2 1 1 2 5\n")));
    assert_eq!(edge_length(&mesh, "low end"), Some(10.0));
    assert!(mesh.warnings()[0].contains("1 of 2 lines of the physical group \"low end\""));
}

#[test]
fn elements_of_no_group_belong_to_the_mesh() {
    let mesh = read(&squares(
        "1 1 2 1 1 4 1\n2 3 2 0 1 1 2 5 4\n3 3 2 0 1 2 3 6 5\n",
    ));
    assert_eq!((mesh.elements.len(), mesh.regions.len()), (2, 0));
    assert!(mesh.warnings()[0].contains("\"plate\" holds no elements"));
}

#[test]
fn a_mesh_whose_only_named_line_lies_inside_has_no_edge() {
    let mesh = read(&squares(
        "1 1 2 1 1 2 5\n2 3 2 2 1 1 2 5 4\n3 3 2 2 1 2 3 6 5\n",
    ));
    assert!(mesh.warnings()[0].contains("no named edge"));
}

#[test]
fn nine_node_quadrilaterals_lose_their_middle() {
    let eight = rectangle(ElementKind::Q8, [2, 2]);
    for binary in [false, true] {
        let mesh = gmsh::parse(&msh41(&eight, binary), Path::new("plate.msh")).unwrap();
        assert_eq!(mesh.nodes.len(), 21);
    }
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n9\n1 0 0 0\n2 2 0 0\n3 2 2 0\n4 0 2 0\n\
                5 1 0 0\n6 2 1 0\n7 1 2 0\n8 0 1 0\n9 1 1 0\n$EndNodes\n\
                $Elements\n1\n1 10 2 5 1 1 2 3 4 5 6 7 8 9\n$EndElements\n";
    let mesh = read(text);
    assert_eq!(mesh.elements[0].kind, ElementKind::Q8);
    assert_eq!(mesh.nodes.len(), 8);
    assert!((whole_area(&mesh) - 4.0).abs() < 1e-12);
}

#[test]
fn carriage_returns_blank_lines_and_unknown_sections_do_not_matter() {
    let text = squares(PLATE).replace("$Nodes", "$Periodic\n0\n$EndPeriodic\n\n$Nodes");
    let plain = read(&squares(PLATE));
    let mesh = read(&text.replace('\n', "\r\n"));
    assert_eq!((mesh.nodes, mesh.edges), (plain.nodes, plain.edges));
}

#[test]
fn parameters_of_nodes_are_passed_over() {
    let text = squares(PLATE).replace("Nodes\n", "ParametricNodes\n");
    let text = text
        .replace("1 0 0 0\n", "1 0 0 0 0 1\n")
        .replace("2 10 0 0\n", "2 10 0 0 1 1 0.5\n");
    let text = ["3 20 0 0", "4 0 10 0", "5 10 10 0", "6 20 10 0"]
        .iter()
        .fold(text, |text, node| {
            text.replace(node, &format!("{node} 2 1 0.1 0.2"))
        });
    assert_eq!(whole_area(&read(&text)), 200.0);
}

#[test]
fn sections_may_stand_in_any_order() {
    let text = squares(PLATE);
    let (start, elements) = text.split_once("$Elements").unwrap();
    let (format, rest) = start.split_once("$PhysicalNames").unwrap();
    let moved = format!("{format}$Elements{elements}$PhysicalNames{rest}");
    assert_eq!(edge_length(&read(&moved), "low end"), Some(10.0));
}

#[test]
fn files_are_told_apart_by_their_first_line() {
    let dir = std::env::temp_dir().join(format!("plychain-meshes-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let model = rectangle(ElementKind::T6, [3, 2]);
    let files = [
        ("a.msh", msh22(&model, true)),
        ("b", msh41(&model, false)),
        ("c.inp", super::writers::inp(&model).into_bytes()),
    ];
    for (name, bytes) in files {
        std::fs::write(dir.join(name), bytes).unwrap();
        assert_eq!(
            plychain::mesh_files::read(&dir.join(name))
                .unwrap()
                .elements
                .len(),
            12
        );
    }
    std::fs::write(dir.join("d.vtk"), "# vtk DataFile\n").unwrap();
    let error = plychain::mesh_files::read(&dir.join("d.vtk")).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("Gmsh (.msh), Abaqus (.inp) or NASTRAN (.bdf)")
    );
    std::fs::remove_dir_all(&dir).unwrap();
}
