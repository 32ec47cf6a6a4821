//! `plychain design`: what experiments would say before they are made, against what they say once they are.

use plychain::experiment::frequencies::SupportSpec;
use plychain::infer::{Model, plate_information};
use plychain::trace::Information;
use plychain::validate::design::{
    Candidate, Measuring, Test, assess, coupons, declared, information, plates, posterior_sds,
};
use serde_json::Value;

use crate::program::{coarse, fresh, identify, plychain, posterior, simulated, succeed};

fn model() -> Model {
    Model::load(std::path::Path::new(&coarse())).unwrap()
}

const MEASURING: Measuring = Measuring {
    noise_nm: 40.0,
    grid: 61,
};

fn of(model: &Model, test: &Test) -> Information {
    let names = model.constants().iter().map(|n| (*n).to_string());
    let constants: Vec<_> = names.zip(model.marginals()).collect();
    information(test, model.material(), &constants, MEASURING).unwrap()
}

fn own(model: &Model) -> Test {
    declared(model).remove(0).test
}

/// The sds of the linearised field are those of the chains on simulated data of it, and what half a promille of undeclared scale does to the
/// constants is what the bare fit then says.
#[test]
fn a_field_says_what_design_says_it_would() {
    let model = model();
    let found = of(&model, &own(&model));
    let sds = posterior_sds(&[&found.alone]);
    let hidden = found
        .hidden
        .iter()
        .find(|h| h.parameter == "magnification.percent")
        .unwrap();
    let identified = |effect: &str| {
        let arguments = format!("--grid 61 --noise-nm 40 --seed 3 {effect}");
        let folder = simulated(&coarse(), &arguments);
        identify(folder.join("model.json").to_str().unwrap(), &[])
    };
    let (plain, scaled) = (identified(""), identified("--effect magnification=0.05"));
    for (k, (name, prior)) in model.constants().iter().zip(model.marginals()).enumerate() {
        let (before, sd) = posterior(&plain, name);
        let ratio = sds[k] * prior.sd / sd;
        assert!((0.7..1.4).contains(&ratio), "{name}: {ratio}");
        let (after, _) = posterior(&scaled, name);
        let shift = (after - before) / sd;
        let expected = hidden.shift[k] * 0.05 * prior.sd / sd;
        assert!(
            (shift - expected).abs() < 0.25 + 0.2 * expected.abs(),
            "{name}: {shift} sd, {expected}"
        );
    }
    // effects that may act take from what a field says, and never add
    let with = posterior_sds(&[&found.with_effects]);
    assert!(with.iter().zip(sds.iter()).all(|(a, b)| a >= &(b - 1e-9)));
    assert!(with[1] > 2.0 * sds[1], "{} {}", with[1], sds[1]);
}

/// A plate turned by a right angle with its sides interchanged is the same plate; two plates say more than one; clamped ones are others.
#[test]
fn plates_say_the_same_from_either_side() {
    let model = model();
    let names = model.constants().iter().map(|n| (*n).to_string());
    let constants: Vec<_> = names.zip(model.marginals()).collect();
    let layup = model.experiment().specimen.layup_deg.clone().unwrap();
    let all = plates(&layup, model.experiment().specimen.thickness_mm);
    let spec = |name: &str| match &all.iter().find(|c| c.name.starts_with(name)).unwrap().test {
        Test::Plate(spec) => (**spec).clone(),
        Test::Field(_) => panic!("{name}"),
    };
    let told = |spec| plate_information(&spec, model.material(), &constants).unwrap();
    let wide = spec("plate, layup at 30 deg, 245");
    let mut turned = wide.clone();
    turned
        .specimen
        .layup_deg
        .iter_mut()
        .for_each(|a| *a = 90.0 - *a);
    std::mem::swap(
        &mut turned.specimen.length_mm,
        &mut turned.specimen.width_mm,
    );
    let [a, b] = [told(wide.clone()), told(turned)];
    assert!((&a - &b).amax() < 1e-4 * a.amax(), "{a} {b}");
    let [one, two] = [posterior_sds(&[&a]), posterior_sds(&[&a, &b])];
    assert!(two.iter().zip(one.iter()).all(|(two, one)| two <= one));
    let mut clamped = wide;
    clamped.support = SupportSpec::All(plychain::experiment::frequencies::EdgeSpec::Clamped);
    assert!((told(clamped) - &a).amax() > 0.01 * a.amax());
}

/// A coupon of one ply direction across its fibres measures E2 without asking what acts; the article's test does not.
#[test]
fn a_test_that_is_sensitive_to_e2_is_found() {
    let model = model();
    let names = model.constants().iter().map(|n| (*n).to_string());
    let constants: Vec<_> = names.zip(model.marginals()).collect();
    let wanted = [
        "coupon, one direction at 90 deg, no hole",
        "coupon, one direction at 90 deg",
    ];
    let some: Vec<Candidate> = coupons(&model)
        .into_iter()
        .filter(|c| wanted.contains(&&*c.name))
        .collect();
    assert_eq!(some.len(), 2);
    let found = assess(&some, model.material(), &constants, MEASURING, &|| ());
    let article = posterior_sds(&[&of(&model, &own(&model)).with_effects])[1];
    let best = found
        .iter()
        .map(|f| posterior_sds(&[&f.information.with_effects])[1]);
    let best = best.fold(f64::INFINITY, f64::min);
    assert!(best < 0.4 * article, "{best} {article}");
}

#[test]
fn the_command_ranks_and_writes() {
    let out = fresh("design.json").display().to_string();
    let text = succeed(&[
        "design",
        &coarse(),
        "--for",
        "E2_GPa,nu12",
        "--noise-nm",
        "40",
        "--grid",
        "61",
        "--out",
        &out,
    ]);
    assert!(
        text.contains("what to measure next") && text.contains("magnification.percent"),
        "{text}"
    );
    let report: Value = serde_json::from_str(&std::fs::read_to_string(out).unwrap()).unwrap();
    assert_eq!(report["ranked_by"], serde_json::json!(["E2_GPa", "nu12"]));
    let all = report["candidates"].as_array().unwrap();
    assert!(all.len() > 60, "{}", all.len());
    let prior = &report["prior_sd_percent"]["E2_GPa"];
    for one in all {
        let sd = one["together_percent"]["E2_GPa"].as_f64().unwrap();
        assert!(sd > 0.0 && sd <= prior.as_f64().unwrap(), "{one}");
    }
    let refused = plychain(&["design", &coarse(), "--for", "E3_GPa"]);
    assert_eq!(refused.status.code(), Some(1));
    let plate = crate::program::model("plate.json");
    let text = succeed(&["design", &coarse(), &plate]);
    assert!(text.contains("plate: ringing"), "{text}");
}
