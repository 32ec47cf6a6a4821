//! Stereo measurements of a plane that is tilted in the table's axes.

use std::fs;

use plychain::field::{ColumnMap, Columns, DATA_AXES, Field, Units, table};

use crate::exports::{proposed, strip};

const HEADERS: [(&str, [&str; 4]); 3] = [
    ("X,Y,Z,U,V,W", ["X", "Y", "U", "V"]),
    (
        "coor.X [mm],coor.Y [mm],coor.Z [mm],disp.Horizontal Displacement U [mm],disp.Vertical Displacement V [mm],disp.Out-Of-Plane: W [mm]",
        [
            "coor.X [mm]",
            "coor.Y [mm]",
            "disp.Horizontal Displacement U [mm]",
            "disp.Vertical Displacement V [mm]",
        ],
    ),
    (
        "x_mm,y_mm,z_mm,ux_mm,uy_mm,uz_mm",
        ["x_mm", "y_mm", "ux_mm", "uy_mm"],
    ),
];

/// The strip in a plane that is turned about x, then about y, seen from some way off.
fn tilted(head: &str, about_x: f64, about_y: f64) -> String {
    let turn = |[x, y]: [f64; 2]| {
        let (sin, cos) = about_x.to_radians().sin_cos();
        let [y, z] = [cos * y, sin * y];
        let (sin, cos) = about_y.to_radians().sin_cos();
        [cos * x - sin * z, y, sin * x + cos * z]
    };
    let row = |[x, y, u, v]: &[f64; 4]| {
        let ([x, y, z], [u, v, w]) = (turn([*x, *y]), turn([*u, *v]));
        format!("{x:.9},{y:.9},{:.9},{u:.9},{v:.9},{w:.9}\n", z + 600.0)
    };
    format!("{head}\n{}", strip().iter().map(row).collect::<String>())
}

fn field(text: &str, names: [&str; 4]) -> Field {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.csv");
    fs::write(&path, text).unwrap();
    let map = ColumnMap {
        columns: Columns::new(names.map(String::from)),
        units: Units::new("mm", "mm"),
    };
    table::read(&path, &map, DATA_AXES).unwrap()
}

/// Distances within the plane and displacements along it are those of the specimen, whatever the angles, and the angle is known.
#[test]
fn a_tilted_plane_is_levelled() {
    for (head, names) in HEADERS {
        for (about_x, about_y) in [
            (0.0, 0.0),
            (0.0, 2.0),
            (5.0, 0.0),
            (0.0, -8.0),
            (12.0, 0.0),
            (6.0, 20.0),
        ] {
            let found = field(&tilted(head, about_x, about_y), names);
            let angle = (f64::cos(f64::to_radians(about_x)) * f64::cos(f64::to_radians(about_y)))
                .acos()
                .to_degrees();
            assert!(
                (found.levelled_deg.unwrap() - angle).abs() < 1e-4,
                "{head}: {about_x} {about_y}"
            );
            let truth = strip();
            for k in [0, 5, 400, truth.len() - 1] {
                let apart = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]);
                let [at, moved] = [0, 2].map(|j| [truth[k][j], truth[k][j + 1]]);
                let first = [truth[200][0], truth[200][1]];
                let distance = apart(found.points[k], found.points[200]) - apart(at, first);
                assert!(distance.abs() < 1e-6, "{about_x} {about_y}: {distance}");
                let size = found.displacement[k];
                assert!((size[0].hypot(size[1]) - moved[0].hypot(moved[1])).abs() < 1e-6);
                // about one axis the directions stay as well
                if about_x == 0.0 || about_y == 0.0 {
                    assert!(
                        apart(size, moved) < 1e-6,
                        "{about_x} {about_y}: {size:?} {moved:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_tilt_above_one_degree_is_said() {
    for (about_y, expected) in [
        (12.0, Some("tilted by 12.00 degrees about y (column Z)")),
        (0.5, None),
    ] {
        let (_, text) =
            proposed(tilted("X,Y,Z,U,V,W", 0.0, about_y).as_bytes(), "t.csv", &[]).unwrap();
        assert_eq!(
            text.contains("the plane of the points"),
            expected.is_some(),
            "{text}"
        );
        assert!(expected.is_none_or(|said| text.contains(said)), "{text}");
    }
    let steep = proposed(tilted("X,Y,Z,U,V,W", 0.0, 75.0).as_bytes(), "t.csv", &[]);
    assert!(steep.unwrap_err().contains("less than 60 degrees"));
}
