//! Names and fields of mesh files as other programs write them.

use std::path::Path;

use plychain::mesh_files::{ImportedMesh, abaqus, nastran};

fn names(mesh: &ImportedMesh) -> Vec<&str> {
    mesh.edges.keys().map(String::as_str).collect()
}

/// Four squares in a row with line elements at both ends.
const ROW: &str = "*NODE\n1,0,0\n2,1,0\n3,2,0\n4,0,1\n5,1,1\n6,2,1\n*ELEMENT,TYPE=T3D2,ELSET=left\n11,1,4\n*ELEMENT,TYPE=T3D2,ELSET=right\n12,3,6\n*ELEMENT,TYPE=CPS4,ELSET=plate\n1,1,2,5,4\n2,2,3,6,5\n";

/// A set of nodes may be those of a set of elements.
#[test]
fn node_sets_of_element_sets_name_edges() {
    let deck = |sets: &str| abaqus::parse(format!("{ROW}{sets}").as_bytes(), Path::new("a.inp"));
    let mesh = deck("*NSET,NSET=clamp,ELSET=left\n*NSET, nset=pull, elset=RIGHT\n").unwrap();
    for name in ["clamp", "pull"] {
        assert!(names(&mesh).contains(&name), "{:?}", names(&mesh));
        assert_eq!(mesh.edges[name].len(), 1);
    }
    // with further nodes, and as a member of another set
    let mesh = deck("*NSET,NSET=a,ELSET=left\n*NSET,NSET=b\na,2\n").unwrap();
    assert!(names(&mesh).contains(&"b"), "{:?}", names(&mesh));
    // of plane elements it goes round them, which is said
    let mesh = deck("*ELSET,ELSET=end\n2\n*NSET,NSET=pull,ELSET=end\n").unwrap();
    assert_eq!(mesh.edges["pull"].len(), 3);
    assert!(
        mesh.remarks
            .iter()
            .any(|r| r.contains("pull") && r.contains("all nodes of elements")),
        "{:?}",
        mesh.remarks
    );
    let error = deck("*NSET,NSET=a,ELSET=nowhere\n")
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("nowhere") && error.contains("a.inp"),
        "{error}"
    );
}

/// A tab ends the field that it stands in, whether that is full or empty.
#[test]
fn tabs_of_bulk_data_end_their_fields() {
    let plain =
        "GRID,1,,0.,0.\nGRID,2,,10.,0.\nGRID,3,,10.,5.\nGRID,4,,0.,5.\nCQUAD4,1,7,1,2,3,4\n";
    let tabs = "GRID\t1\t\t0.\t0.\nGRID\t2\t\t10.00000\t0.\nGRID    3\t\t10.\t5.\nGRID*\t4\t\t0.\t5.\nCQUAD4\t1\t7\t1\t2\t3\t4\n";
    let [plain, tabs] =
        [plain, tabs].map(|text| nastran::parse(text.as_bytes(), Path::new("a.bdf")).unwrap());
    assert_eq!(plain.nodes, tabs.nodes);
    assert_eq!(names(&plain), names(&tabs));
}
