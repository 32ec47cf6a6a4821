//! Every entry of the dictionary, simulated at its plausible size in a test where it can act, and what a whole loop says of it: it is named,
//! alone or in a group that it does not tell apart, or it is among the blind spots with a size below what these data show.

use std::path::Path;

use plychain::effect::{EFFECTS, Effect, Scope, why_not};
use plychain::experiment::series::Law;
use plychain::infer::Model;
use plychain::mesh_files::ElementKind;
use plychain::trace::BlindSpot;
use serde_json::{Value, json};

use crate::common::{changed, coarse, fresh, set_coarse, simulated};
use crate::imported::regions::sheet;
use crate::imported::writers::msh41;
use crate::load_mistakes::{OF_LAMINATE, laminate, steel};
use crate::loops::{Case, Ended, acting, all, judge_intervals, judge_names, looped};

/// A test in which effects may act: its model, what `simulate` is told of it, and the constants that are set.
struct Stage {
    model: String,
    arguments: String,
    constants: Vec<(&'static str, f64)>,
}

const LAMINATE: [(&str, f64); 4] = [
    ("E1_GPa", 150.0),
    ("E2_GPa", 7.9),
    ("nu12", 0.33),
    ("G12_GPa", 4.6),
];

/// Forces of a series of `count` steps up to the largest, half of that, and the unloaded specimen.
fn steps(count: usize, largest: f64) -> String {
    let forces = (1..=count).map(|k| (largest * k as f64 / count as f64).round().to_string());
    let forces: Vec<String> = forces.collect();
    format!(
        "--steps {},{},0 --motion-mm 0.1",
        forces.join(","),
        0.5 * largest
    )
}

/// Moire of one load; series of image correlation, of a laminate with a short one and one of twelve loads, and of steel that yields; a mesh
/// with edges whose load introduction is measured; plies of three angles. The first in which an effect can act is its stage.
fn stages() -> &'static [Stage] {
    let with = |file: &str, change: &dyn Fn(&mut Value)| {
        let text = std::fs::read_to_string(file).unwrap();
        let mut model: Value = serde_json::from_str(&text).unwrap();
        change(&mut model);
        let file = fresh("stage.json");
        std::fs::write(&file, model.to_string()).unwrap();
        file.display().to_string()
    };
    let pictured = with(&laminate(), &|m| {
        let e = &mut m["experiments"][0];
        e["measurement"]["image_correlation"]["pixel_mm"] = json!(0.05);
        e["plausible"] = json!({ "ply_share_1.ply_percent": 2.0 });
    });
    let three_angles = changed("openhole.json", |m| {
        set_coarse(m);
        let e = &mut m["experiments"][0];
        e["specimen"]["layup_deg"] = json!([0, 45, -45, 90, 90, -45, 45, 0]);
        e["plausible"] = json!({ "ply_share_2.ply_percent": 2.0 });
    });
    let yielding = with(&steel(), &|m| {
        m["material"]["yield_MPa"] = json!({ "mean": 290.0, "sd": 30.0 });
    });
    let mesh = fresh("sheet.msh");
    std::fs::write(
        &mesh,
        msh41(&sheet(ElementKind::Q8, [48, 20], [60.0, 25.0]), true),
    )
    .unwrap();
    let spread = changed("two-holes.json", |m| {
        let e = &mut m["experiments"][0];
        e["mesh"] = json!({ "file": mesh, "origin_mm": [45.0, 12.5], "load": [
            { "edge": "u1", "direction": [1, 0], "spread": "measured" },
            { "edge": "u0", "direction": [-1, 0], "spread": "measured" }] });
        e["mesh_density"] = json!(2);
        e["measurement"]["loading_axis"] = json!("x");
        e["window_mm"] = json!([[-15, -12], [12, 12]]);
    });
    let laminate = |model: &str, arguments: String| Stage {
        model: model.into(),
        arguments,
        constants: LAMINATE.to_vec(),
    };
    vec![
        laminate(&coarse(), "--grid 51 --noise-nm 4.2".into()),
        laminate(
            &pictured,
            format!("--grid 41 --noise-nm 100 {}", steps(4, OF_LAMINATE)),
        ),
        Stage {
            model: yielding,
            arguments: format!("--grid 41 --noise-nm 100 {}", steps(4, 6000.0)),
            constants: vec![("E_GPa", 208.0), ("nu", 0.285)],
        },
        laminate(&spread, "--grid 61 --noise-nm 20".into()),
        laminate(&three_angles, "--grid 51 --noise-nm 4.2".into()),
        laminate(
            &pictured,
            format!("--grid 28 --noise-nm 100 {}", steps(12, OF_LAMINATE)),
        ),
    ]
    .leak()
}

impl Stage {
    /// The model of a simulation with these arguments.
    fn simulated(&self, more: &str) -> Model {
        let set = self.constants.iter();
        let set: Vec<String> = set.map(|(n, x)| format!("--set {n}={x}")).collect();
        let arguments = format!("{} {} {more}", self.arguments, set.join(" "));
        let folder = simulated(&self.model, &arguments);
        Model::load(&folder.join("model.json")).unwrap()
    }

    fn truth(&self) -> Vec<f64> {
        self.constants.iter().map(|(_, x)| *x).collect()
    }

    /// The loop over a simulation.
    fn looped(&self, case: &str, effect: &str, seed: usize) -> Ended {
        let model = self.simulated(&format!("--seed {seed} --effect {effect}"));
        looped(case, &model, &self.truth())
    }
}

/// Whether an effect can act in a test and is looked for there, or takes part in it whatever is found.
fn acts(effect: &dyn Effect, nominal: &Model) -> bool {
    let scene = nominal.scene();
    let declared = !effect.needs_declared_scatter() || nominal.always_acts(effect);
    declared && effect.applies_to(&scene) && why_not(effect, &scene).is_none()
}

/// Amplitudes that are one prior sd together, of alternating signs (two sensitivities of one sign are a scale of the force, of which every
/// verdict speaks); what nothing bounds, at the sizes that stand here.
fn plausible(effect: &dyn Effect, model: &Model) -> Vec<f64> {
    if effect.name() == "fringe_order_jump" {
        // an order in the disc about a point, lost in one component
        return vec![1.0, 0.0, 5.0, 6.0, 3.0];
    }
    let scene = model.scene();
    let is_series = model.experiment().steps.is_some();
    let needed = effect.needed();
    let one = |k: usize| {
        let sd = match is_series {
            true => Some(model.prior_sd_in_series(&scene, effect, k)),
            false => model.prior_sd(effect, k),
        };
        let sd = sd.unwrap_or_else(|| panic!("no size of {} is plausible", effect.name()));
        let sign = match k % 2 == 1 && !effect.parameters()[k].positive {
            true => -1.0,
            false => 1.0,
        };
        sign * sd / (needed as f64).sqrt()
    };
    (0..needed).map(one).collect()
}

/// An entry of the dictionary with amplitudes, border units.
pub struct SizedEffect {
    pub effect: &'static dyn Effect,
    pub amplitude: Vec<f64>,
}

impl SizedEffect {
    /// Every effect that is sought in a model, or in how its field was recorded, at its plausible size.
    pub fn all_in(model: &Model) -> Vec<Self> {
        let declared = |e: &&dyn Effect| model.effects.iter().any(|d| d.name() == e.name());
        let sought = EFFECTS.iter().copied();
        sought
            .filter(|e| acts(*e, model) && !e.is_force_scale() && !declared(e))
            .map(|effect| Self {
                effect,
                amplitude: plausible(effect, model),
            })
            .collect()
    }

    /// So many times as large; whole orders stay what they are, and what cannot be negative is not.
    pub fn times(&self, factor: f64) -> Self {
        let parameters = self.effect.parameters().iter().zip(&self.amplitude);
        let scaled = parameters.map(|(p, a)| match p.prior_sd {
            None => *a,
            Some(_) if p.positive => a * factor.abs(),
            Some(_) => a * factor,
        });
        Self {
            effect: self.effect,
            amplitude: scaled.collect(),
        }
    }

    /// `name=a,b`.
    pub fn text(&self) -> String {
        let values: Vec<String> = self.amplitude.iter().map(f64::to_string).collect();
        format!("{}={}", self.effect.name(), values.join(","))
    }

    /// Whether no data like these would show so much of it, by the blind spots of a tracing; or whether it
    /// takes part in every fit, and needs no naming.
    pub fn is_hidden(&self, blind: &[BlindSpot]) -> bool {
        let name = self.effect.name();
        let size = self.amplitude.iter().fold(0.0_f64, |m, a| m.max(a.abs()));
        let mut own = blind.iter().filter(|spot| spot.effect == name);
        self.effect.is_of_every_test() || own.any(|spot| size < spot.detectable)
    }
}

/// How a loop told of an effect.
#[derive(Debug, PartialEq)]
pub enum Told {
    Named,
    /// With others that leave the same field, or nearly, or as undecided.
    InGroup,
    /// No data of this kind would show so much.
    Hidden,
    Not,
}

/// What a loop said of an effect that acted.
pub fn told(ended: &Ended, acted: &SizedEffect) -> Told {
    let name = acted.effect.name();
    let grouped = |groups: &[Vec<String>]| groups.iter().flatten().any(|n| n == name);
    if ended.names_alone(name) {
        Told::Named
    } else if grouped(&ended.alias_groups) || grouped(&ended.undecided) {
        Told::InGroup
    } else if acted.is_hidden(&ended.blind) {
        Told::Hidden
    } else {
        Told::Not
    }
}

/// Loops in which one effect each acted: it is told of, no other is named as the only cause, and the constants hold in 93 % of the intervals.
pub fn judge(ended: &[Ended], acted: &[SizedEffect]) {
    let mut silent = Vec::new();
    for (ended, acted) in ended.iter().zip(acted) {
        let told = told(ended, acted);
        println!("{:50} {told:?}", acted.text());
        if told == Told::Not {
            silent.push(ended.line());
        }
    }
    assert!(silent.is_empty(), "{silent:#?}");
    judge_intervals(ended);
    judge_names(ended, acting);
}

#[test]
#[ignore = "slow: a loop for each effect, 7 minutes"]
fn every_effect_is_named_or_is_a_blind_spot() {
    let stages = stages();
    let nominal: Vec<Model> = stages
        .iter()
        .map(|s| match s.arguments.contains("--steps") {
            true => s.simulated(""),
            false => Model::load(Path::new(&s.model)).unwrap(),
        })
        .collect();
    let mut cases: Vec<Case> = Vec::new();
    let mut acted = Vec::new();
    for (k, effect) in EFFECTS.iter().enumerate() {
        let place = nominal.iter().position(|m| acts(*effect, m));
        let place = place.unwrap_or_else(|| panic!("{} can act nowhere", effect.name()));
        let (stage, model) = (&stages[place], &nominal[place]);
        // what takes part in the model from the beginning needs no naming
        let takes_part = model.effects.iter().any(|e| e.name() == effect.name());
        if takes_part || effect.is_force_scale() {
            continue;
        }
        let one = SizedEffect {
            effect: *effect,
            amplitude: plausible(*effect, model),
        };
        let moves = effect.scope() == Scope::Motion && model.experiment().steps.is_some();
        let text = one.text() + if moves { ":constant" } else { "" };
        cases.push(Box::new(move || {
            stage.looped(&format!("{place} {text}"), &text, 7000 + k)
        }));
        acted.push(one);
    }
    judge(&all(&cases), &acted);
}

/// A motion of the specimen by every law is named, and the law is the one that acts or one that the loads do not tell from it.
#[test]
#[ignore = "slow: a loop for each law, 2 minutes"]
fn every_law_is_told() {
    let stage = &stages()[1];
    // an amplitude of its own in every step is no law
    let laws: Vec<Law> = Law::ALL.into_iter().filter(|l| *l != Law::Free).collect();
    let cases: Vec<Case> = laws
        .iter()
        .enumerate()
        .map(|(k, law)| {
            let text = format!("out_of_plane_rotation=3,-2:{}", law.key());
            let case: Case = Box::new(move || stage.looped(&text, &text, 7100 + k));
            case
        })
        .collect();
    for (law, ended) in laws.iter().zip(all(&cases)) {
        assert!(ended.names("out_of_plane_rotation"), "{}", ended.line());
        let told = ended.laws.iter().any(|l| l == law);
        assert!(told, "{law:?} {:?}: {}", ended.laws, ended.line());
    }
}
