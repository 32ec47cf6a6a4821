//! What only input files of Abaqus have.

use std::fs;
use std::path::Path;

use plychain::mesh_files::{self, ElementKind, ImportedMesh, abaqus};

use super::model::{KINDS, rectangle};
use super::sizes::edge_length;
use super::writers::{abaqus_type, elements, inp, nodes};

fn read(text: &str) -> ImportedMesh {
    abaqus::parse(text.as_bytes(), Path::new("plate.inp")).unwrap()
}

/// A strip of four elements of 10 x 10 mm; nodes 1 to 5 below, 6 to 10 above.
pub fn strip() -> String {
    let node = |n: usize| format!("{n}, {}., {}.\n", 10 * ((n - 1) % 5), 10 * ((n - 1) / 5));
    let element = |e: usize| format!("{e}, {}, {}, {}, {}\n", e, e + 1, e + 6, e + 5);
    let nodes: String = (1..=10).map(node).collect();
    let elements: String = (1..=4).map(element).collect();
    format!("*Node\n{nodes}*Element, type=CPS4\n{elements}")
}

fn length(mesh: &ImportedMesh, name: &str) -> f64 {
    edge_length(mesh, name).unwrap_or_else(|| panic!("{name} of {:?}", mesh.edges.keys()))
}

#[test]
fn every_type_is_read_in_any_case() {
    let types = [
        (ElementKind::T3, ["cps3", "S3", "M3D3"]),
        (ElementKind::Q4, ["CPS4", "s4r", "M3D4R"]),
        (ElementKind::T6, ["CPS6", "STRI65", "m3d6"]),
        (ElementKind::Q8, ["CPS8R", "S8R", "M3D8"]),
    ];
    for (kind, names) in types {
        for name in names {
            let text = inp(&rectangle(kind, [2, 2])).replace(abaqus_type(kind), name);
            assert_eq!(read(&text).elements[0].kind, kind);
        }
    }
}

#[test]
fn sets_are_generated_nested_continued_and_added_to() {
    let text = strip()
        + "*NSET, NSET=Bottom, GENERATE\n1, 5\n*Nset,nset=Top\n 6, 7,\n 8,9\n*nset , nset = top\n10\n\
           *Elset, elset=odd, generate\n1, 4, 2\n*Elset, elset=Some\nODD, 2\n*Nset, nset=both\nbottom, Top\n\
           *Elset, elset=last,\n generate\n 4, 4, 1\n";
    let mesh = read(&text);
    assert_eq!(length(&mesh, "Bottom"), 40.0);
    assert_eq!(length(&mesh, "Top"), 40.0);
    assert_eq!(
        length(&mesh, "both"),
        100.0,
        "the ends have all their nodes in it too"
    );
    assert_eq!(mesh.regions["odd"], [0, 2]);
    assert_eq!(mesh.regions["Some"], [0, 1, 2]);
    assert_eq!(mesh.regions["last"], [3]);
}

#[test]
fn a_side_belongs_to_a_node_set_only_with_all_its_nodes() {
    let mut text = inp(&rectangle(ElementKind::Q8, [2, 2]));
    let mesh = read(&text);
    let (_, middle, _) = mesh.edge_nodes(mesh.edges["v0"][0]);
    // the writer numbers nodes from 10 in steps of 3
    text = text.replace("nset=v0\n", "nset=whole\n");
    let number = (3 * middle.unwrap() + 10).to_string();
    let without: Vec<String> = text
        .split("*Nset, nset=whole\n")
        .nth(1)
        .and_then(|t| t.split('*').next())
        .unwrap()
        .replace('\n', "")
        .split(',')
        .map(|n| n.trim().to_string())
        .filter(|n| *n != number)
        .collect();
    text += &format!("*Nset, nset=part\n{}\n", without.join(","));
    let mesh = read(&text);
    assert_eq!(
        (mesh.edges["whole"].len(), mesh.edges["part"].len()),
        (2, 1)
    );
}

#[test]
fn surfaces_name_sides_of_elements_sets_and_nodes() {
    let text = strip()
        + "*Elset, elset=_top_S3, internal, generate\n1, 4\n*Surface, type=ELEMENT, name=top\n_top_S3, S3\n\
           *Surface, name=\"low end\"\n1, S4\n*Surface, type=ELEMENT, name=all\n_top_S3,\n\
           *Nset, nset=n, internal\n5, 10\n*Surface, type=NODE, name=high\nn, 1.0\n";
    let mesh = read(&text);
    assert_eq!(length(&mesh, "top"), 40.0);
    assert_eq!(length(&mesh, "low end"), 10.0);
    assert_eq!(length(&mesh, "high"), 10.0);
    assert_eq!(length(&mesh, "all"), 100.0);
    assert_eq!(
        mesh.edges.len(),
        4,
        "internal sets name nothing: {:?}",
        mesh.edges.keys()
    );
    assert!(mesh.regions.is_empty());
}

#[test]
fn sides_of_clockwise_elements_are_counted_as_the_file_does() {
    let text = strip() + "*Surface, name=low\n1, S4\n*Surface, name=top\n1, S3\n2, S3\n";
    let negated = text.replace("0., 10.\n", "0., -10.\n");
    let mesh = read(&negated);
    assert_eq!(mesh.bounds()[0][1], -10.0);
    let ends = |name: &str| {
        let (a, _, b) = mesh.edge_nodes(mesh.edges[name][0]);
        [a, b].map(|n| mesh.nodes[n as usize])
    };
    assert!(ends("low").iter().all(|p| p[0] == 0.0));
    assert!(ends("top").iter().all(|p| p[1] == -10.0));
    assert_eq!(length(&mesh, "top"), 20.0);
}

#[test]
fn sides_of_a_surface_inside_the_mesh_are_left_out_with_a_remark() {
    let mesh = read(&(strip() + "*Surface, name=cut\n1, S2\n1, S1\n"));
    assert_eq!(length(&mesh, "cut"), 10.0);
    assert!(mesh.warnings()[0].contains("1 sides of the surface cut"));
}

#[test]
fn a_node_set_does_not_replace_a_surface_of_its_name() {
    let text = strip() + "*Surface, name=end\n1, S4\n*Nset, nset=end\n5, 10\n";
    let mesh = read(&text);
    let (a, _, _) = mesh.edge_nodes(mesh.edges["end"][0]);
    assert_eq!(mesh.nodes[a as usize][0], 0.0);
    assert!(mesh.warnings()[0].contains("the node set end is left out"));
}

#[test]
fn sets_of_line_elements_name_edges() {
    let lines = "*ELEMENT, type=T3D2, ELSET=low\n11, 1, 6\n*ELEMENT, type=T3D2, ELSET=top\n12, 7, 6\n13, 8, 7\n";
    let mesh = read(&(strip() + lines));
    assert_eq!((length(&mesh, "low"), length(&mesh, "top")), (10.0, 20.0));
    assert_eq!(mesh.elements.len(), 4);
}

#[test]
fn an_instance_of_a_part_is_translated_and_its_names_are_found() {
    for kind in KINDS {
        let model = rectangle(kind, [4, 2]);
        let text = format!(
            "*Part, name=Coupon\n*Node\n{}{}*Nset, nset=Set-1, generate\n10, 16, 3\n*Elset, elset=left\n1, 2\n*End Part\n\
             *Assembly, name=Assembly\n*Instance, name=Coupon-1, part=COUPON\n100., 50., 2.\n*End Instance\n\
             *Node\n1, 0., 0., 99.\n*Nset, nset=RP\n1,\n\
             *Elset, elset=Set-1, instance=Coupon-1\n 2,\n*Elset, elset=deep, instance=Coupon-1\nCoupon-1.left\n\
             *Elset, elset=_s_S1, internal, instance=Coupon-1\n1\n*Surface, type=ELEMENT, name=s\n_s_S1, S1\n*End Assembly\n",
            nodes(&model),
            elements(&model)
                .replace("STRI65", "CPS6")
                .replace("S8R", "CPS8R")
        );
        let mesh = read(&text);
        assert_eq!(mesh.bounds()[0], [90.0, 55.0]);
        assert_eq!(mesh.regions["Set-1"], [1]);
        assert_eq!(mesh.regions["left"], mesh.regions["deep"]);
        assert!(mesh.edges.contains_key("s"));
        assert!(!mesh.edges.contains_key("RP"));
    }
}

#[test]
fn a_name_of_part_and_assembly_means_the_assembly_s() {
    let text = format!(
        "*Part, name=P\n{}*Nset, nset=e\n1, 6\n*End Part\n*Assembly, name=A\n*Instance, name=P-1, part=P\n*End Instance\n\
         *Nset, nset=e, instance=P-1\n5, 10\n*End Assembly\n",
        strip()
    );
    let mesh = read(&text);
    let at = |name: &str| {
        let (a, _, _) = mesh.edge_nodes(mesh.edges[name][0]);
        mesh.nodes[a as usize][0]
    };
    assert_eq!((at("e"), at("P-1.e")), (40.0, 0.0));
}

#[test]
fn files_are_included_from_beside_the_file() {
    let dir = std::env::temp_dir().join(format!("plychain-include-{}", std::process::id()));
    fs::create_dir_all(dir.join("parts")).unwrap();
    let text = strip();
    let (nodes, elements) = text.split_once("*Element").unwrap();
    // data lines alone, in a folder of their own, and an option INPUT
    fs::write(
        dir.join("parts/nodes.txt"),
        nodes.trim_start_matches("*Node\n"),
    )
    .unwrap();
    fs::write(dir.join("parts/more.inp"), "*INCLUDE, INPUT=elements.inp\n").unwrap();
    fs::write(
        dir.join("parts/elements.inp"),
        format!("*Element{elements}"),
    )
    .unwrap();
    fs::write(dir.join("set.dat"), "1, 6\n").unwrap();
    let main = "*Node\n*Include, input=parts/nodes.txt\n*INCLUDE,INPUT=\"parts/more.inp\"\n*Nset, nset=low, input=set.dat\n";
    fs::write(dir.join("main.inp"), main).unwrap();
    let mesh = mesh_files::read(&dir.join("main.inp")).unwrap();
    assert_eq!(length(&mesh, "low"), 10.0);
    let names: Vec<_> = mesh
        .files
        .iter()
        .map(|f| f.file_name().unwrap().to_str().unwrap())
        .collect();
    assert_eq!(
        names,
        [
            "main.inp",
            "nodes.txt",
            "more.inp",
            "elements.inp",
            "set.dat"
        ]
    );
    fs::write(
        dir.join("parts/elements.inp"),
        "*Element, type=CPS4\n1, 1, 2, 7\n*Nset, nset=a\n",
    )
    .unwrap();
    let error = mesh_files::read(&dir.join("main.inp"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("elements.inp:2"), "{error}");
    fs::write(dir.join("parts/elements.inp"), "*include, input=more.inp\n").unwrap();
    let error = mesh_files::read(&dir.join("main.inp"))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("elements.inp:1") && error.contains("included once"),
        "{error}"
    );
    fs::remove_dir_all(&dir).unwrap();
}

#[test]
fn comments_blanks_case_fortran_numbers_and_carriage_returns_do_not_matter() {
    let text = strip() + "*nSeT, NSET = low\n1,\n6\n";
    let odd = text
        .replace("10.", "1.D+01")
        .replace(", ", " ,   ")
        .replace("*Node\n", "** a comment\n\n* NODE\n")
        .replace('\n', "\r\n");
    assert_eq!(read(&odd).nodes, read(&text).nodes);
    assert_eq!(length(&read(&odd), "low"), 10.0);
}
