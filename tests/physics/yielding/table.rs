//! The tabulated plastic part against direct solutions, and the plate that answers from it.

use plychain::fem::{Anchor, Metal, Plate, Setup, Yield};
use plychain::laminate::Ply;

use super::{E, HARDENING, YIELD, in_window, largest, less, plate, steel, strip};

fn metal(setup: &Setup, ply: &Ply) -> Metal {
    let y = setup.yielding.unwrap();
    Metal {
        young: ply.e1,
        poisson: ply.nu12,
        yield_stress: y.stress,
        hardening: y.hardening * ply.e1,
    }
}

/// Error of the table in the window over the size of the plastic part there, and over that of the elastic field.
fn error(plate: &Plate, setup: &Setup, ply: &Ply) -> [f64; 2] {
    let frames = plate.yielding(setup, ply, &[1.0], 1.0).unwrap();
    let table = plate.plastic_table().unwrap();
    let found = table.plastic(setup.load.axial, setup.thickness, &metal(setup, ply));
    let wanted = in_window(plate, &frames[0].plastic_part);
    let elastic = in_window(plate, &less(&frames[0].nodal, &frames[0].plastic_part));
    let error = largest(&less(&in_window(plate, &found), &wanted));
    [&wanted, &elastic].map(|size| error / largest(size))
}

#[test]
fn interpolation_agrees_with_direct_solutions() {
    let plate = plate(&strip(true, 0.5), 0.35);
    let onset = plate.plastic_table().unwrap().onset();
    println!("onset at a level of {onset:.4}");
    assert!((onset - 1.0 / 3.75).abs() < 0.02);
    let mut worst = [0.0_f64; 2];
    for (level, hardening) in [
        (0.29, 1.0),
        (0.33, 0.3),
        (0.37, 3.0),
        (0.43, 1.0),
        (0.49, 0.3),
        (0.53, 0.9),
        (0.57, 3.0),
    ] {
        let mut setup = strip(true, level);
        setup.yielding = setup.yielding.map(|y| Yield {
            hardening: 0.01 * hardening,
            ..y
        });
        let [part, whole] = error(&plate, &setup, &steel());
        println!(
            "level {level}, hardening E / 100 x {hardening}: {part:.1e} of the plastic part, {whole:.1e} of the elastic field"
        );
        // where little has yielded yet, little is known of it
        worst = [
            worst[0].max(if level > 0.4 { part } else { 0.0 }),
            worst[1].max(whole),
        ];
    }
    println!("worst {worst:?}");
    assert!(worst[0] < 0.08 && worst[1] < 0.015, "{worst:?}");
}

/// Stresses under prescribed tractions do not depend on Poisson's ratio, so that the plastic part is linear in it.
#[test]
fn poissons_ratio_costs_nothing_under_tractions() {
    let setup = strip(true, 0.55);
    let plate = plate(&setup, 0.35);
    let part = |nu: f64| {
        let frames = plate.yielding(&setup, &Ply::isotropic(E, nu), &[1.0], 1.0);
        in_window(&plate, &frames.unwrap()[0].plastic_part)
    };
    let [low, middle, high] = [0.2, 0.3, 0.4].map(part);
    let slope: Vec<f64> = less(&high, &low);
    let bend: Vec<f64> = (0..low.len())
        .map(|k| high[k] - 2.0 * middle[k] + low[k])
        .collect();
    let size = largest(&middle);
    println!(
        "nu 0.2 to 0.4: {:.3} of the plastic part, {:.1e} beyond linear",
        largest(&slope) / size,
        largest(&bend) / size
    );
    assert!(largest(&slope) > 0.01 * size);
    assert!(largest(&bend) < 2e-3 * size);
}

#[test]
fn a_table_begins_at_the_onset_smoothly() {
    let setup = strip(true, 0.5);
    let plate = plate(&setup, 0.2);
    let table = plate.plastic_table().unwrap();
    let metal = metal(&setup, &steel());
    let force = |level: f64| level * YIELD * 40.0;
    let at = |level: f64| table.plastic(force(level), 2.0, &metal);
    let onset = table.onset();
    assert_eq!(largest(&at(0.999 * onset)), 0.0);
    let size = largest(&at(0.5));
    // values and slopes have no steps, over the whole range and beyond its end
    let n = 400;
    let levels: Vec<f64> = (0..=n)
        .map(|k| onset + (1.1 - onset) * f64::from(k) / f64::from(n))
        .collect();
    let dof = 2 * plate.mesh.nodes.len() / 3;
    let values: Vec<f64> = levels.iter().map(|l| at(*l)[dof]).collect();
    let slopes: Vec<f64> = values.windows(2).map(|v| v[1] - v[0]).collect();
    let steepest = largest(&slopes);
    for pair in slopes.windows(2) {
        assert!((pair[1] - pair[0]).abs() < 0.1 * steepest, "{pair:?}");
    }
    assert!(largest(&at(0.3)) < 0.2 * size);
}

/// The plate adds its share of the table's plastic part to the elastic answer, however that was found; a frame after unloading has the peak's.
#[test]
fn a_plate_answers_elastically_and_from_its_table() {
    let setup = strip(true, 0.5);
    let plate = plate(&setup, 0.2);
    let elastic = Setup {
        yielding: None,
        ..setup.clone()
    };
    let of_share = |share: f64| Setup {
        yielding: setup.yielding.map(|y| Yield { share, ..y }),
        ..setup.clone()
    };
    let part = plate.plastic_table().unwrap().plastic(
        setup.load.axial,
        setup.thickness,
        &metal(&setup, &steel()),
    );
    let size = largest(&part);
    let zero = plate.solve(&elastic, &steel()).unwrap().nodal;
    let anchor = Anchor::new(&plate, &of_share(0.7), &steel(), &[1.0]).unwrap();
    for share in [1.0, 0.2, -0.1] {
        let expected: Vec<f64> = part.iter().map(|u| share * u).collect();
        let solved = plate.solve(&of_share(share), &steel()).unwrap().nodal;
        assert!(largest(&less(&less(&solved, &zero), &expected)) < 1e-9 * size);
        let near = anchor
            .solve_near(&plate, &of_share(share), &steel())
            .unwrap();
        assert!(largest(&less(&near.nodal, &solved)) < 1e-6 * size);
    }
    let direct = plate.solve_full_order(&setup, &steel()).unwrap().nodal;
    let solved = plate.solve(&setup, &steel()).unwrap().nodal;
    assert!(largest(&less(&direct, &solved)) < 0.03 * size);
    assert!(plate.coordinates(&setup, &steel()).is_none());
    // after unloading
    let mut unloaded = setup.clone();
    unloaded.peak_before = setup.load.axial;
    unloaded.load = setup.load.times(0.0);
    let rest = plate.solve(&unloaded, &steel()).unwrap().nodal;
    assert!(largest(&less(&rest, &part)) < 1e-9 * size);
    let direct = plate.solve_full_order(&unloaded, &steel()).unwrap().nodal;
    assert!(largest(&less(&direct, &rest)) < 0.03 * size);
    let half = Setup {
        load: setup.load.times(0.5),
        ..unloaded
    };
    let solved = plate.solve_full_order(&half, &steel()).unwrap().nodal;
    let expected: Vec<f64> = direct.iter().zip(&zero).map(|(p, e)| p + 0.5 * e).collect();
    assert!(largest(&less(&solved, &expected)) < 1e-6 * size);
}

/// What the table costs and how well it is interpolated on the mesh of the measured strip.
#[test]
#[ignore = "a table on the default mesh"]
fn the_steel_strip_has_a_table_in_seconds() {
    let model = plychain::infer::Model::load(std::path::Path::new(&crate::common::model(
        "steel-s235.json",
    )))
    .unwrap();
    let scene = model.scene();
    let plate = Plate::new(&scene.setup, model.experiment().density()).unwrap();
    let begin = std::time::Instant::now();
    let onset = plate.plastic_table().unwrap().onset();
    println!(
        "{} unknowns: {:.1} s, onset at {onset:.3}",
        plate.mesh.unknowns(),
        begin.elapsed().as_secs_f64()
    );
    for (stress, nu) in [
        (300.0, 0.28),
        (235.0, 0.28),
        (235.0, 0.2),
        (235.0, 0.35),
        (190.0, 0.28),
    ] {
        let setup = Setup {
            yielding: Some(Yield {
                share: 1.0,
                stress,
                hardening: HARDENING / E,
            }),
            ..scene.setup.clone()
        };
        let ply = Ply::isotropic(E, nu);
        let begin = std::time::Instant::now();
        let [part, whole] = error(&plate, &setup, &ply);
        println!(
            "yield stress {stress}, nu {nu}: {part:.1e} of the plastic part, {whole:.1e} of the elastic field; {:.1} s",
            begin.elapsed().as_secs_f64()
        );
        assert!(part < 0.03 || whole < 1e-5);
    }
}
