//! Models of this program for others, over HTTP on this machine alone.

use std::io::Read;

use serde_json::{Value, json};
use tiny_http::{Header, Method, Request, Response, Server};

use super::{OUTSIDE, VERSION};
use crate::error::{Error, Result};

/// What a model gives for a point, or why it gives nothing.
pub type ModelAnswer = std::result::Result<Vec<f64>, String>;

/// How a model answers a point.
pub type Evaluate<'a> = Box<dyn Fn(&[f64]) -> ModelAnswer + Sync + 'a>;

/// A model that is served: from one list of numbers to one.
pub struct HostedModel<'a> {
    /// What it is asked for by.
    pub name: &'static str,
    pub inputs: usize,
    pub outputs: usize,
    pub evaluate: Evaluate<'a>,
}

/// A port that is held, and not served yet.
pub struct BoundServer {
    server: Server,
    /// Where it is reached.
    pub url: String,
}

impl BoundServer {
    /// Hold a port of this machine; 0 takes a free one.
    ///
    /// # Errors
    /// The input's fault: a port that another program has.
    pub fn new(port: u16) -> Result<Self> {
        let failed = |found: String| Error::input("--port", "a port that is free").found(found);
        let server =
            Server::http(("127.0.0.1", port)).map_err(|e| failed(format!("{port}: {e}")))?;
        let address = server.server_addr().to_ip();
        let address = address.ok_or_else(|| failed("no address".into()))?;
        Ok(Self {
            server,
            url: format!("http://{address}"),
        })
    }
}

/// Most bytes of a request.
const MOST: u64 = 1 << 26;

/// Answer requests, `workers` at a time, for ever.
///
/// # Errors
/// Of the program: a socket that is gone.
pub fn serve(bound: &BoundServer, models: &[HostedModel<'_>], workers: usize) -> Result<()> {
    let work = || -> std::io::Result<()> {
        loop {
            let mut request = bound.server.recv()?;
            let (status, body) = answer(&mut request, models);
            let json = Header::from_bytes("Content-Type", "application/json");
            let mut response = Response::from_string(body.to_string()).with_status_code(status);
            json.into_iter().for_each(|h| response.add_header(h));
            // who asked may be gone
            let _ = request.respond(response);
        }
    };
    std::thread::scope(|scope| {
        let all: Vec<_> = (0..workers.max(1)).map(|_| scope.spawn(work)).collect();
        for worker in all {
            if let Ok(Err(error)) = worker.join() {
                return Err(Error::program("serve", "a socket to listen on").found(error));
            }
        }
        Ok(())
    })
}

fn refuse(status: u16, kind: &str, message: impl Into<String>) -> (u16, Value) {
    let message: String = message.into();
    (
        status,
        json!({ "error": { "type": kind, "message": message } }),
    )
}

fn answer(request: &mut Request, models: &[HostedModel<'_>]) -> (u16, Value) {
    let path = request.url().split('?').next().unwrap_or_default();
    let path = path.trim_start_matches('/').to_string();
    let names: Vec<&str> = models.iter().map(|m| m.name).collect();
    match (request.method(), &*path) {
        (_, "Info") => return (200, json!({ "protocolVersion": VERSION, "models": names })),
        (Method::Post, "ModelInfo" | "InputSizes" | "OutputSizes" | "Evaluate") => {}
        (_, "Gradient" | "ApplyJacobian" | "ApplyHessian") => {
            return refuse(400, "UnsupportedFeature", format!("no model has {path}"));
        }
        _ => return refuse(404, "InvalidInput", format!("there is nothing at /{path}")),
    }
    let mut text = String::new();
    let read = request.as_reader().take(MOST).read_to_string(&mut text);
    let body: Value = match read.map(|_| serde_json::from_str(&text)) {
        Ok(Ok(body)) => body,
        _ => return refuse(400, "InvalidInput", "the request is no JSON"),
    };
    let Some(model) = models.iter().find(|m| body["name"] == m.name) else {
        let known = format!("name: one of {}", names.join(", "));
        return refuse(400, "ModelNotFound", known);
    };
    match &*path {
        "ModelInfo" => {
            let support = json!({ "Evaluate": true, "Gradient": false, "ApplyJacobian": false, "ApplyHessian": false });
            (200, json!({ "support": support }))
        }
        "InputSizes" => (200, json!({ "inputSizes": [model.inputs] })),
        "OutputSizes" => (200, json!({ "outputSizes": [model.outputs] })),
        _ => evaluated(model, &body["input"]),
    }
}

fn evaluated(model: &HostedModel<'_>, input: &Value) -> (u16, Value) {
    let point: Option<Vec<f64>> = match input.as_array().map(Vec::as_slice) {
        Some([Value::Array(point)]) => point.iter().map(Value::as_f64).collect(),
        _ => None,
    };
    let Some(point) = point.filter(|p| p.len() == model.inputs) else {
        let expected = format!("input: one list of {} numbers", model.inputs);
        return refuse(400, "InvalidInput", expected);
    };
    match (model.evaluate)(&point) {
        Ok(output) => {
            let finite = |v: f64| if v == f64::NEG_INFINITY { OUTSIDE } else { v };
            let output: Vec<f64> = output.into_iter().map(finite).collect();
            (200, json!({ "output": [output] }))
        }
        Err(why) => refuse(500, "InvalidOutput", why),
    }
}
