//! `plychain design`: what experiments would say before they are made, against what they say once they are.

use plychain::experiment::frequencies::SupportSpec;
use plychain::infer::Model;
use plychain::study::frequencies::plate_information;
use plychain::study::{Experiment, Measuring, SharedConstants, Study};
use plychain::trace::Information;
use plychain::validate::design::{
    ProposedExperiment, assess, coupons, plate, plates, posterior_sds,
};
use serde_json::Value;

use crate::common::{coarse, fresh, identify, plychain, posterior, simulated, succeed};

fn model() -> Model {
    Model::load(std::path::Path::new(&coarse())).unwrap()
}

const MEASURING: Measuring = Measuring {
    noise_nm: 40.0,
    grid: 61,
};

fn study() -> Study {
    Study::load(std::path::Path::new(&coarse())).unwrap()
}

fn shared() -> SharedConstants {
    study().shared()
}

/// What the declared field says.
fn own() -> Information {
    let study = study();
    let experiment: &dyn Experiment = &*study.experiments[0];
    experiment.information(&shared(), MEASURING).unwrap()
}

/// The sds of the linearised field are those of the chains on simulated data of it, and what half a promille of undeclared scale does to the
/// constants is what the bare fit then says.
#[test]
fn a_field_says_what_design_says_it_would() {
    let model = model();
    let found = own();
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
    let layup = model.experiment().specimen.layup_deg.clone().unwrap();
    let thickness_mm = model.experiment().specimen.thickness_mm;
    let all = plates(&layup, thickness_mm);
    let named = all
        .iter()
        .any(|c| c.name.starts_with("plate, layup at 30 deg, 173"));
    assert!(named);
    let shared = shared();
    let told = |spec| plate_information(&spec, shared.material, &shared.constants).unwrap();
    let turned = layup.iter().map(|a| a + 30.0).collect();
    let wide = plate(turned, [245.0, 122.0], thickness_mm);
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
    let wanted = [
        "coupon, one direction at 90 deg, no hole",
        "coupon, one direction at 90 deg",
    ];
    let some: Vec<ProposedExperiment> = coupons(&model)
        .into_iter()
        .filter(|c| wanted.contains(&&*c.name))
        .collect();
    assert_eq!(some.len(), 2);
    let found = assess(&some, &shared(), MEASURING, &|| ());
    let article = posterior_sds(&[&own().with_effects])[1];
    let best = found
        .iter()
        .map(|f| posterior_sds(&[&f.information.with_effects])[1]);
    let best = best.fold(f64::INFINITY, f64::min);
    assert!(best < 0.4 * article, "{best} {article}");
}

#[test]
#[ignore = "slow: run by .ci/run"]
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
    let plate = crate::common::model("plate.json");
    let text = succeed(&["design", &coarse(), &plate]);
    assert!(text.contains("plate: ringing"), "{text}");
}
