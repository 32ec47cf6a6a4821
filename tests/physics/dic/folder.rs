//! A simulated series as a user would have it: one table a frame, and model files of the whole series and of its last step alone.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::causes::TrueEffect;
use super::series::{Observed, Series};
use super::subsets::{Cut, Shape};

/// What a series was made with and an analysis should find.
#[derive(Debug, Clone)]
pub struct Truth {
    pub name: String,
    /// Constants by name, border units.
    pub constants: Vec<(&'static str, f64)>,
    pub thickness_mm: f64,
    /// Declared over true force, less 1.
    pub load_error: f64,
    pub effects: Vec<TrueEffect>,
}

/// Names of the model files, and of what no analysis may read.
pub const SERIES: &str = "model.json";
pub const SINGLE: &str = "single.json";
const TRUTH: &str = "truth.json";

impl Truth {
    fn json(&self) -> Value {
        let object = |pairs: &[(&'static str, f64)]| -> Value {
            let pairs = pairs
                .iter()
                .map(|(name, x)| ((*name).to_string(), json!(x)));
            Value::Object(pairs.collect())
        };
        let effect = |e: &TrueEffect| json!({"name": e.name, "law": e.law, "amplitudes": object(&e.amplitudes)});
        json!({
            "name": self.name,
            "constants": object(&self.constants),
            "thickness_mm": self.thickness_mm,
            "declared_over_true_force_minus_1": self.load_error,
            "effects": self.effects.iter().map(effect).collect::<Vec<_>>(),
        })
    }
}

impl Series {
    /// The file of a frame.
    pub fn file(&self, frame: usize) -> String {
        if self.forces_n[frame] > 0.0 {
            format!("step-{:02}.csv", frame + 1)
        } else if self.forces_n.iter().filter(|f| **f == 0.0).count() == 1 {
            "unloaded.csv".into()
        } else {
            format!("unloaded-{:02}.csv", frame + 1)
        }
    }

    /// The last frame under load.
    pub fn last_loaded(&self) -> usize {
        let last = self.forces_n.iter().rposition(|f| *f > 0.0);
        last.expect("a loaded frame")
    }

    pub fn true_values(&self) -> Truth {
        let names = self.specimen.priors.iter().map(|(name, _)| *name);
        Truth {
            name: self.name.clone(),
            constants: names.zip(self.constants.iter().copied()).collect(),
            thickness_mm: self.thickness_mm,
            load_error: self.load_error,
            effects: self.truth(),
        }
    }

    /// Write tables and model files into a folder, which is made.
    pub fn write(&self, observed: &Observed, folder: &Path) -> Truth {
        fs::create_dir_all(folder).unwrap();
        for (k, frame) in observed.frames.iter().enumerate() {
            let mut text = String::from("x_mm,y_mm,u_mm,v_mm\n");
            for ([x, y], [u, v]) in observed.points.iter().zip(frame) {
                text += &format!("{x:.5},{y:.5},{u:.7},{v:.7}\n");
            }
            fs::write(folder.join(self.file(k)), text).unwrap();
        }
        let declared = self.declared_n();
        let mut series = self.model();
        let step = |k: usize| json!({"file": self.file(k), "force_N": declared[k]});
        series["experiments"][0]["steps"] = (0..declared.len()).map(step).collect();
        let mut single = self.model();
        let last = self.last_loaded();
        single["experiments"][0]["load"] = json!({"force_N": declared[last]});
        single["experiments"][0]["measurement"]["file"] = self.file(last).into();
        let truth = self.true_values();
        for (name, value) in [(SERIES, series), (SINGLE, single), (TRUTH, truth.json())] {
            let text = serde_json::to_string_pretty(&value).unwrap();
            fs::write(folder.join(name), text).unwrap();
        }
        truth
    }

    /// What both model files say.
    fn model(&self) -> Value {
        let prior = |(name, [mean, sd]): &(&str, [f64; 2])| {
            let prior = json!({"prior": {"normal": {"mean": mean, "sd": sd}}});
            ((*name).to_string(), prior)
        };
        let parameters: serde_json::Map<String, Value> =
            self.specimen.priors.iter().map(prior).collect();
        let kind = if self.specimen.is_laminate() {
            "ply"
        } else {
            "isotropic"
        };
        json!({
            "schema": "plychain-model/2",
            "name": self.name,
            "material": {
                "kind": kind,
                "parameters": parameters,
                "expansion_per_K": self.specimen.expansion_per_k,
            },
            "experiments": [{
                "name": "tension",
                "kind": "field",
                "specimen": self.specimen.json(),
                "gauge": "window",
                "measurement": {
                    "format": "csv",
                    "columns": {"x": "x_mm", "y": "y_mm", "ux": "u_mm", "uy": "v_mm"},
                    "units": {"coordinates": "mm", "displacements": "mm"},
                    "loading_axis": "y",
                    "hole_center_in_data_mm": [0.0, 0.0],
                    "image_correlation": self.correlation(),
                },
                "effects": ["rigid_translation", "rigid_rotation"],
            }],
            "reduced_model": {"snapshots": 200, "modes": 4, "degree": 3},
            "likelihood": {"model_error_fraction": 0.0},
        })
    }

    fn correlation(&self) -> Value {
        let rounded = |mm: f64| (mm * 1e6).round() / 1e6;
        let shape = match self.layout.shape {
            Shape::Constant => "full",
            Shape::Affine => "affine",
            Shape::Quadratic => "quadratic",
        };
        let mut correlation = json!({
            "subset_mm": rounded(self.layout.subset_mm()),
            "step_mm": rounded(self.layout.step_mm()),
            "pixel_mm": self.layout.pixel_mm,
            "shape": shape,
            "camera_distance_mm": self.declared_distance_mm,
        });
        if self.layout.cut == Cut::Kept {
            correlation["partial_subsets"] = "kept".into();
        }
        correlation
    }
}
