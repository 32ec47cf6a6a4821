//! Series with what no dictionary has, each at some sizes: what is written is changed after it was simulated, by formulas of this file. No
//! verdict is sure and wrong, and the intervals to quote hold the constants.
//!
//! The specimen is a strip of steel, or a laminate, with a hole before a camera, with four loads and an unloaded picture.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Complex;
use plychain::identify::{inverse_problem, prepare, start};
use plychain::infer::Model;
use plychain::progress::Silent;
use plychain::trace::Status;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use serde_json::{Value, json};

use crate::common::{fresh, root, simulated, table};
use crate::load_mistakes::{LAMINATE, LARGEST, OF_LAMINATE, STEEL, laminate, steel};
use crate::loops::{Case, Ended, all, looped};

/// Loads of the pictures over the largest.
const LOADS: [f64; 5] = [0.25, 0.5, 0.75, 1.0, 0.0];
/// Width and thickness of the strip of steel, radius of both holes, distance of the camera, mm.
const WIDTH_MM: f64 = 20.0;
const THICKNESS_MM: f64 = 2.0;
const HOLE_MM: f64 = 4.0;
const CAMERA_MM: f64 = 600.0;
const NOISE_NM: f64 = 150.0;

/// What is pulled.
#[derive(Clone, Copy, PartialEq)]
enum Specimen {
    Steel,
    Laminate,
}

impl Specimen {
    /// The file of its model.
    fn model(self) -> String {
        match self {
            Self::Steel => steel(),
            Self::Laminate => laminate(),
        }
    }

    fn constants(self) -> &'static [f64] {
        match self {
            Self::Steel => &STEEL,
            Self::Laminate => &LAMINATE,
        }
    }

    /// The constants as `simulate` takes them.
    fn truth(self) -> String {
        let names: &[&str] = match self {
            Self::Steel => &["E_GPa", "nu"],
            Self::Laminate => &["E1_GPa", "E2_GPa", "nu12", "G12_GPa"],
        };
        let pairs = names.iter().zip(self.constants());
        pairs
            .map(|(name, x)| format!(" --set {name}={x}"))
            .collect()
    }

    fn thickness_mm(self) -> f64 {
        match self {
            Self::Steel => THICKNESS_MM,
            Self::Laminate => 0.78,
        }
    }

    /// The largest force, N.
    fn force_n(self) -> f64 {
        match self {
            Self::Steel => LARGEST,
            Self::Laminate => OF_LAMINATE,
        }
    }

    /// What the manual calls it.
    fn name(self) -> &'static str {
        match self {
            Self::Steel => "steel",
            Self::Laminate => "laminate",
        }
    }
}

/// A point as it is written: x and y in mm, the load along y, and the displacements in um.
type Point = [f64; 4];

/// What is wrong with the measurement, by its size.
#[derive(Clone, Copy)]
enum Attack {
    /// The pictures were correlated, and then averaged over a square of this side, mm.
    Smoothed,
    /// The program writes multiples of so many um.
    Rounded,
    /// The camera's axes are not at right angles: x grows by this share of y.
    Skewed,
    /// The unloaded strip is bent along its length by this curvature, 1/m, and straightens under load.
    Bowed,
    /// The hole is longer along the load: sides a and b with (a - b) / (a + b) in percent.
    Elliptic,
    /// Each picture was correlated with the one before: noise of so many um adds up.
    Incremental,
    /// Air moves before the camera: smooth noise of so many um in each picture, over 5.7 mm.
    Hazy,
    /// One end is clamped over its whole width, at this distance from the hole, mm: it does not grow narrower there.
    Clamped,
    /// The sheet was rolled: Young's modulus across the load exceeds that along it by this percentage, the shear modulus that of the mean.
    Rolled,
}

/// Attacks as the manual lists them, with sizes.
const ATTACKS: [(&str, Attack, [f64; 3]); 9] = [
    (
        "averaged over another 1.2, 1.6, 2.0 mm",
        Attack::Smoothed,
        [1.2, 1.6, 2.0],
    ),
    (
        "written in steps of 1, 2, 4 um",
        Attack::Rounded,
        [1.0, 2.0, 4.0],
    ),
    (
        "axes of the picture skewed by 1, 2, 4 mrad",
        Attack::Skewed,
        [1e-3, 2e-3, 4e-3],
    ),
    (
        "bowed by 0.02, 0.04, 0.08 1/m",
        Attack::Bowed,
        [0.02, 0.04, 0.08],
    ),
    (
        "hole elliptic by 2, 4, 8 %",
        Attack::Elliptic,
        [1.0, 2.0, 4.0],
    ),
    (
        "noise of 50, 100, 200 nm adds up",
        Attack::Incremental,
        [0.05, 0.1, 0.2],
    ),
    (
        "smooth noise of 0.3, 0.6, 1.2 um",
        Attack::Hazy,
        [0.3, 0.6, 1.2],
    ),
    (
        "an end clamped at 30, 20, 15 mm",
        Attack::Clamped,
        [30.0, 20.0, 15.0],
    ),
    (
        "rolled: E across 4, 8, 16 % larger",
        Attack::Rolled,
        [4.0, 8.0, 16.0],
    ),
];

impl Attack {
    /// What is written of the picture under `load`, from what it should be.
    fn written(self, of: Specimen, (size, load): (f64, f64), points: &[Point]) -> Vec<Point> {
        let each = |of: &dyn Fn(Point) -> Point| points.iter().map(|p| of(*p)).collect();
        match self {
            Self::Smoothed => each(&|p| averaged(p, points, size)),
            Self::Rounded => each(&|[x, y, u, v]| {
                let [u, v] = [u, v].map(|d| (d / size).round() * size);
                [x, y, u, v]
            }),
            Self::Skewed => each(&|[x, y, u, v]| [x + size * y, y, u + size * v, v]),
            Self::Bowed => each(&|[x, y, u, v]| {
                let [du, dv] = straightened(1e-3 * size, load, (of.thickness_mm(), [x, y]));
                [x, y, u + 1e3 * du, v + 1e3 * dv]
            }),
            Self::Elliptic => each(&|[x, y, u, v]| {
                let stress = LARGEST * load / (WIDTH_MM * THICKNESS_MM);
                let [of_ellipse, of_circle] =
                    [-0.01 * size, -1e-7].map(|m| beside_ellipse(m, stress, Complex::new(x, y)));
                let d = of_ellipse - of_circle;
                [x, y, u + 1e3 * d.re, v + 1e3 * d.im]
            }),
            Self::Incremental | Self::Hazy | Self::Clamped | Self::Rolled => points.to_vec(),
        }
    }

    /// Whether there is a formula for the specimen.
    fn applies(self, to: Specimen) -> bool {
        to == Specimen::Steel || !matches!(self, Self::Elliptic | Self::Rolled)
    }

    /// A folder with a measurement that has the fault.
    fn measured(self, of: Specimen, size: f64, seed: u64) -> Model {
        let forces = LOADS
            .map(|load| (of.force_n() * load).to_string())
            .join(",");
        let noise = match self {
            Self::Incremental => 0.0,
            _ => NOISE_NM,
        };
        let arguments =
            format!("--steps {forces} --grid 41 --noise-nm {noise} --motion-mm 0.1 --seed {seed}");
        let folder = match self {
            Self::Rolled => rolled(size, &format!("{arguments} --set nu12={}", STEEL[1])),
            Self::Clamped => clamped(of, size, &arguments),
            _ => simulated(&of.model(), &(arguments + &of.truth())),
        };
        let mut sum: Vec<[f64; 2]> = Vec::new();
        let rng = &mut Pcg64::seed_from_u64(seed);
        let mut reference = None;
        for (k, load) in LOADS.into_iter().enumerate() {
            rewrite(&folder.join(format!("step-{k:02}.csv")), |points| {
                let mut points = self.written(of, (size, load), points);
                if let Self::Hazy = self {
                    let reference = reference.get_or_insert_with(|| Haze::drawn(rng));
                    let own = Haze::drawn(rng);
                    for [x, y, u, v] in &mut points {
                        let [du, dv] =
                            [0, 1].map(|c| own.at(c, [*x, *y]) + reference.at(c, [*x, *y]));
                        (*u, *v) = (*u + size * du, *v + size * dv);
                    }
                }
                if let Self::Incremental = self {
                    sum.resize(points.len(), [0.0; 2]);
                    for (point, sum) in points.iter_mut().zip(&mut sum) {
                        for (i, d) in sum.iter_mut().enumerate() {
                            let new: f64 = StandardNormal.sample(rng);
                            *d += size * new;
                            point[2 + i] += *d;
                        }
                    }
                }
                points
            });
        }
        Model::load(&folder.join("model.json")).unwrap()
    }
}

/// A smooth random field of both components, of unit variance: bumps of an sd on a grid of that spacing, whose sizes are independent. Over a
/// distance d it is correlated by exp(-d^2 / (4 sd^2)).
struct Haze([Vec<f64>; 2]);

impl Haze {
    const SD_MM: f64 = 4.0;
    /// Bumps along a side, the middle one at the hole.
    const SIDE: usize = 21;

    fn drawn(rng: &mut Pcg64) -> Self {
        let mut bumps = || {
            (0..Self::SIDE * Self::SIDE)
                .map(|_| StandardNormal.sample(rng))
                .collect()
        };
        Self([bumps(), bumps()])
    }

    fn at(&self, component: usize, [x, y]: [f64; 2]) -> f64 {
        let off = |p: f64, k: usize| p / Self::SD_MM - (k as f64 - (Self::SIDE / 2) as f64);
        let bump = |(k, size): (usize, &f64)| {
            let d2 = off(x, k % Self::SIDE).powi(2) + off(y, k / Self::SIDE).powi(2);
            size * (-0.5 * d2).exp()
        };
        let sum: f64 = self.0[component].iter().enumerate().map(bump).sum();
        sum / std::f64::consts::PI.sqrt()
    }
}

/// Change the points of a written step; lines that are none stay.
fn rewrite(file: &Path, change: impl FnOnce(&[Point]) -> Vec<Point>) {
    let text = fs::read_to_string(file).unwrap();
    assert!(text.contains("ux_um"), "{text:.200}");
    let read = |line: &str| -> Option<Point> {
        let numbers: Vec<f64> = line.split(',').filter_map(|n| n.parse().ok()).collect();
        numbers.try_into().ok()
    };
    let points: Vec<Point> = text.lines().filter_map(read).collect();
    let mut changed = change(&points).into_iter();
    let line = |line: &str| match read(line) {
        Some(_) => {
            let [x, y, u, v] = changed.next().unwrap();
            format!("{x:.9},{y:.9},{u:.9},{v:.9}\n")
        }
        None => format!("{line}\n"),
    };
    fs::write(file, text.lines().map(line).collect::<String>()).unwrap();
}

/// A point with the mean displacement of those within a square.
fn averaged([x, y, ..]: Point, points: &[Point], side: f64) -> Point {
    let is_near = |p: &&Point| (p[0] - x).abs().max((p[1] - y).abs()) <= 0.5 * side + 1e-9;
    let near: Vec<&Point> = points.iter().filter(is_near).collect();
    let mean = |k: usize| near.iter().map(|p| p[k]).sum::<f64>() / near.len() as f64;
    [x, y, mean(2), mean(3)]
}

/// What straightening by the share 3 F / (1 + 3 F) of a curvature (1/mm) does to the surface before the camera: it turns the face, which
/// lies half a thickness before the middle, and moves it towards the camera. mm.
fn straightened(curvature: f64, load: f64, (thickness, [x, y]): (f64, [f64; 2])) -> [f64; 2] {
    let lost = curvature * 3.0 * load / (1.0 + 3.0 * load);
    let towards = -0.5 * lost * y * y;
    let slope = -lost * y;
    [
        towards * x / CAMERA_MM,
        towards * y / CAMERA_MM - 0.5 * thickness * slope,
    ]
}

/// Displacement, mm, at a place beside an elliptic hole of sides R (1 + m) along x and R (1 - m) along y in a large plate under a stress
/// (MPa) along y (Muskhelishvili 1953, section 82a, with the angle of the tension 90 degrees).
fn beside_ellipse(m: f64, stress: f64, place: Complex<f64>) -> Complex<f64> {
    let (shear, kappa) = (
        1e3 * STEEL[0] / (2.0 * (1.0 + STEEL[1])),
        (3.0 - STEEL[1]) / (1.0 + STEEL[1]),
    );
    let w = place / HOLE_MM;
    let root = (w * w - 4.0 * m).sqrt();
    let outside = |a: Complex<f64>, b: Complex<f64>| if a.norm() >= b.norm() { a } else { b };
    let mut zeta = outside((w + root) * 0.5, (w - root) * 0.5);
    if zeta.norm() < 1.0 {
        zeta /= zeta.norm();
    }
    // e^(2 i 90 degrees)
    let turn = -1.0;
    let size = stress * HOLE_MM;
    let phi = (zeta + (2.0 * turn - m) / zeta) * (0.25 * size);
    let of_map = HOLE_MM * (1.0 - m / (zeta * zeta));
    let slope = (1.0 - (2.0 * turn - m) / (zeta * zeta)) * (0.25 * size) / of_map;
    let psi = (turn * zeta + turn / (m * zeta)
        - (1.0 + m * m) * (turn - m) / m * zeta / (zeta * zeta - m))
        * (-0.5 * size);
    (kappa * phi - place * slope.conj() - psi.conj()) / (2.0 * shear)
}

fn read(file: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(file).unwrap()).unwrap()
}

/// A measurement of a specimen of which one end is clamped, which its file does not say.
fn clamped(of: Specimen, distance_mm: f64, arguments: &str) -> PathBuf {
    let mut model = read(Path::new(&of.model()));
    let specimen = &mut model["experiments"][0]["specimen"];
    specimen["length_mm"] = json!(2.0 * distance_mm);
    specimen["clamp"] = json!({ "end": "low" });
    let file = fresh("clamped.json");
    fs::write(&file, model.to_string()).unwrap();
    let arguments = arguments.to_string() + &of.truth();
    let folder = simulated(&file.display().to_string(), &arguments);
    let path = folder.join("model.json");
    let mut model = read(&path);
    let specimen = &mut model["experiments"][0]["specimen"];
    specimen.as_object_mut().unwrap().remove("clamp").unwrap();
    fs::write(&path, model.to_string()).unwrap();
    folder
}

/// A measurement of an orthotropic sheet that is declared to be isotropic.
fn rolled(percent: f64, arguments: &str) -> PathBuf {
    let declared = read(Path::new(&steel()));
    let mut sheet = declared.clone();
    let prior = |mean: f64| json!({ "prior": { "normal": { "mean": mean, "sd": 0.1 * mean } } });
    let [e, nu] = STEEL;
    let across = e * (1.0 + 0.01 * percent);
    let shear = (e + across) / 2.0 / (2.0 * (1.0 + nu));
    sheet["material"] = json!({ "kind": "ply", "parameters": {
        "E1_GPa": prior(e), "E2_GPa": prior(across), "nu12": prior(nu), "G12_GPa": prior(shear) } });
    sheet["experiments"][0]["specimen"]["layup_deg"] = json!([0]);
    let file = fresh("rolled.json");
    fs::write(&file, sheet.to_string()).unwrap();
    let constants = format!("--set E1_GPa={e} --set E2_GPa={across} --set G12_GPa={shear}");
    let folder = simulated(
        &file.display().to_string(),
        &format!("{arguments} {constants}"),
    );
    let path = folder.join("model.json");
    let mut model = read(&path);
    model["material"] = declared["material"].clone();
    let specimen = model["experiments"][0]["specimen"].as_object_mut().unwrap();
    specimen.remove("layup_deg");
    fs::write(&path, model.to_string()).unwrap();
    folder
}

/// A metal with the effect is a sheet of one ply with these moduli.
#[test]
fn an_anisotropic_metal_is_an_orthotropic_sheet() {
    let arguments = "--steps 3000,6000 --grid 21 --noise-nm 0";
    let sheet = rolled(8.0, &format!("{arguments} --set nu12={}", STEEL[1]));
    let constants = format!("--set E_GPa={} --set nu={}", STEEL[0], STEEL[1]);
    // the mean of both moduli, halved, is 4 % above that of one
    let effect = "--effect anisotropy=8,4";
    let metal = simulated(&steel(), &format!("{arguments} {constants} {effect}"));
    let [a, b] = [sheet, metal].map(|folder| {
        let mut points = Vec::new();
        rewrite(&folder.join("step-01.csv"), |own| {
            points = own.to_vec();
            own.to_vec()
        });
        points
    });
    assert!(a.len() > 300 && a.len() == b.len());
    for (a, b) in a.iter().zip(&b) {
        for k in 0..4 {
            assert!((a[k] - b[k]).abs() < 5e-6, "{a:?} {b:?}");
        }
    }
}

/// The closed form for an ellipse that is nearly a circle is that of Kirsch: at the edge of the hole across the load it moves by
/// R S / E towards the middle, and along the load by 3 R S / E away from it.
#[test]
fn the_ellipse_that_is_a_circle_is_kirschs_hole() {
    let unit = HOLE_MM * 100.0 / (1e3 * STEEL[0]);
    let [across, along] = [Complex::new(HOLE_MM, 0.0), Complex::new(0.0, HOLE_MM)]
        .map(|place| beside_ellipse(1e-6, 100.0, place));
    assert!((across.re / unit + 1.0).abs() < 1e-4, "{across} {unit}");
    assert!((along.im / unit - 3.0).abs() < 1e-4, "{along} {unit}");
}

/// Smooth noise of every picture is noise in a fit without tracing too: by the noise of one field alone, Poisson's ratio of the steel lay 16 and
/// 14 sds from the truth where the smooth noise was of 0.3 and 0.6 um.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_fit_counts_the_smooth_noise_of_pictures() {
    for of in [Specimen::Steel, Specimen::Laminate] {
        let cases = [0.0, 0.3, 0.6, 1.2].map(|size| (size, 70 + (10.0 * size) as u64));
        let mut squares = Vec::new();
        for (size, seed) in cases {
            let model = Attack::Hazy.measured(of, size, seed);
            let prepared = prepare(&model, &Silent).unwrap();
            let solved = inverse_problem(&model, prepared, &Silent).unwrap();
            let fit = start(&solved.posed.density).unwrap();
            let sd = |k: usize| fit.covariance[k * (fit.mode.len() + 1)].sqrt();
            let constants = of.constants().iter().enumerate();
            let z = constants.map(|(k, truth)| (fit.mode[k] - truth) / sd(k));
            let z: Vec<f64> = z.collect();
            println!("{} {size} {seed} {z:.1?}", of.name());
            // of 24 constants chance takes one beyond 3.5 sds in one of ninety runs
            assert!(z.iter().all(|z| z.abs() < 3.5), "{size} {seed}: {z:?}");
            squares.extend(z.iter().map(|z| z * z));
        }
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        // three standard errors above 1
        let most = 1.0 + 3.0 / (2.0 * squares.len() as f64).sqrt();
        assert!(rms < most, "{}: {rms}", of.name());
    }
}

/// Whether a verdict is sure while an interval does not hold.
fn is_sure_and_wrong(ended: &Ended) -> bool {
    ended.status != Status::Unexplained && ended.held() < ended.truth.len()
}

/// What the manual says of a verdict.
fn words(ended: &Ended) -> String {
    match ended.status {
        Status::NothingMissing => "noise alone".into(),
        Status::Unexplained => "not explained".into(),
        Status::Closed => {
            let group = |name: &String| {
                let mut groups = ended.alias_groups.iter();
                let own = groups.find(|g| g.contains(name));
                match own.map_or(&[][..], |g| &g[..]) {
                    [] => name.clone(),
                    few if few.len() <= 3 => few.join(" or "),
                    many => format!("{name} or one of {} others", many.len() - 1),
                }
            };
            ended
                .effects
                .iter()
                .map(group)
                .collect::<Vec<_>>()
                .join(", ")
        }
    }
}

/// The loops over attacks on both specimens, of those sizes (by number) that `of_sizes` takes from each; none may be sure and wrong.
fn attacked(
    only: &str,
    of_sizes: impl Fn(Specimen, usize) -> Vec<usize>,
) -> Vec<(Specimen, &'static str, Ended)> {
    let mut cases = Vec::new();
    let mut loops: Vec<Case> = Vec::new();
    for of in [Specimen::Steel, Specimen::Laminate] {
        for (number, (name, attack, sizes)) in ATTACKS.iter().enumerate() {
            if !name.contains(only) || !attack.applies(of) {
                continue;
            }
            for k in of_sizes(of, number) {
                let size = sizes[k];
                cases.push((of, *name));
                loops.push(Box::new(move || {
                    let model = attack.measured(of, size, 70 + k as u64);
                    let case = format!("{} {name}: {size}", of.name());
                    looped(&case, &model, of.constants())
                }));
            }
        }
    }
    let ended = all(&loops);
    let wrong: Vec<String> = ended
        .iter()
        .filter(|e| is_sure_and_wrong(e))
        .map(Ended::line)
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    let (held, count) = held(&ended);
    println!("{held} of {count} intervals hold");
    assert!(20 * held >= 19 * count, "{held} of {count}");
    let pairs = cases.into_iter().zip(ended);
    pairs.map(|((of, name), ended)| (of, name, ended)).collect()
}

/// How many intervals hold, and of how many.
fn held(ended: &[Ended]) -> (usize, usize) {
    let held = ended.iter().map(Ended::held).sum();
    (held, ended.iter().map(|e| e.truth.len()).sum())
}

/// Attacks by their numbers, each at one of its sizes, on one specimen and the other in turn; `PLYCHAIN_ONLY=rolled` runs those whose names
/// contain that.
fn never_sure_and_wrong(numbers: &[usize]) {
    let only = std::env::var("PLYCHAIN_ONLY").unwrap_or_default();
    let cases = attacked(&only, |of, number| {
        let is_its_turn = (of == Specimen::Steel) == (number % 2 == 0);
        match is_its_turn && (numbers.contains(&number) || !only.is_empty()) {
            true => vec![(number + 1) % 3],
            false => Vec::new(),
        }
    });
    assert!(cases.len() == numbers.len() || !only.is_empty() && !cases.is_empty());
}

/// What moves the constants most: a bow, an elliptic hole, a clamped end, a rolled sheet.
#[test]
#[ignore = "slow: four loops"]
fn what_no_dictionary_has_is_never_sure_and_wrong() {
    never_sure_and_wrong(&[3, 4, 7, 8]);
}

#[test]
#[ignore = "length: five loops, 2 minutes"]
fn what_else_no_dictionary_has_is_never_sure_and_wrong() {
    never_sure_and_wrong(&[0, 1, 2, 5, 6]);
}

/// Each at its three sizes, and what the manual says of them.
#[test]
#[ignore = "length: 48 loops, 10 minutes"]
fn the_manual_prints_what_attacks_end_with() {
    let cases = attacked("", |_, _| vec![0, 1, 2]);
    let page = fs::read_to_string(root().join("models/README.md")).unwrap();
    let rows = table(&page, "| what was wrong, at three sizes |");
    assert_eq!(3 * rows.len(), cases.len());
    for (row, (of, name, _)) in rows.iter().zip(cases.iter().step_by(3)) {
        assert_eq!(row[..2], [*name, of.name()]);
    }
    let ended: Vec<Ended> = cases.into_iter().map(|(_, _, ended)| ended).collect();
    let (held, count) = held(&ended);
    assert!(page.contains(&format!("{held} of {count} intervals hold")));
    let cells = rows.iter().flat_map(|row| &row[2..]);
    for (cell, own) in cells.zip(&ended) {
        assert_eq!(cell.replace('`', ""), words(own), "{}", own.case);
    }
}
