//! Broken input files: each is refused at a place, with what to do.

use super::abaqus::strip;
use super::broken::{refused, says};

const LOW: &str = "*Nset, nset=low\n1, 6\n";

fn inp(text: &str, expected: &[&str]) {
    says("plate.inp", text, expected);
}

#[test]
fn nodes_without_elements_where_nothing_is_named() {
    inp(
        &strip().replace("4, 4, 5, 10, 9\n", ""),
        &["2 nodes that no element has", "cut short"],
    );
}

#[test]
fn other_element_types() {
    let with = |name: &str| strip().replace("CPS4", name) + LOW;
    inp(
        &with("C3D8R"),
        &["plate.inp:12: found C3D8R: three-dimensional", "shell part"],
    );
    inp(
        &with("CPE4"),
        &["CPE4", "plane strain", "assign CPS elements"],
    );
    inp(&with("CAX4"), &["about an axis"]);
    inp(&with("U1"), &["not known here", "delete these elements"]);
    inp(
        &strip().replace(", type=CPS4", ""),
        &["plate.inp:12", "TYPE=.. in *ELEMENT"],
    );
    inp(&with("CPS8"), &["plate.inp:13: found 5 numbers", "8 nodes"]);
    inp(&with("CPS3"), &["plate.inp:13: found 5 numbers", "3 nodes"]);
}

#[test]
fn mixed_missing_repeated_coincident_and_empty() {
    inp(
        &(strip() + "*Element, type=CPS6\n9, 1, 2, 3, 4, 5, 6\n" + LOW),
        &["plate.inp:18: element 9", "T6 where element 1 is Q4"],
    );
    inp(
        &(strip().replace("2, 2, 3, 8, 7", "2, 2, 3, 8, 77") + LOW),
        &["plate.inp:14: element 2: found node 77"],
    );
    inp(
        &(strip().replace("5, 40., 0.", "4, 40., 0.") + LOW),
        &["plate.inp:6: node 4", "every node number once"],
    );
    inp(
        &(strip().replace("4, 4, 5, 10, 9", "3, 4, 5, 10, 9") + LOW),
        &["plate.inp:16: element 3", "every element number once"],
    );
    inp(
        &(strip() + "*Element, type=T3D2\n1, 1, 6\n" + LOW),
        &["plate.inp:18: element 1", "every element number once"],
    );
    let seam = strip()
        .replace("*Element", "11, 20., 0.\n*Element")
        .replace("3, 3, 4, 9, 8", "3, 11, 4, 9, 8");
    inp(
        &(seam + LOW),
        &[
            "plate.inp:12: node 11",
            "the place of node 3",
            "Tools > merge",
        ],
    );
    inp("*Heading\n*Nset, nset=a\n", &["an empty mesh"]);
    inp("", &["an empty mesh"]);
}

#[test]
fn nodes_out_of_the_plane_or_not_finite() {
    inp(
        &(strip().replace("10, 40., 10.", "10, 40., 10., 2.") + LOW),
        &["plate.inp:11: node 10: found z = 2"],
    );
    inp(
        &(strip().replace("10, 40., 10.", "10, nan, 10.") + LOW),
        &["plate.inp:11", "finite coordinates of node 10"],
    );
    inp(
        &(strip().replace("10, 40., 10.", "10, <x>, 10.") + LOW),
        &["plate.inp:11", "a node's number and its x, y and z"],
    );
    inp(
        &(strip().replace("10, 40., 10.", "-10, 40., 10.") + LOW),
        &["plate.inp:11", "a node's number"],
    );
}

#[test]
fn parts_and_instances_that_are_not_one_translated_part() {
    let file = |instance: &str, more: &str| {
        format!(
            "*Part, name=P\n{}{LOW}*End Part\n{more}*Assembly, name=A\n{instance}*End Assembly\n",
            strip()
        )
    };
    let plain = "*Instance, name=P-1, part=P\n*End Instance\n";
    let rotated =
        "*Instance, name=P-1, part=P\n1., 2., 0.\n1., 2., 0., 1., 2., 1., 90.\n*End Instance\n";
    inp(
        &file(rotated, ""),
        &[
            "plate.inp:24: found a rotation, 1., 2., 0.",
            "rotate the part itself",
        ],
    );
    inp(
        &file(&plain.repeat(2), ""),
        &["one instance of one part", "Merge/Cut"],
    );
    inp(
        &file(plain, "*Part, name=Q\n*End Part\n"),
        &["plate.inp:21", "one part", "Merge/Cut"],
    );
    inp(
        &file(&plain.replace("part=P", "part=Q"), ""),
        &["an instance of the part above", "one of q"],
    );
    let whole = file(plain, "");
    inp(
        whole.split("*End Part").next().unwrap(),
        &["*END PART", "cut short"],
    );
    inp(
        whole.split("*End Assembly").next().unwrap(),
        &["*END ASSEMBLY", "cut short"],
    );
    inp(
        &(strip() + "*End Part\n"),
        &["plate.inp:17", "none that is open"],
    );
}

#[test]
fn keywords_that_make_nodes() {
    for name in ["NGEN", "Nfill", "NCOPY", "ELGEN", "ElCopy", "SYSTEM"] {
        let text = strip() + &format!("*{name}\n1, 2\n");
        inp(
            &text,
            &[
                "plate.inp:17",
                "which makes or moves them",
                "write it from there",
            ],
        );
    }
    inp(
        &strip().replace("*Node", "*Node, system=C"),
        &["plate.inp:1", "rectangular coordinates"],
    );
}

#[test]
fn sets_of_what_is_not_there() {
    inp(
        &(strip() + "*Nset, nset=low\n1, 66\n"),
        &["plate.inp:18: node set low: found node 66"],
    );
    inp(
        &(strip() + "*Elset, elset=low\n1, other\n"),
        &["plate.inp:18: element set low: found other"],
    );
    inp(
        &(strip() + "*Nset, nset=a\nb\n*Nset, nset=b\na\n"),
        &["node set a: found b", "sets defined above"],
    );
    inp(
        &(strip() + "*Nset, nset=a, generate\n1, 2, 0\n"),
        &["plate.inp:18: found 1, 2, 0", "step of GENERATE"],
    );
    inp(
        &(strip() + "*Nset, nset=a, generate\n1, 2, 1, 1\n"),
        &["step of GENERATE"],
    );
    inp(
        &(strip() + "*Nset\n1, 2\n"),
        &["plate.inp:17", "NSET=.. in *NSET"],
    );
}

#[test]
fn surfaces_of_what_is_not_there() {
    inp(
        &(strip() + "*Surface, name=s\n1, S5\n"),
        &["plate.inp:18: found S5", "S1 to S4"],
    );
    inp(
        &(strip() + "*Surface, name=s\n9, S1\n"),
        &["plate.inp:18: surface s: found 9"],
    );
    inp(
        &(strip() + "*Surface, name=s\nnone, S1\n"),
        &["plate.inp:18: surface s: found none"],
    );
    let triangle = "*Node\n1, 0., 0.\n2, 5., 0.\n3, 0., 5.\n*Element, type=CPS3\n1, 1, 2, 3\n*Surface, name=s\n1, S4\n";
    inp(
        triangle,
        &["plate.inp:8: found S4", "a side that element 1 has"],
    );
}

#[test]
fn sides_of_shells_that_abaqus_and_calculix_count_differently() {
    for name in ["S4R", "M3D4"] {
        let text = strip().replace("CPS4", name);
        inp(
            &(text.clone() + "*Surface, name=s\n1, S4\n"),
            &["plate.inp:18: found S4", "E1 to E4", "from S3"],
        );
        let text = text + "*Surface, name=s\n1, E4\n";
        assert!(super::round_trips::parse("plate.inp", text.as_bytes()).is_ok());
    }
}

#[test]
fn includes_that_are_missing_or_name_themselves() {
    inp(
        &(strip() + "*Include, input=nowhere.inp\n"),
        &["plate.inp:17: nowhere.inp", "can be read"],
    );
    inp(
        &(strip() + "*Include, input=plate.inp\n"),
        &["plate.inp:17: found plate.inp", "included once"],
    );
    inp(
        &(strip() + "*Include, input=/dev/zero\n"),
        &["/dev/zero", "a file"],
    );
    inp(
        &(strip() + "*Include\n"),
        &["plate.inp:17", "INPUT=.. in *INCLUDE"],
    );
}

#[test]
fn lines_cut_short() {
    let text = strip();
    let (nodes, _) = text.split_once("10, 40., 10.").unwrap();
    inp(
        &format!("{nodes}10, 40."),
        &["plate.inp:11: found 10, 40.", "cut short"],
    );
    let (elements, _) = text.split_once("4, 4, 5, 10, 9").unwrap();
    inp(
        &format!("{elements}4, 4, 5,\n"),
        &["plate.inp", "only 3 numbers", "cut short"],
    );
    // without its last element the mesh has nodes that no element has, and without its last line's end it is whole
    for cut in 0..text.len() - 1 {
        refused("plate.inp", &text.as_bytes()[..cut]);
    }
}
