//! Series drawn at random by a seed: what acts, how much, by which law, on which specimen, seen how.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Dxsm;

use super::camera::Pinhole;
use super::causes::{Cause, Law};
use super::mechanics::{Specimen, Stiffness};
use super::noise::{Family, Noise, Smooth};
use super::series::Series;
use super::subsets::{Cut, Layout, Shape};

/// What is drawn.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// Nothing acts.
    Null,
    /// One effect of the dictionary, half to twice its usual size.
    Single(&'static str),
    Pair(&'static str, &'static str),
    /// Ten effects, each at 3 to 12 % of its usual size.
    Many,
    /// Smooth noise of three white sd in every frame and the reference; an effect, or none.
    Hard(Option<&'static str>),
    /// Something that no dictionary has.
    Foreign(&'static str),
}

/// Effects that act on a laminate, and those that act on steel.
pub const ON_LAMINATE: [&str; 18] = [
    "out_of_plane_translation",
    "out_of_plane_rotation",
    "lens_distortion",
    "magnification",
    "camera_rotation",
    "registration_offset",
    "camera_tilt",
    "thermal_strain",
    "uniform_strain",
    "hole_size",
    "hole_offset",
    "load_misalignment",
    "in_plane_bending",
    "out_of_plane_bending",
    "hole_edge_damage",
    "thickness_taper",
    "ply_misorientation",
    "shear_nonlinearity",
];
pub const ON_STEEL: [&str; 13] = [
    "out_of_plane_translation",
    "out_of_plane_rotation",
    "lens_distortion",
    "magnification",
    "camera_rotation",
    "registration_offset",
    "camera_tilt",
    "thermal_strain",
    "hole_size",
    "load_misalignment",
    "in_plane_bending",
    "out_of_plane_bending",
    "thickness_taper",
];

/// Culprits that no dictionary has.
pub const FOREIGN: [&str; 3] = ["soft_patch", "random_stiffness", "lens_decentring"];

/// Random numbers of a case.
pub(super) struct Draw(pub(super) Pcg64Dxsm);

impl Draw {
    pub(super) fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.random_range(low..high)
    }

    fn among<T: Clone>(&mut self, all: &[T]) -> T {
        all[self.0.random_range(0..all.len())].clone()
    }

    pub(super) fn sign(&mut self) -> f64 {
        self.among(&[-1.0, 1.0])
    }

    /// A vector of a length, in a random direction.
    pub(super) fn vector<const N: usize>(&mut self, length: f64) -> [f64; N] {
        let z = [(); N].map(|()| self.normal());
        let norm = z.iter().map(|z| z * z).sum::<f64>().sqrt();
        z.map(|z| length * z / norm)
    }

    /// A law by the prior of SERIES.md, without the free one.
    fn law(&mut self) -> Law {
        match self.between(0.0, 0.8) {
            p if p < 0.25 => Law::Constant,
            p if p < 0.45 => Law::Load,
            p if p < 0.65 => Law::Seated,
            _ => Law::Drift,
        }
    }
}

/// A series of a kind by a seed.
pub fn case(kind: &Kind, laminate: bool, seed: u64) -> Series {
    let mut draw = Draw(Pcg64Dxsm::seed_from_u64(seed));
    let mut series = bare(laminate, &mut draw);
    series.seed = draw.0.random();
    let usual = |draw: &mut Draw| draw.between(0.5, 2.0);
    match kind {
        Kind::Null => {}
        Kind::Single(name) | Kind::Hard(Some(name)) => {
            let size = usual(&mut draw);
            series.causes = vec![cause(name, size, &series, &mut draw)];
        }
        Kind::Pair(one, two) => {
            for name in [one, two] {
                let size = usual(&mut draw);
                let next = cause(name, size, &series, &mut draw);
                series.causes.push(next);
            }
        }
        Kind::Many => {
            let all = if laminate {
                &ON_LAMINATE[..]
            } else {
                &ON_STEEL[..]
            };
            let mut left = all.to_vec();
            for _ in 0..10 {
                let name = left.swap_remove(draw.0.random_range(0..left.len()));
                let size = draw.between(0.03, 0.12);
                let next = cause(name, size, &series, &mut draw);
                series.causes.push(next);
            }
        }
        Kind::Hard(None) => {}
        Kind::Foreign(name) => series.causes = vec![foreign(name, &series, &mut draw)],
    }
    if matches!(kind, Kind::Hard(_)) {
        series.noise.smooth = Some(Smooth {
            ratio: 3.0,
            length_mm: 5.0,
            family: draw.among(&[Family::Matern32, Family::Gaussian]),
        });
    }
    let sort = if laminate { "laminate" } else { "steel" };
    let what = match kind {
        Kind::Null => "null".into(),
        Kind::Single(name) => (*name).to_string(),
        Kind::Pair(one, two) => format!("{one}-{two}"),
        Kind::Many => "many".into(),
        Kind::Hard(name) => format!("hard-{}", name.unwrap_or("null")),
        Kind::Foreign(name) => format!("foreign-{name}"),
    };
    series.name = format!("{what}-{sort}-{seed}");
    series
}

/// A series in which nothing acts: four loads and a frame after unloading.
pub(super) fn bare(laminate: bool, draw: &mut Draw) -> Series {
    let specimen = if laminate {
        Specimen::laminate()
    } else {
        Specimen::steel()
    };
    let near = |[mean, sd]: [f64; 2], draw: &mut Draw| mean + sd * draw.normal().clamp(-1.8, 1.8);
    let constants = if laminate {
        let priors = specimen.priors.iter();
        priors.map(|(_, prior)| near(*prior, draw)).collect()
    } else {
        vec![draw.between(192.0, 214.0), draw.between(0.27, 0.31)]
    };
    let thickness_mm = near(specimen.thickness_mm, draw);
    let force = if laminate {
        draw.between(2000.0, 2700.0)
    } else {
        draw.between(5200.0, 6200.0)
    };
    let distance = draw.between(600.0, 1000.0);
    let declared = (distance * (1.0 + 0.006 * draw.normal()) / 10.0).round() * 10.0;
    let layout = layout(laminate, draw);
    let rigid = (0..5).map(|_| rigid(draw)).collect();
    let sd_mm = draw.between(2e-4, 3.2e-4);
    let growth = draw.among(&[0.0, 0.0, 0.5]);
    Series {
        name: String::new(),
        constants,
        thickness_mm,
        load_error: 3e-3 * draw.normal(),
        forces_n: [1.0, 2.0, 3.0, 4.0, 0.0].map(|k| k * force / 4.0).to_vec(),
        rigid,
        pinhole: Pinhole {
            distance_mm: distance,
            principal_mm: [6.0 * draw.normal(), 6.0 * draw.normal()],
        },
        declared_distance_mm: declared,
        causes: Vec::new(),
        layout,
        noise: Noise {
            sd_mm,
            growth,
            ..Noise::default()
        },
        seed: 0,
        finer: 1.5,
        specimen,
    }
}

/// A motion in the plane: up to 1.2 mm and 2 mrad.
fn rigid(draw: &mut Draw) -> ([f64; 2], f64) {
    let far = draw.between(0.1, 1.2);
    (draw.vector(far), 2e-3 * draw.between(-1.0, 1.0))
}

/// Subsets of 1 to 1.65 mm over the window.
fn layout(laminate: bool, draw: &mut Draw) -> Layout {
    let pixel_mm = if laminate { 0.05 } else { 0.04 };
    let (side, step) = (draw.among(&[25, 27, 29, 33]), draw.among(&[8, 9, 10]));
    // about as far as the edges, and as long as an upright picture of 4 : 3 shows
    let reach = if laminate { [14.0, 21.8] } else { [9.2, 23.8] };
    let step_mm = pixel_mm * f64::from(step);
    let count = reach.map(|r| 2 * (r / step_mm) as usize + 1);
    let first_mm = count.map(|n| {
        let half = 0.5 * (n - 1) as f64 * step_mm;
        ((draw.between(-0.5, 0.5) * step_mm - half) * 1e5).round() / 1e5
    });
    Layout {
        pixel_mm,
        side,
        step: step as usize,
        first_mm,
        count,
        shape: Shape::Affine,
        cut: Cut::Dropped,
    }
}

/// An effect of the dictionary at some times its usual size (SERIES.md).
fn cause(name: &'static str, size: f64, series: &Series, draw: &mut Draw) -> Cause {
    let signed = size * draw.sign();
    // the lens' centre is about the principal point, the pivot of the specimen anywhere on it
    let center = series.pinhole.principal_mm;
    match name {
        "out_of_plane_translation" => {
            Cause::Rise(1.5e-4 * series.pinhole.distance_mm * signed, draw.law())
        }
        "out_of_plane_rotation" => {
            let pivot = [3.0 * draw.normal(), 10.0 * draw.normal()];
            Cause::Turn(draw.vector(2.0 * size), pivot, draw.law())
        }
        "lens_distortion" => Cause::Lens(0.072 * signed, center),
        "magnification" => Cause::Magnification(signed),
        "camera_rotation" => Cause::CameraRotation(0.5 * signed),
        "registration_offset" => Cause::Registration(draw.vector(0.1 * size)),
        "camera_tilt" => Cause::CameraTilt(draw.vector(1e-4 * size)),
        "thermal_strain" => Cause::ThermalStrain(5.0 * signed, draw.law()),
        "uniform_strain" => Cause::UniformStrain(draw.vector(50.0 * size), draw.law()),
        "hole_size" => Cause::Mechanical(name, vec![2.0 * signed]),
        "hole_offset" => Cause::Mechanical(name, vec![0.3 * signed, 0.0]),
        "load_misalignment" => Cause::Mechanical(name, vec![signed]),
        "in_plane_bending" => Cause::Mechanical(name, vec![0.2 * signed]),
        "out_of_plane_bending" => Cause::Bending {
            per_m: bending_per_m(series) * signed,
            lift_mm: 0.05 * draw.normal(),
        },
        "hole_edge_damage" => {
            let loss = (20.0 * size).min(60.0);
            let deeper = loss * draw.normal().clamp(-1.0, 1.0);
            Cause::Mechanical(name, vec![loss, deeper])
        }
        "thickness_taper" => {
            // what a taper along the load does is hardly there
            Cause::Mechanical(name, vec![2.0 * signed, draw.normal()])
        }
        "ply_misorientation" => Cause::Mechanical(name, vec![signed]),
        "shear_nonlinearity" => Cause::Mechanical(name, vec![1e-7 * size]),
        "interpolation_bias" => Cause::Interpolation(0.01 * size),
        _ => panic!("no usual size of {name}"),
    }
}

/// The curvature whose strain at the face is 5 % of the far strain under the largest force, 1/m.
fn bending_per_m(series: &Series) -> f64 {
    let stiffness = series.loaded().ply_stiffness();
    let mean = stiffness.iter().sum::<nalgebra::Matrix3<f64>>() / stiffness.len() as f64;
    let force = series.forces_n.iter().copied().fold(0.0, f64::max);
    let stress = force / (series.specimen.width_mm * series.thickness_mm);
    let strain = stress * mean.try_inverse().unwrap()[(1, 1)];
    1e3 * 0.05 * strain / (0.5 * series.thickness_mm)
}

/// A culprit that no dictionary has.
fn foreign(name: &str, series: &Series, draw: &mut Draw) -> Cause {
    let radius = 0.5 * series.specimen.diameter_mm;
    match name {
        "soft_patch" => {
            let angle = draw.between(0.0, std::f64::consts::TAU);
            let far = radius * draw.between(1.4, 2.2);
            Cause::Foreign(Stiffness::Patch {
                at_mm: [far * angle.cos(), far * angle.sin()],
                radius_mm: draw.between(1.5, 3.0),
                loss: draw.between(0.25, 0.5),
            })
        }
        "random_stiffness" => Cause::Foreign(Stiffness::Waves {
            length_mm: draw.between(8.0, 16.0),
            sd: draw.between(0.03, 0.06),
            phase: draw.between(0.0, 6.0),
        }),
        "lens_decentring" => {
            // over a millimetre of translation about what a lens of its usual size does
            let size = 5e-5 * draw.between(0.5, 2.0);
            Cause::Decentring(draw.vector(size), series.pinhole.principal_mm)
        }
        _ => panic!("no culprit {name}"),
    }
}

/// The series on which an analysis is judged: nulls, single effects, pairs, many small ones, smooth noise, culprits of no dictionary.
pub fn campaign() -> Vec<(Kind, bool, u64)> {
    let mut all = Vec::new();
    let mut add = |kind: Kind, laminate: bool| {
        let seed = 4000 + all.len() as u64;
        all.push((kind, laminate, seed));
    };
    for laminate in [true, false, true, false] {
        add(Kind::Null, laminate);
    }
    for name in ON_LAMINATE {
        add(Kind::Single(name), true);
    }
    for name in ON_STEEL {
        add(Kind::Single(name), false);
    }
    add(Kind::Pair("lens_distortion", "out_of_plane_rotation"), true);
    add(Kind::Pair("out_of_plane_translation", "hole_size"), true);
    add(Kind::Pair("magnification", "thermal_strain"), false);
    add(
        Kind::Pair("in_plane_bending", "out_of_plane_rotation"),
        false,
    );
    for laminate in [true, false, true, false] {
        add(Kind::Many, laminate);
    }
    for (name, laminate) in [
        (None, true),
        (None, false),
        (Some("out_of_plane_rotation"), true),
        (Some("lens_distortion"), false),
        (Some("hole_size"), true),
        (Some("out_of_plane_translation"), false),
    ] {
        add(Kind::Hard(name), laminate);
    }
    for laminate in [true, false] {
        for name in FOREIGN {
            add(Kind::Foreign(name), laminate);
        }
        add(Kind::Single("interpolation_bias"), laminate);
    }
    all
}
