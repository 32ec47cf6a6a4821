//! Patches in the residual of a series: found where they are, with what they are, and never in noise.

use nalgebra::{DMatrix, DVector};
use plychain::field::places::BlockPoints;
use plychain::field::{Blocks, DATA_AXES, Field, MeasurementSpec};
use plychain::noise::matern_pair;
use plychain::noise::series::{Frames, SeriesNoise, settings};
use plychain::trace::patches::{FoundPatch, PatchFamily, PatchPart, PatchedPoints, Scanned};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

use crate::common::fresh;

/// Four loads and the frame after unloading.
const LOADS: [f64; 5] = [0.25, 0.5, 0.75, 1.0, 0.0];
/// Points along a side, their distance and the subset, mm.
const SIDE: usize = 40;
const STEP: f64 = 0.52;
const SUBSET: f64 = 1.04;
/// Sd of a point's noise, mm.
const SD: f64 = 0.29e-3;
/// Radius of the hole, mm.
const HOLE: f64 = 3.0;

fn normal(rng: &mut Pcg64) -> f64 {
    rng.sample(StandardNormal)
}

/// What a smooth part of the noise is like, over the white sd: Matern-3/2 or squared exponential of a length, mm.
#[derive(Clone, Copy)]
enum Smooth {
    None,
    Matern(f64, f64),
    Squared(f64, f64),
}

/// The points of a window with a hole, in blocks of two by two.
struct Plate {
    field: Field,
    blocks: Blocks,
    /// Row and column of each point.
    sites: Vec<[usize; 2]>,
}

impl Plate {
    fn new() -> Self {
        let at = |i: usize| (i as f64 - 0.5 * (SIDE as f64 - 1.0)) * STEP;
        let all = (0..SIDE * SIDE).map(|k| [k / SIDE, k % SIDE]);
        let sites: Vec<[usize; 2]> = all
            .filter(|[i, j]| at(*i).hypot(at(*j)) > HOLE + 0.5 * SUBSET)
            .collect();
        let points: Vec<[f64; 2]> = sites.iter().map(|s| s.map(at)).collect();
        let field = Field {
            displacement: vec![[0.0; 2]; points.len()],
            points,
            subset_mm: Some(SUBSET),
            ..Field::empty(DATA_AXES)
        };
        let blocks = Blocks::new(&field, 2.0 * STEP, |_| true);
        assert!(!matches!(blocks.places, BlockPoints::Many));
        Self {
            field,
            blocks,
            sites,
        }
    }

    fn average(&self, value: impl Fn(usize) -> f64) -> DVector<f64> {
        let values: Vec<f64> = (0..self.sites.len()).map(value).collect();
        self.blocks.average(&values)
    }

    /// One frame's noise of one component, mm.
    fn noise(&self, smooth: Smooth, rng: &mut Pcg64) -> Vec<f64> {
        // white pixels averaged over a subset of two steps: mean of four quarters that neighbours share
        let wide = SIDE + 1;
        let quarters: Vec<f64> = (0..wide * wide).map(|_| normal(rng)).collect();
        let pattern: Vec<f64> = match smooth {
            Smooth::None => vec![0.0; SIDE * SIDE],
            Smooth::Matern(sd, l) => {
                let [pattern, _] = matern_pair([SIDE; 2], [STEP; 2], l, rng);
                pattern.into_iter().map(|v| sd * v).collect()
            }
            Smooth::Squared(sd, l) => waves(sd, l, rng),
        };
        let of = |[i, j]: &[usize; 2]| {
            let white: f64 = [[0, 0], [0, 1], [1, 0], [1, 1]]
                .iter()
                .map(|[a, b]| quarters[(i + a) * wide + j + b])
                .sum();
            SD * (0.5 * white + pattern[i * SIDE + j])
        };
        self.sites.iter().map(of).collect()
    }

    /// What a full load does: strain, and what a hole adds to it.
    fn loaded(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let r2 = x * x + y * y;
        let hole = 1.0 + (HOLE * HOLE / r2) * (1.0 - 0.5 * HOLE * HOLE / r2);
        [2.5e-3 * x * hole, -0.9e-3 * y * hole]
    }
}

/// A pattern of the squared exponential by random waves.
fn waves(sd: f64, length_mm: f64, rng: &mut Pcg64) -> Vec<f64> {
    const WAVES: usize = 200;
    let all: Vec<([f64; 2], f64)> = (0..WAVES)
        .map(|_| {
            let k = [0, 1].map(|_| normal(rng) / length_mm);
            (k, std::f64::consts::TAU * rng.random::<f64>())
        })
        .collect();
    let size = sd * (2.0 / WAVES as f64).sqrt();
    let at = |k: usize| {
        let [x, y] = [k / SIDE, k % SIDE].map(|i| i as f64 * STEP);
        let each = all
            .iter()
            .map(|([a, b], phase)| (a * x + b * y + phase).cos());
        size * each.sum::<f64>()
    };
    (0..SIDE * SIDE).map(at).collect()
}

/// A patch that acts.
#[derive(Clone, Copy)]
struct Culprit {
    at: [f64; 2],
    radius_mm: f64,
    /// Share of the strain that is lost in a disc with a soft rim, and height (mm) of a bump, in each frame.
    lost: f64,
    bump: f64,
    weights: [f64; 5],
}

/// A series and what is found in it.
#[derive(Clone, Copy)]
struct Simulated {
    smooth: Smooth,
    /// Sd of each frame's noise over that of the others.
    louder: [f64; 5],
    culprit: Option<Culprit>,
    seed: u64,
}

impl Simulated {
    fn null(smooth: Smooth, seed: u64) -> Self {
        Self {
            smooth,
            louder: [1.0; 5],
            culprit: None,
            seed,
        }
    }

    /// The columns of the model and the data, of either component.
    fn columns(&self, plate: &Plate) -> [DMatrix<f64>; 2] {
        let rng = &mut Pcg64::seed_from_u64(self.seed);
        let (points, n) = (&plate.field.points, plate.blocks.len());
        let amplitudes: Vec<f64> = (0..40).map(|_| normal(rng)).collect();
        let over =
            |law: &[f64], field: &DVector<f64>| DVector::from_column_slice(law).kronecker(field);
        let only = |s: usize| [0, 1, 2, 3, 4].map(|t| f64::from(u8::from(s == t)));
        [0, 1].map(|c: usize| {
            let mut columns = Vec::new();
            for s in 0..LOADS.len() {
                for k in 0..2 {
                    let shift = plate.average(|_| 10.0 * f64::from(u8::from(k == c)));
                    columns.push(over(&only(s), &shift));
                }
                let turn = plate.average(|i| [-points[i][1], points[i][0]][c]);
                columns.push(over(&only(s), &turn));
            }
            let strain = [
                plate.average(|i| 1e-4 * plate.loaded(points[i])[c] * 1e2),
                plate.average(|i| 1e-4 * points[i][c]),
                plate.average(|i| 1e-4 * points[i][1 - c]),
            ];
            columns.extend(strain.iter().map(|field| over(&LOADS, field)));
            columns.push(over(&[1.0; 5], &strain[1]));
            let common = plate.noise(self.smooth, rng);
            let mut y = DVector::zeros(LOADS.len() * n);
            for s in 0..LOADS.len() {
                let own = plate.noise(self.smooth, rng);
                let frame =
                    |i: usize| self.louder[s] * own[i] + common[i] + self.patch(plate, s, i)[c];
                y.rows_mut(s * n, n).copy_from(&plate.average(frame));
            }
            for (column, a) in columns.iter().zip(&amplitudes) {
                y.axpy(*a, column, 1.0);
            }
            DMatrix::from_columns(&columns.into_iter().chain([y]).collect::<Vec<_>>())
        })
    }

    /// What the culprit does to a point in a frame, mm.
    fn patch(&self, plate: &Plate, frame: usize, i: usize) -> [f64; 2] {
        let Some(culprit) = self.culprit else {
            return [0.0; 2];
        };
        let point = plate.field.points[i];
        let d = [0, 1].map(|k| point[k] - culprit.at[k]);
        let r = d[0].hypot(d[1]);
        let rim = 0.35;
        let disc = 0.5 * (1.0 - ((r - culprit.radius_mm) / rim).tanh());
        let sd = 0.75 * culprit.radius_mm;
        let bell = (-0.5 * r * r / (sd * sd)).exp();
        let [u, middle] = [point, culprit.at].map(|p| plate.loaded(p));
        let weight = culprit.weights[frame];
        [0, 1].map(|c| {
            let raised = if c == 0 { culprit.bump * bell } else { 0.0 };
            weight * (raised - culprit.lost * disc * (u[c] - middle[c]))
        })
    }

    fn found(&self, plate: &Plate) -> (SeriesNoise, Vec<FoundPatch>) {
        let columns = self.columns(plate);
        let frames = Frames {
            blocks: &plate.blocks,
            loads: LOADS.to_vec(),
            subset_mm: Some(SUBSET),
        };
        let noise = settings(&frames, [&columns[0], &columns[1]], &|| {}).unwrap();
        let expected: Vec<[f64; 2]> = plate
            .field
            .points
            .iter()
            .map(|p| plate.loaded(*p))
            .collect();
        let points = PatchedPoints {
            blocks: &plate.blocks,
            points: &plate.field.points,
            displacement: &expected,
        };
        let places = points.places();
        assert!((300..5000).contains(&places.len()), "{}", places.len());
        let of = (&noise.noise, 1.0);
        let scanned = Scanned::of_frames(&places, &LOADS, of, columns.each_ref());
        let found = scanned.patches().unwrap();
        (noise, found)
    }
}

/// Whether a verdict would name any of them.
fn is_named(found: &[FoundPatch]) -> bool {
    found.iter().any(|p| match p.part {
        PatchPart::Own(_) => p.z > 6.0,
        _ => p.z > 5.2,
    })
}

/// Paint that has come off, as in the pictures of `paint`.
fn paint(lost: f64, radius_mm: f64, at: [f64; 2]) -> Culprit {
    Culprit {
        at,
        radius_mm,
        lost,
        bump: 0.0,
        weights: LOADS,
    }
}

#[test]
fn paint_that_does_not_follow_is_found_where_it_is() {
    let plate = Plate::new();
    let culprit = paint(0.6, 1.7, [6.1, -4.3]);
    let series = Simulated {
        culprit: Some(culprit),
        ..Simulated::null(Smooth::None, 4)
    };
    let (noise, found) = series.found(&plate);
    println!("{found:#?}");
    assert!(noise.noise.smooth_gain < 10.0);
    let first = found.iter().max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
    assert_eq!(first.part, PatchPart::Load);
    assert_eq!(first.family, PatchFamily::NotFollowing);
    let off = (first.at[0] - culprit.at[0]).hypot(first.at[1] - culprit.at[1]);
    assert!(first.z > 6.0 && off < 1.0, "z {}, {off} mm off", first.z);
    let [share, sd] = first.share.unwrap();
    // a bell as high as a disc is narrower
    assert!((0.4..1.5).contains(&share) && sd < 0.2, "{share} {sd}");
    // displacement at the rim of the disc, half of it lost there
    assert!((0.4e-3..3e-3).contains(&first.largest_mm));
}

#[test]
fn a_bump_in_one_frame_or_in_all_of_them_is_named_so() {
    let plate = Plate::new();
    let bump = |weights: [f64; 5]| Simulated {
        culprit: Some(Culprit {
            at: [-5.0, 5.5],
            radius_mm: 1.7,
            lost: 0.0,
            bump: 6.0 * SD,
            weights,
        }),
        ..Simulated::null(Smooth::None, 9)
    };
    let clearest = |series: Simulated| {
        let (_, mut found) = series.found(&plate);
        found.sort_by(|a, b| b.z.total_cmp(&a.z));
        found.into_iter().next().unwrap()
    };
    let common = clearest(bump([1.0; 5]));
    assert_eq!(common.part, PatchPart::Common);
    assert!((common.largest_mm / (6.0 * SD) - 0.8).abs() < 0.4);
    let own = clearest(bump([0.0, 0.0, 1.0, 0.0, 0.0]));
    assert_eq!(own.part, PatchPart::Own(2), "{own:?}");
    for found in [common, own] {
        let off = (found.at[0] + 5.0).hypot(found.at[1] - 5.5);
        assert!(off < 1.0, "{off}");
    }
}

/// Two patches at once: the second shows once the first is taken out.
#[test]
fn two_patches_are_both_found() {
    let plate = Plate::new();
    let first = Simulated {
        culprit: Some(paint(1.0, 1.7, [6.1, -4.3])),
        ..Simulated::null(Smooth::None, 5)
    };
    let second = Simulated {
        culprit: Some(paint(0.8, 1.7, [-6.5, -5.0])),
        ..first
    };
    let mut columns = first.columns(&plate);
    let (other, plain) = (
        second.columns(&plate),
        Simulated::null(Smooth::None, 5).columns(&plate),
    );
    let last = columns[0].ncols() - 1;
    for c in 0..2 {
        let more = other[c].column(last) - plain[c].column(last);
        let mut data = columns[c].column_mut(last);
        data += more;
    }
    let frames = Frames {
        blocks: &plate.blocks,
        loads: LOADS.to_vec(),
        subset_mm: Some(SUBSET),
    };
    let noise = settings(&frames, [&columns[0], &columns[1]], &|| {}).unwrap();
    let expected: Vec<[f64; 2]> = plate
        .field
        .points
        .iter()
        .map(|p| plate.loaded(*p))
        .collect();
    let points = PatchedPoints {
        blocks: &plate.blocks,
        points: &plate.field.points,
        displacement: &expected,
    };
    let places = points.places();
    let of = (&noise.noise, 1.0);
    let found = Scanned::of_frames(&places, &LOADS, of, columns.each_ref())
        .patches()
        .unwrap();
    for at in [[6.1, -4.3], [-6.5, -5.0]] {
        let near = |p: &&FoundPatch| {
            p.part == PatchPart::Load && (p.at[0] - at[0]).hypot(p.at[1] - at[1]) < 1.2
        };
        assert!(
            found.iter().any(|p| near(&p) && p.z > 5.2),
            "{at:?} {found:#?}"
        );
    }
}

/// White noise, smooth noise of two kinds in every frame, and one loud frame: the shares of series with a named patch, and of parts above 4.6.
fn nulls(count: u64) -> [f64; 2] {
    let plate = Plate::new();
    let (mut named, mut above) = (0, 0);
    for k in 0..count {
        let smooth = match k % 6 {
            0 | 5 => Smooth::None,
            1 => Smooth::Squared(1.5, 2.0),
            2 => Smooth::Squared(1.5, 5.0),
            3 => Smooth::Matern(1.5, 5.0),
            _ => Smooth::Matern(1.5, 3.0),
        };
        let mut series = Simulated::null(smooth, 1000 + k);
        if k % 6 == 5 {
            series.louder[(k / 6 % 5) as usize] = 2.0;
        }
        let (noise, found) = series.found(&plate);
        named += u32::from(is_named(&found));
        above += found.len();
        if !found.is_empty() {
            let z: Vec<_> = found.iter().map(|p| (p.part, p.family, p.z)).collect();
            let n = &noise.noise.spatial[0];
            println!(
                "{k}: {z:?} {:?} {:.1} {:.2}",
                n.shape.kernel, n.shape.length_mm, n.shape.ratio
            );
        }
    }
    let count = count as f64;
    println!(
        "named {named} of {count}, above 4.6 {above} of {} parts",
        7.0 * count
    );
    [f64::from(named) / count, above as f64 / (7.0 * count)]
}

#[test]
#[ignore = "slow: run by .ci/run"]
fn noise_holds_no_patch() {
    let [named, above] = nulls(24);
    assert!(named <= 1.0 / 24.0 && above <= 0.04);
}

#[test]
#[ignore = "length: 300 series, 4 minutes"]
fn noise_holds_a_patch_in_two_percent_at_most() {
    let [named, above] = nulls(300);
    assert!(named <= 0.02 && above <= 0.025);
}

/// The share of the strain that must be lost to be found in half of the places: as in the prototype study, within a factor of 1.5.
#[test]
#[ignore = "length: 80 series, 1 minute"]
fn power_is_that_of_the_prototype() {
    let plate = Plate::new();
    for (radius, half) in [(1.7, 0.27), (3.0, 0.09)] {
        let share = |lost: f64| {
            let found = (0..20_u64).filter(|k| {
                let angle = 0.3 + 0.314 * *k as f64;
                let at = [7.0 * angle.cos(), 7.0 * angle.sin()];
                let series = Simulated {
                    culprit: Some(paint(lost, radius, at)),
                    ..Simulated::null(Smooth::None, 77 + k)
                };
                is_named(&series.found(&plate).1)
            });
            found.count() as f64 / 20.0
        };
        let [low, high] = [half / 1.5, half * 1.5].map(share);
        println!("{radius} mm: {low} of places at {half} / 1.5, {high} at 1.5 {half}");
        assert!(low <= 0.6 && high >= 0.5);
    }
}

/// Points inside the shapes of a mask are dropped and counted; a mask that is none is refused with its key.
#[test]
fn a_mask_leaves_points_out() {
    let file = fresh("masked.csv");
    let mut text = String::from("x,y,u,v\n");
    for k in 0..400 {
        let [x, y] = [k / 20, k % 20].map(|i| 0.5 * f64::from(i));
        text += &format!("{x},{y},{},{}\n", 1e-3 * x, -3e-4 * y);
    }
    std::fs::write(&file, text).unwrap();
    let read = |mask: &str| {
        let json = format!(
            r#"{{"format": "csv", "file": {:?}, "columns": {{"x": "x", "y": "y", "ux": "u", "uy": "v"}},
            "units": {{"coordinates": "mm", "displacements": "mm"}}, "loading_axis": "y",
            "hole_center_in_data_mm": [3, 4], "mask": {mask}}}"#,
            file.display().to_string()
        );
        serde_json::from_str::<MeasurementSpec>(&json)
    };
    let circle = r#"{"circle": {"center_mm": [2.0, 3.0], "radius_mm": 1.2}}"#;
    let corner = r#"{"polygon": {"points_mm": [[6.9, -1], [12, -1], [12, 2.9]]}}"#;
    let spec = read(&format!("[{circle}, {corner}]")).unwrap();
    let field = spec.read("".as_ref(), None).unwrap();
    let covered = |[x, y]: [f64; 2]| {
        let below = x > 6.9 && x < 12.0 && y < -1.0 + 3.9 * (x - 6.9) / 5.1;
        (x - 2.0).hypot(y - 3.0) <= 1.2 || below
    };
    let all = (0..400).map(|k| [k / 20, k % 20].map(|i| 0.5 * f64::from(i)));
    let masked = all.filter(|p| covered(*p)).count();
    assert!(masked > 20);
    assert_eq!((field.rejected.masked, field.len()), (masked, 400 - masked));
    assert!(
        field
            .points
            .iter()
            .all(|p| !covered(field.frame.data_point(*p)))
    );
    // as it was written, and not at all where there is none
    let written = serde_json::to_value(&spec).unwrap();
    assert_eq!(
        written["mask"][0],
        serde_json::from_str::<serde_json::Value>(circle).unwrap()
    );
    let plain = serde_json::to_value(read("[]").unwrap()).unwrap();
    assert!(plain.get("mask").is_none());
    for (mask, words) in [
        (
            r#"[{"circle": {"center_mm": [2, 3], "radius_mm": 0}}]"#,
            "mask[0].circle.radius_mm",
        ),
        (
            r#"[{"polygon": {"points_mm": [[2, 3], [2, 4]]}}]"#,
            "mask[0].polygon.points_mm",
        ),
        (
            r#"[{"circle": {"center_mm": [2, 3], "radius": 1}}]"#,
            "radius",
        ),
        (r#"[{"square": {"center_mm": [2, 3]}}]"#, "square"),
    ] {
        let said = read(mask).unwrap_err().to_string();
        assert!(said.contains(words), "{said}");
    }
}
