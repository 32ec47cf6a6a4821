//! NASTRAN's bulk data: three widths of fields, numbers without an exponent's letter, entries that make no mesh.

use std::fmt::Write;
use std::path::Path;

use plychain::mesh_files::{ElementKind, nastran};

use super::model::{KINDS, Model, rectangle};
use super::sizes::whole_area;
use super::writers::number;

fn card(kind: ElementKind) -> &'static str {
    match kind {
        ElementKind::T3 => "CTRIA3",
        ElementKind::Q4 => "CQUAD4",
        ElementKind::T6 => "CTRIA6",
        ElementKind::Q8 => "CQUAD8",
    }
}

/// How fields are written.
#[derive(Clone, Copy)]
enum Width {
    Free,
    Small,
    Large,
}

fn entry(text: &mut String, width: Width, name: &str, fields: &[String]) {
    match width {
        Width::Free => {
            for (k, part) in fields.chunks(8).enumerate() {
                writeln!(
                    text,
                    "{},{}",
                    if k == 0 { name } else { "+" },
                    part.join(", ")
                )
                .unwrap();
            }
        }
        Width::Small => {
            for (k, part) in fields.chunks(8).enumerate() {
                let part: String = part.iter().map(|f| format!("{f:>8}")).collect();
                writeln!(text, "{:<8}{part}", if k == 0 { name } else { "" }).unwrap();
            }
        }
        Width::Large => {
            for (k, part) in fields.chunks(4).enumerate() {
                let part: String = part.iter().map(|f| format!("{f:<16}")).collect();
                let name = if k == 0 {
                    format!("{name}*")
                } else {
                    "*".into()
                };
                writeln!(text, "{name:<8}{part}").unwrap();
            }
        }
    }
}

fn bulk(model: &Model, width: Width) -> String {
    let mut text =
        String::from("$ a comment, $MeshFor\nSOL 101\nCEND\nSET 1 = 1, 2,\n 3\nBEGIN BULK\n");
    for (i, p) in model.nodes.iter().enumerate() {
        let mut fields = vec![number(i).to_string(), String::new()];
        fields.extend(p.iter().map(|x| format!("{x:.4}")));
        entry(&mut text, width, "GRID", &fields);
    }
    for (e, (kind, nodes)) in model.cells.iter().enumerate() {
        let mut fields = vec![(e + 1).to_string(), (7 + e % 2).to_string()];
        fields.extend(nodes.iter().map(|n| number(*n).to_string()));
        entry(&mut text, width, card(*kind), &fields);
    }
    text + "PSHELL         7       1     1.0\nENDDATA\n"
}

fn parsed(text: &str) -> Result<plychain::mesh_files::ImportedMesh, String> {
    nastran::parse(text.as_bytes(), Path::new("plate.bdf"))
        .map_err(|e| format!("{e} | {}", e.hint_text().unwrap_or_default()))
}

#[test]
fn every_width_gives_the_same_mesh() {
    for kind in KINDS {
        let model = rectangle(kind, [4, 2]);
        for width in [Width::Free, Width::Small, Width::Large] {
            let text = bulk(&model, width);
            assert!(nastran::is_bulk_data(text.as_bytes()));
            let mesh = parsed(&text).unwrap();
            assert_eq!(mesh.nodes.len(), model.nodes.len());
            let [low, high] = mesh.bounds();
            let area = (high[0] - low[0]) * (high[1] - low[1]);
            assert!((whole_area(&mesh) - area).abs() < 1e-9 * area);
            assert_eq!(mesh.regions.keys().collect::<Vec<_>>(), ["7", "8"]);
            assert_eq!(
                mesh.edges.keys().collect::<Vec<_>>(),
                ["x_max", "x_min", "y_max", "y_min"]
            );
        }
    }
}

const SQUARE: &str = "GRID,1,,0.,0.,0.\nGRID,2,0,1.+1,0.,\nGRID,3,,1.0D1,100.-1\nGRID,4,,-0.0,1.0E+1\nCQUAD4,1,1,1,2,3,4\n";

#[test]
fn numbers_as_fortran_writes_them() {
    let mesh = parsed(SQUARE).unwrap();
    assert_eq!(whole_area(&mesh), 100.0);
}

#[test]
fn what_makes_no_mesh_is_left_out_or_refused() {
    let mesh = parsed(
        &(SQUARE.to_string()
            + "CBAR,7,1,1,2\nCONM2,8,1\nRBE2,9,1,123456,2,3\nFORCE,1,2,0,1.,0.,1.,0.\n"),
    )
    .unwrap();
    assert_eq!(
        mesh.remarks
            .iter()
            .filter(|r| r.contains("no area"))
            .count(),
        3
    );
    for (line, expected) in [
        ("CTETRA,7,1,1,2,3,4\n", ["plate.bdf:6", "solid elements"]),
        ("GRID,9,3,0.,0.,0.\n", ["plate.bdf:6", "system 3"]),
        (
            "GRID,9,,0.,x,0.\n",
            ["plate.bdf:6: field 5 of GRID: found x", "a finite number"],
        ),
        (
            "CQUAD8,7,1,1,2,3,4,,\n",
            ["plate.bdf:6", "all midside nodes"],
        ),
        (
            "CTRIA3,1,1,1,2,3\n",
            ["element 1", "every element number once"],
        ),
        ("CTRIA3,7,1,1,2,33\n", ["element 7", "node 33"]),
        ("INCLUDE 'other.bdf'\n", ["plate.bdf:6", "another file"]),
        (
            "CTRIA3,7,1,1,2\n",
            ["field 6 of CTRIA3: found an empty field", "cut short"],
        ),
    ] {
        let error = parsed(&(SQUARE.to_string() + line)).unwrap_err();
        assert!(
            expected.iter().all(|e| error.contains(e)),
            "{line}: {error}"
        );
    }
}

#[test]
fn files_cut_short_are_refused_or_whole() {
    let text = bulk(&rectangle(ElementKind::Q4, [3, 2]), Width::Small);
    let whole = parsed(&text).unwrap();
    for cut in 0..text.len() {
        // without the last line it is whole, and may be cut within a number of an element's last node, which is another mesh's
        if let Ok(mesh) = parsed(&text[..cut]) {
            assert_eq!(mesh.elements.len(), whole.elements.len(), "{cut}");
        }
    }
}
