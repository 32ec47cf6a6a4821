//! The log density of another program, over HTTP.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use ureq::Agent;

use super::OUTSIDE;
use crate::error::{Error, Result, locked};
use crate::sample::{DensityError, LogDensity};

/// How long a server is waited for.
#[derive(Debug, Clone, Copy)]
pub struct Patience {
    /// For one answer.
    pub answer: Duration,
    /// For a server that gives none: it is asked again and again for this long.
    pub silence: Duration,
    /// Requests at a time.
    pub requests: usize,
}

/// A prior on a parameter, as a function of its value; added to what the server gives.
type LogPrior<'a> = &'a (dyn Fn(&[f64]) -> f64 + Sync);

/// A log density that a server computes.
pub struct RemoteDensity<'a> {
    agent: Agent,
    url: String,
    model: String,
    config: Value,
    names: Vec<String>,
    patience: Patience,
    prior: LogPrior<'a>,
    open: Gate,
}

/// Lets so many through at a time.
struct Gate {
    free: Mutex<usize>,
    left: Condvar,
}

impl Gate {
    fn pass<T>(&self, act: impl FnOnce() -> T) -> T {
        let mut free = locked(&self.free);
        while *free == 0 {
            free = self.left.wait(free).unwrap_or_else(PoisonError::into_inner);
        }
        *free -= 1;
        drop(free);
        let done = act();
        *locked(&self.free) += 1;
        self.left.notify_one();
        done
    }
}

/// Why a request has no answer: it may help to ask again, or not.
enum Unanswered {
    Silent(String),
    Refused(String),
}

impl<'a> RemoteDensity<'a> {
    /// The log density of parameters `names` that the model of this name computes at `url`; `prior` is added to it.
    ///
    /// # Errors
    /// The input's fault: no server, no such model, a model of other inputs or outputs.
    pub fn connect(
        (url, model): (&str, &str),
        names: Vec<String>,
        config: Value,
        patience: Patience,
        prior: LogPrior<'a>,
    ) -> Result<Self> {
        let agent = Agent::config_builder()
            .http_status_as_error(false)
            .timeout_global(Some(patience.answer))
            .max_idle_connections_per_host(patience.requests)
            .max_idle_connections(patience.requests)
            .build();
        let remote = Self {
            agent: agent.into(),
            url: url.trim_end_matches('/').to_string(),
            model: model.to_string(),
            config,
            names,
            patience,
            prior,
            open: Gate {
                free: Mutex::new(patience.requests.max(1)),
                left: Condvar::new(),
            },
        };
        remote.check()?;
        Ok(remote)
    }

    /// The server has the model, and that is a log density of as many parameters.
    fn check(&self) -> Result<()> {
        let info = self.ask("Info", None)?;
        let models: Vec<&str> = match &info["models"] {
            Value::Array(all) => all.iter().filter_map(Value::as_str).collect(),
            _ => Vec::new(),
        };
        if !models.contains(&&*self.model) {
            let known = format!("one of the models of {}: {}", self.url, models.join(", "));
            return Err(Error::input("--model", known).found(&self.model));
        }
        let name = json!({ "name": self.model, "config": self.config });
        let inputs = self.ask("InputSizes", Some(&name))?["inputSizes"].clone();
        if inputs != json!([self.names.len()]) {
            let expected = format!("a model of one list of {} parameters", self.names.len());
            return Err(Error::input(&self.model, expected)
                .found(format!("inputs of the sizes {inputs}"))
                .hint("name the parameters in the order in which the model takes them"));
        }
        let outputs = self.ask("OutputSizes", Some(&name))?["outputSizes"].clone();
        if outputs != json!([1]) {
            return Err(
                Error::input(&self.model, "a log density, which is one number")
                    .found(format!("outputs of the sizes {outputs}")),
            );
        }
        Ok(())
    }

    /// What the server answers, asked again while it is silent.
    fn ask(&self, what: &str, body: Option<&Value>) -> Result<Value> {
        let began = Instant::now();
        let mut wait = Duration::from_millis(50);
        loop {
            let why = match self.open.pass(|| self.ask_once(what, body)) {
                Ok(answer) => return Ok(answer),
                Err(Unanswered::Refused(why)) => {
                    let place = format!("{}/{what}", self.url);
                    return Err(
                        Error::input(place, "an answer of the UM-Bridge protocol").found(why)
                    );
                }
                Err(Unanswered::Silent(why)) => why,
            };
            if began.elapsed() + wait > self.patience.silence {
                let seconds = self.patience.silence.as_secs_f64();
                return Err(Error::input(&self.url, "a server that answers")
                    .found(format!("{why}, for {seconds} s"))
                    .hint("start the server again; a run is gone on with by the same command with --out and --resume"));
            }
            std::thread::sleep(wait);
            wait = (2 * wait).min(Duration::from_secs(2));
        }
    }

    fn ask_once(&self, what: &str, body: Option<&Value>) -> std::result::Result<Value, Unanswered> {
        let url = format!("{}/{what}", self.url);
        let sent = match body {
            None => self.agent.get(url).call(),
            Some(body) => self
                .agent
                .post(url)
                .header("Content-Type", "application/json")
                .send(body.to_string()),
        };
        let silent = |e: ureq::Error| match e {
            ureq::Error::BadUri(_) | ureq::Error::Http(_) => Unanswered::Refused(e.to_string()),
            _ => Unanswered::Silent(e.to_string()),
        };
        let mut response = sent.map_err(silent)?;
        let status = response.status();
        let text = response.body_mut().read_to_string().map_err(silent)?;
        let answer = read(&text);
        if let Some(error) = answer.as_ref().and_then(|a| a.get("error")) {
            let words = |key: &str| error[key].as_str().unwrap_or_default().to_string();
            return Err(Unanswered::Refused(format!(
                "{}: {}",
                words("type"),
                words("message")
            )));
        }
        if status.is_server_error() {
            return Err(Unanswered::Silent(format!("status {status}")));
        }
        match answer {
            Some(answer) if status.is_success() => Ok(answer),
            Some(_) => Err(Unanswered::Refused(format!("status {status}"))),
            None => Err(Unanswered::Refused(format!("status {status}, no JSON"))),
        }
    }

    fn evaluate(&self, x: &[f64]) -> Result<f64> {
        let prior = (self.prior)(x);
        if prior == f64::NEG_INFINITY {
            return Ok(prior);
        }
        let body = json!({ "name": self.model, "input": [x], "config": self.config });
        let answer = self.ask("Evaluate", Some(&body))?;
        let value = match &answer["output"][0][0] {
            Value::Null if answer["output"][0].get(0).is_some() => Some(f64::NAN),
            value => value.as_f64(),
        };
        match value {
            Some(value) if value <= OUTSIDE => Ok(f64::NEG_INFINITY),
            Some(value) => Ok(value + prior),
            None => Err(Error::input(&self.model, "an output of one number").found(&answer)),
        }
    }
}

/// JSON with the numbers that Python writes and JSON does not have: `-Infinity`, `-inf`, `NaN`.
fn read(text: &str) -> Option<Value> {
    serde_json::from_str(text).ok().or_else(|| {
        let least = format!("{OUTSIDE:e}");
        let plain = text.replace("-Infinity", &least).replace("-inf", &least);
        let unknown = ["Infinity", "inf", "NaN", "nan"];
        let plain = unknown
            .iter()
            .fold(plain, |t, word| t.replace(word, "null"));
        serde_json::from_str(&plain).ok()
    })
}

impl LogDensity for RemoteDensity<'_> {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn log_density(&self, x: &[f64]) -> std::result::Result<f64, DensityError> {
        DensityError::sort(self.evaluate(x)?)
    }

    /// All points at once, as many requests at a time as are allowed.
    fn values(&self, xs: &[f64], out: &mut [f64]) -> Result<()> {
        let count = out.len();
        let next = AtomicUsize::new(0);
        let work = || {
            let mut done = Vec::new();
            loop {
                let i = next.fetch_add(1, Ordering::Relaxed);
                if i >= count {
                    return Ok(done);
                }
                let point: Vec<f64> = (0..self.dim()).map(|k| xs[k * count + i]).collect();
                match self.evaluate(&point) {
                    Ok(value) => done.push((i, value)),
                    Err(error) => {
                        // nobody begins another one
                        next.store(count, Ordering::Relaxed);
                        return Err(error);
                    }
                }
            }
        };
        std::thread::scope(|scope| {
            let workers = self.patience.requests.clamp(1, count.max(1));
            let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
            for worker in workers {
                let done: Result<Vec<(usize, f64)>> = worker
                    .join()
                    .unwrap_or_else(|_| Err(Error::program("bridge", "requests that end")));
                for (i, value) in done? {
                    out[i] = value;
                }
            }
            Ok(())
        })
    }
}
