//! Densities over HTTP, in the UM-Bridge protocol: served and sampled, by this program and by others.

use std::process::{Child, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use plychain::bridge::{BoundServer, HostedModel, Patience, RemoteDensity, serve};
use plychain::chain::read_zarr;
use plychain::diagnose::Rule;
use plychain::sample::{Adaptive, LogDensity, Quiet, Schedule, Start, density, run};
use serde_json::{Value, json};

use crate::common::{fresh, plychain, program, python, root, workplace};

/// A bent normal, 0 where x < -2.
fn banana(x: &[f64]) -> f64 {
    match x[0] < -2.0 {
        true => f64::NEG_INFINITY,
        false => -0.5 * (x[0] * x[0] + (x[1] - 0.5 * x[0] * x[0]).powi(2) / 0.25),
    }
}

/// Serves a density for the rest of the tests' time; counts evaluations, and gives none after `most`.
fn hosted(most: usize) -> (String, Arc<AtomicUsize>) {
    let bound = BoundServer::new(0).unwrap();
    let (url, count) = (bound.url.clone(), Arc::new(AtomicUsize::new(0)));
    let counted = Arc::clone(&count);
    std::thread::spawn(move || {
        let evaluate = Box::new(move |x: &[f64]| {
            let before = counted.fetch_add(1, Ordering::Relaxed);
            (before < most)
                .then(|| vec![banana(x)])
                .ok_or_else(|| "out of order".to_string())
        });
        let model = HostedModel {
            name: "banana",
            inputs: 2,
            outputs: 1,
            evaluate,
        };
        serve(&bound, &[model], 4)
    });
    (url, count)
}

fn patience(seconds: f64) -> Patience {
    Patience {
        answer: Duration::from_secs(20),
        silence: Duration::from_secs_f64(seconds),
        requests: 3,
    }
}

fn names() -> Vec<String> {
    vec!["a".into(), "b".into()]
}

#[test]
fn draws_over_http_are_those_of_the_function() {
    let (url, _) = hosted(usize::MAX);
    let no_prior = |_: &[f64]| 0.0;
    let place = (&*url, "banana");
    let remote =
        RemoteDensity::connect(place, names(), json!({}), patience(5.0), &no_prior).unwrap();
    assert_eq!(remote.value(&[-3.0, 0.0]).unwrap(), f64::NEG_INFINITY);
    let mut out = [0.0; 5];
    remote
        .values(
            &[0.0, 1.0, -5.0, 0.3, 0.1, 0.0, 1.0, 0.0, 0.2, 0.7],
            &mut out,
        )
        .unwrap();
    let points = [[0.0, 0.0], [1.0, 1.0], [-5.0, 0.0], [0.3, 0.2], [0.1, 0.7]];
    assert_eq!(out, points.map(|p| banana(&p)));

    let schedule = Schedule {
        max_draws: 400,
        warmup: Some(40),
        ensembles: 2,
        seed: 3,
        ..Schedule::default()
    };
    let covariance = [1.0, 0.0, 0.0, 1.0];
    let start = Start::Ball {
        centre: &[0.0, 0.0],
        covariance: &covariance,
        spread: 1.0,
    };
    let local = density(["a", "b"], banana);
    let rule = Rule::default();
    let draws = |target: &dyn LogDensity| {
        let sampler = Adaptive::default();
        run(target, &sampler, &start, &schedule, &rule, &Quiet)
            .unwrap()
            .draws
    };
    let (ours, theirs) = (draws(&local), draws(&remote));
    assert_eq!((ours.values(), ours.lp()), (theirs.values(), theirs.lp()));
}

#[test]
fn a_server_or_a_model_that_is_not_there_is_said() {
    let no_prior = |_: &[f64]| 0.0;
    let dead = BoundServer::new(0).unwrap().url;
    let of = |url: &str, model: &str, names: Vec<String>| {
        let found =
            RemoteDensity::connect((url, model), names, json!({}), patience(0.3), &no_prior);
        found.err().unwrap()
    };
    let error = of(&dead, "banana", names());
    assert!(error.to_string().contains(&dead), "{error}");
    assert!(error.hint_text().unwrap().contains("--resume"), "{error}");
    let (url, _) = hosted(usize::MAX);
    assert!(of(&url, "apple", names()).to_string().contains("banana"));
    assert!(
        of(&url, "banana", vec!["a".into()])
            .to_string()
            .contains("[2]")
    );
    // a port that another one has
    let port = url.rsplit(':').next().unwrap().parse().unwrap();
    assert!(
        BoundServer::new(port)
            .err()
            .unwrap()
            .to_string()
            .contains("port")
    );
}

/// Arguments that sample a density on a server, a thousand draws.
fn sampling(url: &str, out: &str) -> Vec<String> {
    let rest = "--model banana --box a=-1:1,b=-1:1 --walkers 8 --ensembles 2 --move de:0.6,stretch:0.4 --max-draws 2000 --min-ess 1e9 --quiet";
    let own = ["sample", "--url", url, "--out", out].map(String::from);
    own.into_iter()
        .chain(rest.split(' ').map(String::from))
        .collect()
}

fn plychain_of(arguments: &[String], more: &[&str]) -> std::process::Output {
    let all: Vec<&str> = arguments
        .iter()
        .map(String::as_str)
        .chain(more.iter().copied())
        .collect();
    plychain(&all)
}

/// A server that fails on the way ends a run with an error; resumed with another server, its draws are those of a run without a failure.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_run_whose_server_failed_goes_on_to_the_same_bits() {
    let (whole, broken) = (fresh("whole"), fresh("broken"));
    let (good, count) = hosted(usize::MAX);
    let end = plychain_of(&sampling(&good, whole.to_str().unwrap()), &[]);
    assert!(end.status.success(), "{end:?}");
    let (bad, _) = hosted(count.load(Ordering::Relaxed) / 2);
    let end = plychain_of(&sampling(&bad, broken.to_str().unwrap()), &[]);
    let said = String::from_utf8(end.stderr).unwrap();
    assert!(
        !end.status.success() && said.contains("out of order"),
        "{said}"
    );
    let end = plychain_of(&sampling(&good, broken.to_str().unwrap()), &["--resume"]);
    assert!(end.status.success(), "{end:?}");
    let draws = [whole, broken].map(|run| read_zarr(&run.join("chain.zarr"), None).unwrap());
    assert_eq!(draws[0].draws(), 2000 / 16);
    assert_eq!(draws[0].values(), draws[1].values());
    // other moves are another run
    let mut other = sampling(&good, fresh("other").to_str().unwrap());
    other.extend(["--resume", "--thin", "0"].map(String::from));
    assert!(!plychain_of(&other, &[]).status.success());
}

/// A posterior with a prior beside the server's density: that of a normal times a normal.
#[test]
#[ignore = "slow: run by .ci/run"]
fn priors_are_added_and_moments_are_right() {
    let (url, _) = hosted(usize::MAX);
    let place = fresh("prior.json");
    std::fs::write(
        &place,
        r#"{ "a": { "normal": { "mean": 1, "sd": 0.5 } }, "b": { "uniform": [-9, 30] } }"#,
    )
    .unwrap();
    let out = fresh("priors");
    let arguments = format!(
        "sample --url {url} --model banana --prior {} --out {} --walkers 16 --move de:0.9,stretch:0.1 --min-ess 400 --quiet",
        place.display(),
        out.display()
    );
    let end = plychain(&arguments.split(' ').collect::<Vec<_>>());
    assert!(end.status.success(), "{end:?}");
    let text = plychain(&["diagnose", out.to_str().unwrap(), "--json"]).stdout;
    let found: Value = serde_json::from_slice(&text).unwrap();
    // N(0, 1) times N(1, 0.5): precision 1 + 4, mean 4 / 5; the cut at -2 is 6 sds off
    let (mean, variance) = (0.8, 0.2_f64);
    for (name, mean, sd) in [
        ("a", mean, variance.sqrt()),
        (
            "b",
            0.5 * (mean * mean + variance),
            (0.25 + 0.25 * (2.0 * variance.powi(2) + 4.0 * mean * mean * variance)).sqrt(),
        ),
    ] {
        let figure = |key: &str| found["parameters"][name][key].as_f64().unwrap();
        let z = (figure("mean") - mean) / figure("mcse_mean");
        assert!(z.abs() < 4.5, "{name}: mean {} z {z}", figure("mean"));
        let z = (figure("sd") - sd) / figure("mcse_sd");
        assert!(z.abs() < 4.5, "{name}: sd {} for {sd}, z {z}", figure("sd"));
    }
    let manifest = std::fs::read_to_string(out.join("run.json")).unwrap();
    assert!(manifest.contains("prior.json") && !manifest.contains("unfinished"));
}

/// `plychain serve` of a sheet in closed form.
struct Served {
    child: Child,
    url: String,
    said: String,
}

impl Served {
    fn start(port: u16) -> Self {
        use std::io::{BufRead, BufReader};
        let mut child = program()
            .current_dir(workplace())
            .args(["serve", sheet(), "--quiet", "--port", &port.to_string()])
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let said: Vec<String> = (0..3).map(|_| lines.next().unwrap().unwrap()).collect();
        let url = said[0].split(' ').next_back().unwrap().to_string();
        Self {
            child,
            url,
            said: said.join("\n"),
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A model of a sheet without a hole, in closed form, with a measurement.
fn sheet() -> &'static str {
    static FILE: OnceLock<String> = OnceLock::new();
    FILE.get_or_init(|| {
        let place = fresh("sheet");
        std::fs::create_dir(&place).unwrap();
        let text = std::fs::read_to_string(root().join("models/openhole.json")).unwrap();
        let mut model: Value = serde_json::from_str(&text).unwrap();
        model["experiments"][0]["kind"] = "mock".into();
        model["experiments"][0]["measurement"]["dir"] = "data".into();
        model["reduced_model"] = json!({ "snapshots": 60, "modes": 4, "degree": 3 });
        let file = place.join("sheet.json").display().to_string();
        std::fs::write(&file, model.to_string()).unwrap();
        let data = place.join("data").display().to_string();
        let end = plychain(&[
            "simulate", &file, "--grid", "15", "--seed", "4", "--out", &data,
        ]);
        assert!(end.status.success(), "{end:?}");
        file
    })
}

/// The posterior of a model over HTTP, sampled by this program: moments are those of `identify`, in their standard errors. The server is
/// killed on the way and started again, and the run waits for it.
#[test]
#[ignore = "slow: run by .ci/run"]
fn a_served_posterior_is_that_of_identify() {
    let alone = fresh("alone");
    let end = plychain(&[
        "identify",
        sheet(),
        "--quiet",
        "--out",
        alone.to_str().unwrap(),
        "--min-ess",
        "1000",
    ]);
    assert!(end.status.success(), "{end:?}");
    let mut served = Served::start(0);
    assert!(
        served
            .said
            .contains("posterior: E1_GPa, E2_GPa, nu12, G12_GPa, noise_nm"),
        "{}",
        served.said
    );
    let port: u16 = served.url.rsplit(':').next().unwrap().parse().unwrap();
    let over = fresh("over");
    let arguments = format!(
        "sample --url {} --model posterior --box E1_GPa=155:165,E2_GPa=7.2:7.9,nu12=0.32:0.36,G12_GPa=4.2:4.7,noise_nm=8:12 --out {} --walkers 24 --ensembles 2 --min-ess 600 --quiet",
        served.url,
        over.display()
    );
    let run = program()
        .current_dir(workplace())
        .args(arguments.split(' '))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(700));
    drop(served);
    served = Served::start(port);
    let end = run.wait_with_output().unwrap();
    assert!(end.status.success(), "{end:?}");
    drop(served);
    let figures = [alone, over].map(|run| {
        let text = plychain(&["diagnose", run.to_str().unwrap(), "--json"]).stdout;
        serde_json::from_slice::<Value>(&text).unwrap()["parameters"].clone()
    });
    for (name, ours) in figures[0].as_object().unwrap() {
        let theirs = &figures[1][name];
        for (figure, error) in [("mean", "mcse_mean"), ("sd", "mcse_sd")] {
            let number = |of: &Value, key: &str| of[key].as_f64().unwrap();
            let z = (number(ours, figure) - number(theirs, figure))
                / number(ours, error).hypot(number(theirs, error));
            assert!(z.abs() < 4.5, "{name}, {figure}: z {z}");
        }
    }
}

/// The Python client sees both models; emcee samples the posterior to the same moments.
const CLIENT: &str = r#"
import json, sys
import numpy as np, umbridge, emcee
url = sys.argv[1]
posterior, forward = umbridge.HTTPModel(url, "posterior"), umbridge.HTTPModel(url, "forward")
start = np.array([162, 7.58, 0.34, 4.41, 10.0])
field = np.array(forward([[162, 7.58, 0.34, 4.41, 0.5, -0.5]])[0])
plain = np.array(forward([[162, 7.58, 0.34, 4.41, 0, 0]])[0])
rng = np.random.default_rng(1)
size = np.array([0.5, 0.05, 0.003, 0.03, 0.3])
sampler = emcee.EnsembleSampler(20, 5, lambda x: posterior([list(x)])[0][0])
sampler.random_state = np.random.RandomState(1).get_state()
state = sampler.run_mcmc(start + size * rng.normal(size=(20, 5)), 200)
sampler.reset()
sampler.run_mcmc(state, 900)
chain = sampler.get_chain()
tau = sampler.get_autocorr_time(quiet=True)
error = chain.std((0, 1)) * np.sqrt(tau / (chain.shape[0] * chain.shape[1]))
print(json.dumps({"sizes": [posterior.get_input_sizes(), forward.get_output_sizes(), len(field)], "shift": (field - plain).tolist(),
    "outside": posterior([[-1, 7.58, 0.34, 4.41, 10.0]])[0][0], "mean": chain.mean((0, 1)).tolist(), "error": error.tolist()}))
"#;

#[test]
#[ignore = "needs Python"]
fn python_samples_a_served_posterior() {
    let alone = fresh("alone");
    let end = plychain(&[
        "identify",
        sheet(),
        "--quiet",
        "--out",
        alone.to_str().unwrap(),
        "--min-ess",
        "1000",
    ]);
    assert!(end.status.success(), "{end:?}");
    let served = Served::start(0);
    let end = python().args(["-c", CLIENT, &served.url]).output().unwrap();
    assert!(end.status.success(), "{end:?}");
    let theirs: Value = serde_json::from_slice(&end.stdout).unwrap();
    let points = theirs["sizes"][2].as_u64().unwrap() as usize;
    assert_eq!(theirs["sizes"], json!([[5], [points], points]));
    // a translation by 0.5 um along x and -0.5 um along y, which is direction 1
    for (k, shift) in theirs["shift"].as_array().unwrap().iter().enumerate() {
        let exact = if k < points / 2 { -5e-4 } else { 5e-4 };
        assert!(
            (shift.as_f64().unwrap() - exact).abs() < 1e-12,
            "{k}: {shift}"
        );
    }
    assert_eq!(theirs["outside"].as_f64(), Some(f64::MIN));
    let text = plychain(&["diagnose", alone.to_str().unwrap(), "--json"]).stdout;
    let ours: Value = serde_json::from_slice(&text).unwrap();
    for (k, (name, own)) in ours["parameters"].as_object().unwrap().iter().enumerate() {
        let number = |of: &Value| of.as_f64().unwrap();
        let error = number(&own["mcse_mean"]).hypot(number(&theirs["error"][k]));
        let z = (number(&own["mean"]) - number(&theirs["mean"][k])) / error;
        assert!(z.abs() < 4.5, "{name}: z {z}");
    }
}

/// A client in Python samples what a server in Python computes.
const SERVER: &str = r#"
import sys, umbridge
class Normal(umbridge.Model):
    def __init__(self): super().__init__("normal")
    def get_input_sizes(self, config): return [2]
    def get_output_sizes(self, config): return [1]
    def __call__(self, parameters, config):
        a, b = parameters[0]
        if a < 0: return [[float("-inf")]]
        return [[-0.5 * (a**2 + (b - config["shift"])**2 / 4)]]
    def supports_evaluate(self): return True
umbridge.serve_models([Normal()], int(sys.argv[1]))
"#;

#[test]
#[ignore = "needs Python"]
fn a_server_in_python_is_sampled() {
    let free = BoundServer::new(0).unwrap().url;
    let port = free.rsplit(':').next().unwrap();
    let server = python()
        .args(["-c", SERVER, port])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let _server = Served {
        child: server,
        url: free.clone(),
        said: String::new(),
    };
    let out = fresh("python");
    let arguments = format!(
        "sample --url {free} --model normal --box a=0:1,b=2:4 --config {{\"shift\":3}} --out {} --walkers 16 --ensembles 2 --min-ess 300 --quiet",
        out.display()
    );
    let end = plychain(&arguments.split(' ').collect::<Vec<_>>());
    assert!(end.status.success(), "{end:?}");
    let text = plychain(&["diagnose", out.to_str().unwrap(), "--json"]).stdout;
    let found: Value = serde_json::from_slice(&text).unwrap();
    for (name, mean) in [("a", (2.0 / std::f64::consts::PI).sqrt()), ("b", 3.0)] {
        let figures = &found["parameters"][name];
        let z = (figures["mean"].as_f64().unwrap() - mean) / figures["mcse_mean"].as_f64().unwrap();
        assert!(z.abs() < 4.5, "{name}: z {z}");
    }
}
