//! Series whose load is not what the file says: a force that fell before the picture was taken, a machine's zero, an unloaded picture that is
//! not, a modulus that falls. Each is a multiple of the whole elastic field in a step, which no uniform strain is. No wrong name stands
//! alone, and the intervals to quote hold the constants.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use plychain::effect::{EFFECTS, Scope, force_scale, why_not};
use plychain::experiment::series::SeriesState;
use plychain::field::rigid::RigidMotion;
use plychain::field::step::CLASS_1_SD_PERCENT;
use plychain::identify::{inverse_problem, prepare};
use plychain::infer::Model;
use plychain::linearise::Column;
use plychain::linearise::candidates;
use plychain::progress::Silent;
use plychain::trace::{Status, attribute};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use serde_json::{Value, json};

use crate::common::{changed, model, root, set_coarse, simulated, table};
use crate::loops::{Case, Ended, all, looped};

/// E and nu of the steel; E1, E2, nu12 and G12 of the laminate.
pub const STEEL: [f64; 2] = [208.0, 0.285];
pub const LAMINATE: [f64; 4] = [150.0, 7.9, 0.33, 4.6];

/// Largest force, N.
pub const LARGEST: f64 = 6000.0;
pub const OF_LAMINATE: f64 = 2400.0;

const NOISE_NM: f64 = 150.0;

/// A strip of steel, 20 mm wide, with a hole of 8 mm, before a camera; the hole in the middle.
pub fn steel() -> String {
    changed("steel-s235.json", |m| {
        set_coarse(m);
        let material = m["material"].as_object_mut().unwrap();
        material.remove("yield_MPa");
        material["parameters"]["nu"]["prior"]["normal"] = json!({"mean": 0.29, "sd": 0.03});
        let e = &mut m["experiments"][0];
        let specimen = e["specimen"].as_object_mut().unwrap();
        specimen.remove("clamp");
        specimen["hole"]["center_mm"] = json!([0.0, 0.0]);
        specimen["thickness_mm"] = json!({"mean": 2.0, "sd": 0.01});
        e["gauge"] = "window".into();
        e.as_object_mut().unwrap().remove("plausible");
        e["effects"] = json!(["rigid_translation", "rigid_rotation"]);
        pictured(e);
    })
}

/// The default laminate with a hole of 8 mm before a camera.
pub fn laminate() -> String {
    changed("openhole.json", |m| {
        set_coarse(m);
        let e = &mut m["experiments"][0];
        e["specimen"]["hole"]["diameter_mm"] = json!(8.0);
        pictured(e);
    })
}

fn pictured(e: &mut Value) {
    e["measurement"] = json!({
        "format": "csv", "file": "none.csv",
        "columns": { "x": "x", "y": "y", "ux": "u", "uy": "v" },
        "units": { "coordinates": "mm", "displacements": "mm" },
        "loading_axis": "y", "hole_center_in_data_mm": [0, 0],
        "image_correlation": { "subset_mm": 1.0, "camera_distance_mm": 600 },
    });
}

/// A simulated series under true forces, over the largest, whose file declares others.
struct Mistaken<'a> {
    is_steel: bool,
    constants: &'a [f64],
    loads: &'a [f64],
    declared: &'a [Option<f64>],
    effects: &'a str,
    seed: u64,
}

impl Mistaken<'_> {
    fn folder(&self) -> PathBuf {
        let (model, names) = match self.is_steel {
            true => (steel(), &["E_GPa", "nu"][..]),
            false => (laminate(), &["E1_GPa", "E2_GPa", "nu12", "G12_GPa"][..]),
        };
        let pairs = names.iter().zip(self.constants);
        let truth: Vec<String> = pairs.map(|(n, x)| format!("--set {n}={x}")).collect();
        let truth = truth.join(" ");
        let largest = self.largest();
        let forces: Vec<String> = self
            .loads
            .iter()
            .map(|f| (largest * f).to_string())
            .collect();
        let arguments = format!(
            "--steps {} --grid 41 --noise-nm {NOISE_NM} --motion-mm 0.1 --seed {} {truth} {}",
            forces.join(","),
            self.seed,
            self.effects
        );
        let folder = simulated(&model, &arguments);
        self.declare(&folder);
        folder
    }

    fn largest(&self) -> f64 {
        if self.is_steel { LARGEST } else { OF_LAMINATE }
    }

    /// Write what the file says.
    fn declare(&self, folder: &Path) {
        let file = folder.join("model.json");
        let text = std::fs::read_to_string(&file).unwrap();
        let mut model: Value = serde_json::from_str(&text).unwrap();
        let steps = model["experiments"][0]["steps"].as_array_mut().unwrap();
        for (step, load) in steps.iter_mut().zip(self.declared) {
            step["force_N"] = json!(load.map(|f| (self.largest() * f).round()));
        }
        std::fs::write(&file, model.to_string()).unwrap();
    }

    fn ended(&self, name: &str) -> Ended {
        let model = Model::load(&self.folder().join("model.json")).unwrap();
        let ended = looped(name, &model, self.constants);
        println!("{} {:?}", ended.line(), ended.reasons);
        ended
    }
}

/// Whether something that did not act is named alone, in a verdict that says it is sure, or nothing is and a constant is so many sds off.
fn is_wrong(ended: &Ended, acted: &[&str], sds: f64) -> bool {
    let mut added = ended.effects.iter().map(String::as_str);
    let grouped = |name: &str| {
        let mut groups = ended.alias_groups.iter();
        groups.any(|g| g.iter().any(|n| n == name) && g.iter().any(|n| acted.contains(&n.as_str())))
    };
    let wrong = added.any(|name| !acted.contains(&name) && !grouped(name));
    let silent = ended.status == Status::NothingMissing && ended.worst() > sds;
    (ended.status == Status::Closed && wrong) || silent
}

/// The forces of steps that a state has with an effect of some amplitude.
fn acting_loads(name: &str, amplitude: f64, declared: &[f64]) -> Vec<f64> {
    let model = Model::load(
        &Mistaken {
            is_steel: true,
            constants: &STEEL,
            loads: declared,
            declared: &declared.iter().map(|f| Some(*f)).collect::<Vec<_>>(),
            effects: "",
            seed: 1,
        }
        .folder()
        .join("model.json"),
    )
    .unwrap();
    let effect = *EFFECTS.iter().find(|e| e.name() == name).unwrap();
    let shared = model.state(&|_| None);
    let state = SeriesState {
        shared,
        loads: declared.to_vec(),
        rigid: vec![RigidMotion::NONE; declared.len()],
        moving: Vec::new(),
        shifts: Vec::new(),
    };
    let scene = model.scene();
    assert!(why_not(effect, &scene).is_none(), "{name}");
    state
        .raised(effect, 0, amplitude, &effect.over_steps(declared))
        .acting_loads(&scene)
}

/// Every error of the load by what it says of itself, written out.
#[test]
fn errors_of_the_load_change_the_forces_as_they_say() {
    let declared = [0.5, 1.0, 0.5, 0.0];
    for (name, amplitude, expected) in [
        ("step_force_2", -7.0, [0.5, 0.93, 0.5, 0.0]),
        ("force_offset", 0.03 * LARGEST, [0.53, 1.03, 0.53, 0.0]),
        ("residual_load", 0.06 * LARGEST, [0.5, 1.0, 0.5, 0.06]),
        ("softening", 5.0, [0.5125, 1.05, 0.5125, 0.0]),
        ("hysteresis", 9.0, [0.5, 1.0, 0.545, 0.0]),
    ] {
        let found = acting_loads(name, amplitude, &declared);
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
        assert!(off.fold(0.0, f64::max) < 1e-12, "{name}: {found:?}");
    }
}

/// Where a test has nothing of which an effect speaks it cannot act, and is no suspect.
#[test]
fn one_load_has_no_error_of_its_own() {
    let single = Model::load(Path::new(&model("openhole.json"))).unwrap();
    let scene = single.scene();
    let errors = || EFFECTS.iter().filter(|e| e.scope() == Scope::Force);
    assert!(errors().count() > 4);
    for effect in errors() {
        assert!(why_not(*effect, &scene).is_some(), "{}", effect.name());
    }
    let (sought, left_out) = candidates(&single);
    let is_error = |name: &str| errors().any(|e| e.name() == name);
    assert!(!sought.iter().any(|e| is_error(e.name())));
    assert!(!left_out.iter().any(|(name, _)| is_error(name)));
}

/// A simulated offset of the force is the field of another force in every loaded step.
#[test]
fn a_simulated_offset_is_the_field_of_another_force() {
    let arguments = |steps: &str| format!("--steps {steps} --grid 28 --noise-nm 0");
    let other = simulated(&steel(), &arguments("3180,6180,0"));
    let with = format!("{} --effect force_offset=180", arguments("3000,6000,0"));
    let offset = simulated(&steel(), &with);
    for k in 0..3 {
        let [a, b] = [&offset, &other].map(|folder| {
            let text = std::fs::read_to_string(folder.join(format!("step-{k:02}.csv"))).unwrap();
            let lines = text.lines().filter(|l| !l.starts_with(['#', 'x']));
            let numbers = lines.flat_map(|l| l.split(','));
            numbers.filter_map(|n| n.parse().ok()).collect::<Vec<f64>>()
        });
        assert!(a.len() > 1500 && a.len() == b.len());
        let off = a.iter().zip(&b).map(|(a, b)| (a - b).abs());
        // places in the picture are written to 1e-6 um
        assert!(off.fold(0.0, f64::max) < 5e-6, "step {k}");
    }
}

#[test]
fn an_sd_of_forces_that_none_can_be_is_refused() {
    let with = |change: &dyn Fn(&mut Value)| {
        let file = changed("openhole.json", change);
        Model::load(Path::new(&file)).err().map(|e| e.to_string())
    };
    let single = with(&|m| m["experiments"][0]["force_sd_percent"] = json!(1.0)).unwrap();
    assert!(
        single.contains("force_sd_percent") && single.contains("no other to differ from"),
        "{single}"
    );
    for (percent, refused) in [(0.0, false), (0.25, false), (-1.0, true), (60.0, true)] {
        let said = with(&|m| {
            let e = m["experiments"][0].as_object_mut().unwrap();
            e.remove("load");
            e["measurement"].as_object_mut().unwrap().remove("dir");
            e.insert(
                "steps".into(),
                json!([
                    {"file": "a", "force_N": 350.0}, {"file": "b", "force_N": 700.0}
                ]),
            );
            e.insert("force_sd_percent".into(), json!(percent));
        });
        let named = said
            .as_ref()
            .is_some_and(|s| s.contains("force_sd_percent"));
        assert!(
            named == refused && said.is_some() == refused,
            "{percent}: {said:?}"
        );
    }
}

/// Every declared force has a column of its own, which acts in its step alone; together they are the column of all forces. A step without
/// load has none.
#[test]
fn every_declared_force_has_an_error_in_its_step() {
    let declared = [Some(0.5), None, Some(1.0), Some(0.0)];
    let case = Mistaken {
        is_steel: true,
        constants: &STEEL,
        loads: &[0.5, 0.75, 1.0, 0.0],
        declared: &declared,
        effects: "",
        seed: 2,
    };
    let model = Model::load(&case.folder().join("model.json")).unwrap();
    let prepared = prepare(&model, &Silent).unwrap();
    let inverse = inverse_problem(&model, prepared, &Silent).unwrap();
    let wanted = |name: &str| name == "uniform_strain";
    let (_, traced) = attribute(&model, &inverse, &wanted, &Silent).unwrap();
    let base = &traced.evidence.sensitivities.base;
    let errors: Vec<&Column> = base.iter().filter(|c| c.is_force_error()).collect();
    let names: Vec<&str> = errors.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(
        names,
        ["force_percent in step-00", "force_percent in step-02"]
    );
    let all = base.iter().find(|c| c.is_load()).unwrap();
    let blocks = all.values[0].len() / declared.len();
    for (step, column) in [0, 2].into_iter().zip(errors) {
        assert_eq!((column.mean, column.sd), (0.0, 0.5));
        for (c, values) in column.values.iter().enumerate() {
            for (k, value) in values.iter().enumerate() {
                // a percent of this force is a percent of all, here
                let of_all = all.values[c][k] * column.sd / all.sd;
                let expected = if k / blocks == step { of_all } else { 0.0 };
                assert!((value - expected).abs() < 1e-12, "{} {k}", column.name);
            }
        }
    }
}

/// A case of the table: its name, true forces, declared forces, effects that act in the simulation, and the names that are right.
type Row = (
    &'static str,
    &'static [f64],
    &'static [Option<f64>],
    &'static str,
    &'static [&'static str],
);

const FIRST: Option<f64> = Some(0.0);

/// What was wrong with the load, three to six steps.
const TABLE: [Row; 14] = [
    (
        "last of two at 93 %",
        &[0.5, 0.93],
        &[Some(0.5), Some(1.0)],
        "",
        &["step_force_1", "step_force_2", "softening", "force_offset"],
    ),
    (
        "last of two at 95 %",
        &[0.5, 0.95],
        &[Some(0.5), Some(1.0)],
        "",
        &["step_force_1", "step_force_2", "softening", "force_offset"],
    ),
    (
        "last of three at 93 %",
        &[0.33, 0.67, 0.93],
        &[Some(0.33), Some(0.67), Some(1.0)],
        "",
        &["step_force_3", "softening"],
    ),
    (
        "unloaded at 6 %",
        &[0.33, 0.67, 1.0, 0.06],
        &[Some(0.33), Some(0.67), Some(1.0), FIRST],
        "",
        &["residual_load"],
    ),
    (
        "unloaded at 6 %, null",
        &[0.33, 0.67, 1.0, 0.06],
        &[Some(0.33), Some(0.67), Some(1.0), None],
        "",
        &[],
    ),
    (
        "softening 5 %",
        &[0.25, 0.5, 0.75, 1.0, 0.0],
        &[Some(0.25), Some(0.5), Some(0.75), Some(1.0), FIRST],
        "--effect softening=5",
        &["softening"],
    ),
    (
        "softening 6 %, three",
        &[0.33, 0.67, 1.0],
        &[Some(0.33), Some(0.67), Some(1.0)],
        "--effect softening=6",
        &["softening", "step_force_1", "force_offset"],
    ),
    (
        "forces 3 % too high",
        &[0.22, 0.47, 0.72, 0.97, 0.0],
        &[Some(0.25), Some(0.5), Some(0.75), Some(1.0), FIRST],
        "",
        &["force_offset"],
    ),
    (
        "forces 4 % too high, three",
        &[0.29, 0.63, 0.96],
        &[Some(0.33), Some(0.67), Some(1.0)],
        "",
        &["force_offset", "step_force_1", "softening"],
    ),
    (
        "one of four off by 4 %",
        &[0.25, 0.52, 0.75, 1.0],
        &[Some(0.25), Some(0.5), Some(0.75), Some(1.0)],
        "",
        &["step_force_2"],
    ),
    (
        "all off by 2 to 3 %",
        &[0.2575, 0.4875, 0.77, 0.975],
        &[Some(0.25), Some(0.5), Some(0.75), Some(1.0)],
        "",
        &[
            "step_force_1",
            "step_force_2",
            "step_force_3",
            "step_force_4",
        ],
    ),
    (
        "second visit 9 % more",
        &[0.5, 1.0, 0.545, 0.0],
        &[Some(0.5), Some(1.0), Some(0.5), FIRST],
        "",
        &["hysteresis", "step_force_3"],
    ),
    (
        "null, four and unloaded",
        &[0.25, 0.5, 0.75, 1.0, 0.0],
        &[Some(0.25), Some(0.5), Some(0.75), Some(1.0), FIRST],
        "",
        &[],
    ),
    ("null, two", &[0.5, 1.0], &[Some(0.5), Some(1.0)], "", &[]),
];

/// Rows of the manual's table, by how they begin, with the cases that they are of.
const PRINTED: [(&str, &[&str]); 10] = [
    ("nothing", &["null, four and unloaded", "null, two"]),
    ("last of three", &["last of three at 93 %"]),
    (
        "last of two",
        &["last of two at 93 %", "last of two at 95 %"],
    ),
    ("\"unloaded\"", &["unloaded at 6 %"]),
    ("all forces 3 %", &["forces 3 % too high"]),
    ("the same with 4 %", &["forces 4 % too high, three"]),
    ("modulus falls", &["softening 5 %", "softening 6 %, three"]),
    ("one force", &["one of four off by 4 %"]),
    ("all forces off", &["all off by 2 to 3 %"]),
    ("second visit", &["second visit 9 % more"]),
];

/// Whether a cell of the manual's table says how a loop ended.
fn is_printed(cell: &str, ended: &Ended) -> bool {
    if let Some(name) = cell.split('`').nth(1).filter(|_| cell.starts_with('`')) {
        return ended.effects.iter().any(|e| e == name);
    }
    match cell.split("+- ").nth(1) {
        Some(percent) => {
            let said: f64 = percent.trim_end_matches(" %").parse().unwrap();
            let found = 100.0 * ended.widths().next().unwrap();
            ended.effects.is_empty() && (said - found).abs() < 1.0
        }
        None if cell == "nothing missing" => ended.status == Status::NothingMissing,
        None => ended.effects.is_empty() && ended.status == Status::Unexplained,
    }
}

/// Every other row, of steel and of the laminate in turn; `PLYCHAIN_ONLY=softening` runs those whose names contain that.
#[test]
#[ignore = "slow: 7 series"]
fn what_is_wrong_with_the_load_gets_no_wrong_name() {
    no_wrong_name(is_in_turn);
}

/// The others.
#[test]
#[ignore = "length: 21 series, 3 minutes"]
fn what_else_is_wrong_with_the_load_gets_no_wrong_name() {
    no_wrong_name(|is_steel, row| !is_in_turn(is_steel, row));
}

/// Every other mistake, of steel and of the laminate in turn.
fn is_in_turn(is_steel: bool, row: usize) -> bool {
    row % 4 == if is_steel { 0 } else { 2 }
}

fn no_wrong_name(is_asked: impl Fn(bool, usize) -> bool) {
    let only = std::env::var("PLYCHAIN_ONLY").unwrap_or_default();
    let page = std::fs::read_to_string(root().join("models/README.md")).unwrap();
    let rows = table(&page, "| what was wrong | steel | laminate |");
    let mut failed = Vec::new();
    for is_steel in [true, false] {
        let sort = if is_steel { "steel" } else { "laminate" };
        for (k, (name, loads, declared, effects, right)) in TABLE.iter().enumerate() {
            let name = format!("{sort}: {name}");
            let is_chosen = !only.is_empty() || is_asked(is_steel, k);
            if !name.contains(&only) || !is_chosen {
                continue;
            }
            let case = Mistaken {
                is_steel,
                constants: if is_steel { &STEEL } else { &LAMINATE },
                loads,
                declared,
                effects,
                seed: 40 + k as u64,
            };
            let ended = case.ended(&name);
            if is_wrong(&ended, right, 3.0) || ended.held() < ended.truth.len() {
                failed.push(ended.line());
            }
            let case = &name[sort.len() + 2..];
            let of_case = PRINTED.iter().find(|(_, cases)| cases.contains(&case));
            let Some((begin, _)) = of_case else {
                continue;
            };
            let row = rows.iter().find(|r| r[0].starts_with(begin)).unwrap();
            let cell = &row[if is_steel { 1 } else { 2 }];
            if !is_printed(cell, &ended) {
                failed.push(format!("the manual says {cell}: {}", ended.line()));
            }
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}

/// Mistakes as the manual calls them.
const KINDS: [&str; 4] = [
    "all forces, by an offset",
    "one force",
    "modulus falls",
    "second visit",
];

/// The models of steel and of the laminate as their files declare them.
fn nominal(is_steel: bool) -> &'static Model {
    static MODELS: [OnceLock<Model>; 2] = [OnceLock::new(), OnceLock::new()];
    MODELS[usize::from(is_steel)].get_or_init(|| {
        let file = if is_steel { steel() } else { laminate() };
        Model::load(Path::new(&file)).unwrap()
    })
}

/// A mistake as it may be: its kind by chance, in three to six steps, some with an unloaded picture. Constants, the thickness, the error
/// that all forces share and the error of each are drawn as the model file says that they are distributed.
struct Drawn {
    name: String,
    /// What the manual calls it.
    kind: &'static str,
    is_steel: bool,
    constants: Vec<f64>,
    loads: Vec<f64>,
    declared: Vec<Option<f64>>,
    effects: String,
    acted: Vec<String>,
    seed: u64,
}

impl Drawn {
    fn new(is_null: bool, seed: u64) -> Self {
        let rng = &mut Pcg64::seed_from_u64(7000 + seed);
        let is_steel = seed.is_multiple_of(2);
        let steps: usize = rng.random_range(3..=6);
        let mut declared: Vec<f64> = (1..=steps).map(|k| k as f64 / steps as f64).collect();
        let (mut effects, mut acted) = (String::new(), Vec::new());
        let percent: f64 = rng.random_range(2.0..8.0);
        let kind = match is_null {
            true => "nothing",
            false => KINDS[rng.random_range(0..4)],
        };
        if kind == "second visit" {
            declared.push(declared[steps / 2 - 1]);
        }
        let mut loads = declared.clone();
        match kind {
            "all forces, by an offset" => {
                let size =
                    [1.0, 3.0, 6.0][rng.random_range(0..3)] * [1.0, -1.0][rng.random_range(0..2)];
                loads.iter_mut().for_each(|f| *f += 0.01 * size);
                acted.push("force_offset".to_string());
            }
            "one force" => {
                let step = rng.random_range(0..steps);
                loads[step] *= 1.0 - 0.01 * percent;
                acted.push(format!("step_force_{}", step + 1));
            }
            "modulus falls" => {
                effects = format!("--effect softening={percent}");
                acted.push("softening".into());
            }
            "second visit" => {
                loads[steps] *= 1.0 + 0.01 * percent;
                acted = vec!["hysteresis".into(), format!("step_force_{}", steps + 1)];
            }
            _ => {}
        }
        if rng.random_bool(0.5) {
            declared.push(0.0);
            loads.push(0.0);
        }
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let model = nominal(is_steel);
        let common = model.prior_sd(force_scale(), 0).unwrap() * normal();
        for load in &mut loads {
            *load *= 1.0 + 0.01 * (common + CLASS_1_SD_PERCENT * normal());
        }
        let thickness = model.experiment().specimen.thickness_mm;
        let thickness = thickness.mean + thickness.sd * normal();
        effects = format!("--set thickness_mm={thickness} {effects}");
        let priors = model.marginals().into_iter();
        let constants: Vec<f64> = priors.map(|p| p.mean + p.sd * normal()).collect();
        let sort = if is_steel { "steel" } else { "laminate" };
        Self {
            name: format!("{seed} {sort}, {steps} steps, {kind} {effects} {loads:.3?}"),
            kind,
            is_steel,
            constants,
            declared: declared.into_iter().map(Some).collect(),
            loads,
            effects,
            acted,
            seed,
        }
    }

    fn ended(&self) -> Ended {
        let case = Mistaken {
            is_steel: self.is_steel,
            constants: &self.constants,
            loads: &self.loads,
            declared: &self.declared,
            effects: &self.effects,
            seed: self.seed,
        };
        case.ended(&self.name)
    }

    /// Whether something else is named alone. Of a few steps a right and a wrong force may leave the same: those are in one group.
    fn is_wrong(&self, ended: &Ended) -> bool {
        let acted: Vec<&str> = self.acted.iter().map(String::as_str).collect();
        // of 600 intervals whose truths are drawn, chance puts 1.6 beyond three sds, and none beyond four in 96 of 100 such tests
        is_wrong(ended, &acted, 4.0)
    }
}

/// A hundred mistakes and a hundred series without one: no wrong name, and intervals that hold as often as they say.
#[test]
#[ignore = "by hand: 200 series, half an hour"]
fn mistakes_of_the_load_by_chance_are_never_sure_and_wrong() {
    let page = std::fs::read_to_string(root().join("models/README.md")).unwrap();
    let rows = table(&page, "| by chance | series |");
    assert_eq!(rows.len(), KINDS.len() + 1);
    let is_kind = |name: &str| KINDS.contains(&name) || name == "nothing";
    assert!(rows.iter().all(|row| is_kind(&row[0])));
    let (mut faults, mut all_held) = (Vec::new(), 0);
    for is_null in [false, true] {
        let drawn: Vec<Drawn> = (0..100).map(|seed| Drawn::new(is_null, seed)).collect();
        let case = |seed| -> Case { Box::new(move || Drawn::new(is_null, seed).ended()) };
        let ended = all(&(0..100).map(case).collect::<Vec<_>>());
        let held: usize = ended.iter().map(Ended::held).sum();
        let count: usize = ended.iter().map(|e| e.truth.len()).sum();
        println!("{held} of {count} intervals hold");
        all_held += held;
        assert!(100 * held >= 93 * count, "{held} of {count}");
        let named = ended.iter().filter(|e| !e.effects.is_empty()).count();
        assert!(!is_null || named <= 2, "{named} of 100 nulls named");
        let pairs = || drawn.iter().zip(&ended);
        faults.extend(
            pairs()
                .filter(|(d, e)| d.is_wrong(e))
                .map(|(_, e)| e.line()),
        );
        for row in &rows {
            let of_kind = pairs().filter(|(d, _)| d.kind == row[0]);
            let all: Vec<Status> = of_kind.map(|(_, e)| e.status).collect();
            let count = |status: Status| all.iter().filter(|s| **s == status).count();
            let found = [
                all.len(),
                count(Status::Closed),
                count(Status::Unexplained),
                count(Status::NothingMissing),
            ];
            if !all.is_empty() && row[1..] != found.map(|n| n.to_string()) {
                faults.push(format!("the manual says {row:?}: {found:?}"));
            }
        }
    }
    let said = page.contains(&format!("{all_held} of 600 intervals hold"));
    assert!(faults.is_empty() && said, "{all_held}: {faults:#?}");
}
