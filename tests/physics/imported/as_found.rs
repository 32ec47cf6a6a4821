//! Meshes as they are found: comments first, byte order marks, pointers in the file's place, elements that have no area, names of nothing.

use std::fs;
use std::path::Path;

use plychain::mesh_files::{ElementKind, ImportedMesh, read};

use super::abaqus::strip;
use super::gmsh::{PLATE, squares};
use super::model::{rectangle, ring};
use super::sizes::{edge_length, whole_area};
use super::writers::{inp, msh22, msh41};
use crate::common::{plychain_in, shared};

/// What `read` makes of bytes in a file of a name, or its error with the hint.
fn found(name: &str, bytes: &[u8]) -> Result<ImportedMesh, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    read(&path).map_err(|e| format!("{e} | {}", e.hint_text().unwrap_or_default()))
}

fn mesh(name: &str, bytes: impl AsRef<[u8]>) -> ImportedMesh {
    found(name, bytes.as_ref()).unwrap()
}

fn lengths(mesh: &ImportedMesh) -> Vec<(&str, f64)> {
    let edges = mesh.edges.keys();
    edges
        .map(|name| (name.as_str(), edge_length(mesh, name).unwrap()))
        .collect()
}

/// Names and lengths are these.
fn assert_edges(mesh: &ImportedMesh, expected: &[(&str, f64)]) {
    let found = lengths(mesh);
    let alike = |((a, x), (b, y)): (&(&str, f64), &(&str, f64))| a == b && (x - y).abs() < 1e-9;
    assert!(
        found.len() == expected.len() && found.iter().zip(expected).all(alike),
        "{found:?}, {expected:?}"
    );
}

#[test]
fn comments_and_blank_lines_before_the_format() {
    let whole = mesh("a.msh", squares(PLATE));
    let first = "\n$Comments\nby hand\n$Nodes\n$EndComments\n\n$Comments\n$EndComments\n";
    let later = mesh("a.msh", first.to_string() + &squares(PLATE));
    assert_eq!(lengths(&whole), lengths(&later));
    let error = found("a.msh", b"$Comments\nnever ended\n").unwrap_err();
    assert!(error.contains("$EndComments"), "{error}");
}

#[test]
fn byte_order_marks_and_sixteen_bits() {
    for (name, text) in [
        ("a.msh", squares(PLATE)),
        ("a.inp", strip() + "*Nset, nset=low\n1, 6\n"),
    ] {
        let plain = mesh(name, &text);
        let wide = |pair: fn(u16) -> [u8; 2]| -> Vec<u8> {
            let units = std::iter::once(0xfeff).chain(text.encode_utf16());
            units.flat_map(pair).collect()
        };
        for bytes in [
            ["\u{feff}".as_bytes(), text.as_bytes()].concat(),
            wide(u16::to_le_bytes),
            wide(u16::to_be_bytes),
        ] {
            assert_eq!(lengths(&mesh(name, bytes)), lengths(&plain));
        }
    }
}

#[test]
fn what_stands_in_the_place_of_a_file_is_named() {
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 812345\n";
    for (bytes, expected) in [
        (
            pointer.as_bytes(),
            ["pointer of Git LFS", "812345 bytes", "git lfs pull"],
        ),
        (
            b"/annex/objects/SHA256E-s4--0.msh\n",
            ["git-annex", "pointer", "git annex get"],
        ),
        (b"<!DOCTYPE html>\n<html>", ["web page", "download", "Raw"]),
        (b"\x1f\x8b\x08\x00", ["gzip", "archive", "unpack"]),
    ] {
        for name in ["a.msh", "a.inp", "a.bdf"] {
            let error = found(name, bytes).unwrap_err();
            assert!(expected.iter().all(|e| error.contains(e)), "{error}");
        }
    }
    let error = found("a.msh", b"").unwrap_err();
    assert!(error.contains("an empty file"), "{error}");
}

#[test]
fn clockwise_elements_are_turned() {
    let area = whole_area(&mesh("a.msh", squares(PLATE)));
    let turned = mesh("a.msh", squares(&PLATE.replace("2 3 6 5", "2 5 6 3")));
    assert_eq!(whole_area(&turned), area);
    assert!(
        turned.remarks[0].contains("1 of 2 elements run clockwise"),
        "{:?}",
        turned.remarks
    );
    // sides of a surface are counted in the file's own order
    let flipped = strip().replace("2, 2, 3, 8, 7", "2, 7, 8, 3, 2");
    let surfaces = "*Surface, name=top\n2, S1\n*Surface, name=bottom\n2, S3\n";
    let mesh = mesh("a.inp", flipped + surfaces);
    let y = |name: &str| {
        let (a, _, b) = mesh.edge_nodes(mesh.edges[name][0]);
        [a, b].map(|n| mesh.nodes[n as usize][1])
    };
    assert_eq!([y("top"), y("bottom")], [[10.0; 2], [0.0; 2]]);
}

#[test]
fn a_fold_is_no_clockwise_element() {
    // the third node of element 2 beyond the second's: turned, it overlaps its neighbour
    let folded = squares(PLATE)
        .replace("3 20 0 0", "3 5 0 0")
        .replace("6 20 10 0", "6 5 10 0");
    let error = found("a.msh", folded.as_bytes()).unwrap_err();
    assert!(error.contains("do not overlap"), "{error}");
}

#[test]
fn elements_without_area_are_left_out() {
    // a triangle whose corners lie on a line, and one between two nodes
    let flat = format!("{PLATE}4 2 2 2 1 1 2 3\n5 2 2 2 1 1 1 2\n");
    let mesh_of = mesh("a.msh", squares(&flat));
    assert_eq!(mesh_of.elements.len(), 2);
    assert_eq!(mesh_of.regions["plate"], [0, 1]);
    assert!(
        mesh_of.remarks[0].contains("2 in all"),
        "{:?}",
        mesh_of.remarks
    );
    let points = "*Element, type=MASS, elset=weights\n90, 1\n*Element, type=SPRINGA, elset=springs\n91, 1, 2\n92, 2,\n3\n\
                  *Elset, elset=plate\n1, 2, 3, 4, 90\n*Nset, nset=low\n1, 6\n*Surface, name=s\n91, S1\n1, S1\n";
    let mesh_of = mesh("a.inp", strip() + points);
    assert_eq!(mesh_of.elements.len(), 4);
    assert_eq!(mesh_of.regions.keys().collect::<Vec<_>>(), ["plate"]);
    assert_edges(&mesh_of, &[("low", 10.0), ("s", 10.0)]);
    for name in ["MASS", "SPRINGA"] {
        let said = mesh_of.remarks.iter().filter(|r| r.contains(name));
        assert_eq!(said.count(), 1, "{:?}", mesh_of.remarks);
    }
}

#[test]
fn a_file_without_names_gets_those_of_its_box() {
    for kind in [ElementKind::T3, ElementKind::Q8] {
        let mut plain = rectangle(kind, [4, 2]);
        plain.edges.clear();
        plain.regions.clear();
        for (name, bytes) in [
            ("a.msh", msh22(&plain, true)),
            ("a.msh", msh41(&plain, false)),
            ("a.inp", inp(&plain).into()),
        ] {
            let mesh = mesh(name, bytes);
            let [low, high] = mesh.bounds();
            let [width, height] = [0, 1].map(|k| high[k] - low[k]);
            let expected = [
                ("x_max", height),
                ("x_min", height),
                ("y_max", width),
                ("y_min", width),
            ];
            assert_edges(&mesh, &expected);
            assert!(
                mesh.remarks
                    .last()
                    .unwrap()
                    .contains("the file names no edge")
            );
        }
    }
    let mut disc = ring(ElementKind::T6, [2, 24]);
    disc.edges.clear();
    disc.regions.clear();
    let mesh = mesh("a.msh", msh41(&disc, false));
    assert_eq!(mesh.edges.keys().collect::<Vec<_>>(), ["hole", "side_1"]);
    assert!(mesh.circle("hole").is_some());
}

/// A plate with a chamfer and a square cut-out: corners divide what lies between the sides of the box, and no circle is no hole.
#[test]
fn corners_divide_what_the_box_does_not_have() {
    let mut nodes = String::new();
    let mut cells = String::new();
    let number = |i: usize, j: usize| 10 * i + j + 1;
    for (i, j) in (0..25).map(|k| (k / 5, k % 5)) {
        nodes += &format!("{}, {i}, {j}\n", number(i, j));
    }
    for (i, j) in (0..16).map(|k| (k / 4, k % 4)).filter(|c| *c != (1, 1)) {
        let [a, b, c, d] = [
            number(i, j),
            number(i + 1, j),
            number(i + 1, j + 1),
            number(i, j + 1),
        ];
        let e = number(i, j);
        match (i, j) {
            (3, 3) => {
                cells += &format!("*Element, type=CPS3\n{e}, {a}, {b}, {d}\n*Element, type=CPS4\n")
            }
            _ => cells += &format!("{e}, {a}, {b}, {c}, {d}\n"),
        }
    }
    nodes = nodes.replace("45, 4, 4\n", "");
    let mesh = mesh(
        "a.inp",
        format!("*Node\n{nodes}*Element, type=CPS4\n{cells}"),
    );
    let expected = [
        ("inner_1", 4.0),
        ("side_1", 2f64.sqrt()),
        ("x_max", 3.0),
        ("x_min", 4.0),
        ("y_max", 3.0),
        ("y_min", 4.0),
    ];
    assert_edges(&mesh, &expected);
}

#[test]
#[ignore = "needs ../shared"]
fn the_files_of_mesh_files() {
    let files = shared("field-files/mesh-files");
    let folder = tempfile::tempdir().unwrap();
    let propose = |name: &str| {
        let path = files.join(name);
        let model = name.replace('.', "-");
        let end = plychain_in(
            folder.path(),
            &["init", &model, "--mesh", path.to_str().unwrap()],
        );
        let text = [end.stdout, end.stderr].concat();
        let text = String::from_utf8(text).unwrap();
        let written = Path::new(folder.path())
            .join(format!("{model}.json"))
            .exists();
        assert_eq!(end.status.success(), written, "{text}");
        (written, text)
    };
    for (name, expected) in [
        (
            "comment-first.msh",
            vec!["40 elements", "edges \"high\", \"low\""],
        ),
        (
            "mass-and-spring.inp",
            vec!["40 elements", "\"low\"", "\"high\"", "MASS", "left out"],
        ),
        (
            "no-groups.msh",
            vec!["40 elements", "x_min", "y_max", "names no edge"],
        ),
    ] {
        let (is_read, text) = propose(name);
        assert!(
            is_read && expected.iter().all(|e| text.contains(e)),
            "{name}: {text}"
        );
    }
    for (name, expected) in [
        ("lfs-pointer.msh", vec!["Git LFS"]),
        ("lfs-pointer.inp", vec!["Git LFS"]),
        ("inner-edge-only.msh", vec!["inner", "physical group"]),
    ] {
        let (is_read, text) = propose(name);
        assert!(
            !is_read && expected.iter().all(|e| text.contains(e)),
            "{name}: {text}"
        );
        assert!(!text.contains("found , "), "{text}");
    }
}
