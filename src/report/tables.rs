//! The error tables of a reduced model, in the article's order, and beside the article's own figures.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::terminal::table;
use crate::fem::Certificate;
use crate::fem::verify::{Bound, Check};
use crate::quantity::NM_PER_MM;
use crate::reduce::{Published, Quality, ReducedModel, Reference, Surface, TRUNCATIONS};

/// What the columns of Tables 9 and 10 are called, in `reduced_model.json` and on the terminal.
const MEASURES: [&str; 5] = ["mean_mm", "sd_mm", "r2", "rms_mm", "press_mm"];

/// Names of the displacement components, as the article has them.
pub const COMPONENTS: [&str; 2] = ["U", "V"];

fn measures(q: &Quality) -> [f64; 5] {
    [q.mean, q.sd, q.r2, q.rms, q.press]
}

/// The tables of a reduced model.
pub fn numbers(reduced: &ReducedModel) -> Value {
    let by_component = |values: &dyn Fn(usize) -> Value| -> Map<String, Value> {
        let names = COMPONENTS.iter().enumerate();
        names.map(|(c, name)| ((*name).into(), values(c))).collect()
    };
    json!({
        "snapshots": reduced.snapshots,
        "elements": reduced.mesh_size[0],
        "unknowns": reduced.mesh_size[1],
        "nodes_in_window": reduced.points(),
        "modes": reduced.modes_per_component(),
        "doe": reduced.sides(),
        "table_3_truncation_error_K_1_up": by_component(&|c| json!(reduced.truncation[c])),
        "table_8_cv_rms_mm_K_1_up": by_component(&|c| json!(reduced.cross_validation[c].mm)),
        "table_8_cv_rms_percent_K_1_up": by_component(&|c| json!(reduced.cross_validation[c].percent)),
        "surface_kept": surface_numbers(&reduced.surface),
        "tables_9_10_plain_surface": surface_numbers(&reduced.plain),
    })
}

/// The coefficients of a surface by name (U1, U2, ..., V1, V2, ...), with the errors of each.
pub fn coefficients(surface: &Surface) -> impl Iterator<Item = (String, &Quality)> {
    let half = surface.quality.len() / 2;
    let name = move |k: usize| format!("{}{}", COMPONENTS[usize::from(k >= half)], k % half + 1);
    let numbered = surface.quality.iter().enumerate();
    numbered.map(move |(k, q)| (name(k), q))
}

fn surface_numbers(surface: &Surface) -> Value {
    let rows = coefficients(surface).map(|(name, q)| {
        let values = MEASURES.iter().zip(measures(q));
        let row: Map<_, _> = values.map(|(m, v)| ((*m).to_string(), json!(v))).collect();
        (name, Value::Object(row))
    });
    json!({
        "variables": surface.variables.choice,
        "monomials": surface.exponents.len(),
        "held_out_mm": surface.held_out(),
        "coefficients": rows.collect::<Map<_, _>>(),
    })
}

/// The tables on the terminal.
pub fn text(reduced: &ReducedModel) -> String {
    let [elements, unknowns] = reduced.mesh_size;
    let mesh = match elements {
        0 => String::new(),
        _ => format!(" of {elements} quadratic elements, {unknowns} unknowns"),
    };
    let mut text = format!(
        "\n{} snapshots{mesh}; {} modes kept\n\nDoE box\n\n",
        reduced.snapshots,
        reduced.modes_per_component()
    );
    let rows = reduced.dimensions.iter().map(|d| {
        vec![
            d.name.clone(),
            format!("{:.6}", d.low),
            format!("{:.6}", d.high),
        ]
    });
    text += &table(&["", "low", "high"], rows);
    text += "\ntruncation error eps (Table 3) and leave-one-out CV_RMS (Table 8)\n\n";
    text += &truncations(reduced);
    for (name, surface) in [
        ("kept", &reduced.surface),
        (
            "in the parameters as they are, for comparison",
            &reduced.plain,
        ),
    ] {
        let _ = write!(
            text,
            "\nresponse surfaces {name}: {:?} variables, {} monomials, held-out error {:.2e} mm (Tables 9 and 10)\n\n{}",
            surface.variables.choice,
            surface.exponents.len(),
            surface.held_out(),
            surfaces(surface)
        );
    }
    text
}

fn truncations(reduced: &ReducedModel) -> String {
    let most = reduced.truncation[0].len();
    let rows = (1..most).map(|k| {
        let mut row = vec![(k + 1).to_string()];
        for c in 0..2 {
            let cross = &reduced.cross_validation[c];
            let or_dash = |v: Option<&f64>| v.map_or("-".into(), |v| format!("{v:.3e}"));
            row.push(format!("{:.3e}", reduced.truncation[c][k]));
            row.push(or_dash(cross.mm.get(k)));
            row.push(or_dash(cross.percent.get(k)));
        }
        row
    });
    let header = [
        "K", "eps U", "CV U mm", "CV U %", "eps V", "CV V mm", "CV V %",
    ];
    table(&header, rows)
}

fn surfaces(surface: &Surface) -> String {
    let row = |(name, q): (String, &Quality)| {
        vec![
            name,
            format!("{:.3e}", q.mean),
            format!("{:.3e}", q.sd),
            format!("{:.9}", q.r2),
            format!("{:.2e}", q.rms),
            format!("{:.2e}", q.press),
        ]
    };
    let rows = coefficients(surface).map(row);
    table(&["", "mean mm", "sd mm", "R^2", "RMS mm", "PRESS mm"], rows)
}

/// One figure beside the published one.
struct ComparedFigure {
    table: u8,
    component: usize,
    /// K, or the number of the coefficient.
    index: usize,
    measure: &'static str,
    here: f64,
    published: f64,
}

impl ComparedFigure {
    /// Here over published, in size: the sign of a mode is arbitrary.
    fn ratio(&self) -> f64 {
        (self.here / self.published).abs()
    }
}

/// Every published figure with its counterpart in `built`, a reduced model of [`Reference::problem`].
fn pairs(built: &ReducedModel, published: &Published) -> Vec<ComparedFigure> {
    let mut pairs = Vec::new();
    for component in 0..2 {
        let cross = &built.cross_validation[component];
        let series = [
            (
                3,
                "eps",
                &built.truncation[component],
                &published.truncation[component],
            ),
            (8, "cv_rms_mm", &cross.mm, &published.cv_mm[component]),
            (
                8,
                "cv_rms_percent",
                &cross.percent,
                &published.cv_percent[component],
            ),
        ];
        for (table, measure, here, there) in series {
            pairs.extend(
                TRUNCATIONS
                    .iter()
                    .zip(there)
                    .map(|(&k, &published)| ComparedFigure {
                        table,
                        component,
                        index: k,
                        measure,
                        here: here.get(k - 1).copied().unwrap_or(f64::NAN),
                        published,
                    }),
            );
        }
        let half = built.plain.quality.len() / 2;
        let qualities = &built.plain.quality[component * half..(component + 1) * half];
        for (k, (q, there)) in qualities
            .iter()
            .zip(&published.surfaces[component])
            .enumerate()
        {
            for (m, &measure) in MEASURES.iter().enumerate() {
                pairs.push(ComparedFigure {
                    table: 9 + component as u8,
                    component,
                    index: k + 1,
                    measure,
                    here: measures(q)[m],
                    published: there[m],
                });
            }
        }
    }
    pairs
}

/// Factor that takes POD coefficients from this model's number of nodes to the published one's.
fn node_factor(built: &ReducedModel, published: &Published) -> f64 {
    (published.nodes as f64 / built.points() as f64).sqrt()
}

/// Figures here beside those published, with their ratio.
pub fn comparison_numbers(reference: Reference, built: &ReducedModel) -> Value {
    let published = reference.published();
    let mut tables: Map<String, Value> = Map::new();
    for pair in pairs(built, published) {
        let row = json!({
            "component": COMPONENTS[pair.component], "index": pair.index, "measure": pair.measure,
            "here": pair.here, "published": pair.published, "ratio": pair.ratio(),
        });
        let rows = tables
            .entry(format!("table_{}", pair.table))
            .or_insert_with(|| json!([]));
        if let Value::Array(rows) = rows {
            rows.push(row);
        }
    }
    json!({
        "reference": reference,
        "nodes": { "here": built.points(), "published": published.nodes },
        "node_factor": node_factor(built, published),
        "tables": tables,
        "remarks": REMARKS,
        "model": numbers(built),
    })
}

/// Where and why the figures differ.
const REMARKS: &[&str] = &[
    "Figures without a unit of length (eps, R^2, sd/mean of the first coefficients) agree: box, layup and method are the article's.",
    "A node's displacement is 2.2 to 2.3 times larger there (first means over the square roots of the numbers of nodes; CV_RMS in mm says the same): 700 N on the assumed plate (200 x 25 mm, 4 mm hole) with the window's rigid motion removed is not what Tables 8 to 10 were made for. Displacements counted from a corner of the window would double them; the plate's drawing and gauge are not available.",
    "Means of the coefficients 2 to 4 are differences of nearly equal terms and belong to one design: a fourth mean lies within its sampling error sd/sqrt(200) of zero.",
    "PRESS of V2, 3.05e-6 mm there, cannot be right: it is never below RMS sqrt((n - m)/n) = 0.85 x 2.26e-5 mm. 3.05e-5 mm would fit the other seven, whose PRESS is 1.25 to 1.55 times their RMS.",
    "CV_RMS of V at K = 3, 4.71e-2 %, does not fit its 6.30e-7 mm: it implies a field of 1.3e-3 mm, where K = 2 and 4 imply 8 to 9e-3 mm.",
];

/// The same on the terminal.
pub fn comparison_text(reference: Reference, built: &ReducedModel) -> String {
    let published = reference.published();
    let pairs = pairs(built, published);
    let mut text = format!(
        "\nGogu et al. 2013, Tables 3, 8, 9 and 10, in the article's box (Table 2): here / published = ratio\n{} nodes here, {} there: POD coefficients grow with the square root, so the ratios of their figures are to be multiplied by {:.3}\n\n",
        built.points(),
        published.nodes,
        node_factor(built, published)
    );
    let cells = |pick: &dyn Fn(&&ComparedFigure) -> bool| -> Vec<String> {
        let picked = pairs.iter().filter(pick);
        picked
            .map(|p| match p.measure {
                "r2" => format!("{:.5} / {:.5}", p.here, p.published),
                _ => format!("{:.2e} / {:.2e} = {:.2}", p.here, p.published, p.ratio()),
            })
            .collect()
    };
    let mut rows = Vec::new();
    for measure in ["eps", "cv_rms_mm", "cv_rms_percent"] {
        for (c, component) in COMPONENTS.iter().enumerate() {
            let mut row = vec![format!("{measure} {component}")];
            row.extend(cells(&|p| p.measure == measure && p.component == c));
            rows.push(row);
        }
    }
    text += &table(
        &["Tables 3 and 8", "K = 2", "K = 3", "K = 4", "K = 5"],
        rows,
    );
    for (c, component) in COMPONENTS.iter().enumerate() {
        let rows = MEASURES.iter().map(|&measure| {
            let mut row = vec![measure.to_string()];
            row.extend(cells(&|p| p.measure == measure && p.component == c));
            row
        });
        let header: Vec<String> = (1..=4).map(|k| format!("{component}{k}")).collect();
        let name = format!("Table {}", 9 + c);
        let header: Vec<&str> = std::iter::once(name.as_str())
            .chain(header.iter().map(String::as_str))
            .collect();
        text += &format!("\n{}", table(&header, rows));
    }
    for remark in REMARKS {
        let _ = write!(text, "\n{remark}");
    }
    text + "\n"
}

/// Verification figures of the finite elements, each with what it is held against.
/// A reduced basis beside the solver.
pub fn basis_text(certificates: &[Certificate]) -> String {
    let Some(first) = certificates.first() else {
        return "\nno reduced basis: every prediction is solved\n".into();
    };
    let largest = |of: fn(&Certificate) -> f64| certificates.iter().map(of).fold(0.0, f64::max);
    let mean = |of: fn(&Certificate) -> f64| {
        certificates.iter().map(of).sum::<f64>() / certificates.len() as f64
    };
    format!(
        "\nreduced basis of the finite elements: {} solutions; at {} random points of the box its error is at most {:.1e} of the energy norm, its bound at most {:.1e}; at the measured points it is off by {:.1e} nm at most, by its bound {:.1e} nm; an answer takes {:.2} ms, a solution {:.1} ms\n",
        first.solutions,
        certificates.len(),
        largest(|c| c.error),
        largest(|c| c.bound),
        NM_PER_MM * largest(|c| c.largest_mm),
        NM_PER_MM * largest(|c| c.bound_mm),
        1e3 * mean(|c| c.answer_s),
        1e3 * mean(|c| c.solve_s),
    )
}

/// [`basis_text`] as JSON.
pub fn basis_numbers(certificates: &[Certificate]) -> Value {
    let one = |c: &Certificate| json!({ "solutions": c.solutions, "bound": c.bound, "error": c.error, "largest_nm": NM_PER_MM * c.largest_mm, "bound_nm": NM_PER_MM * c.bound_mm, "effectivity": c.effectivity() });
    certificates.iter().map(one).collect()
}

pub fn verification_text(checks: &[Check]) -> String {
    let rows = checks.iter().map(|check| {
        let bound = match check.bound {
            Bound::AtMost(most) => format!("<= {most:.3e}"),
            Bound::AtLeast(least) => format!(">= {least}"),
        };
        let passed = if check.passed { "yes" } else { "NO" };
        vec![
            check.what.clone(),
            format!("{:.3e}", check.value),
            bound,
            passed.into(),
        ]
    });
    format!(
        "\nverification of the finite elements\n\n{}",
        table(&["", "value", "bound", "passed"], rows)
    )
}

/// [`verification_text`] as JSON.
pub fn verification_numbers(checks: &[Check]) -> Value {
    checks
        .iter()
        .map(|check| {
            let (kind, bound) = match check.bound {
                Bound::AtMost(most) => ("at_most", most),
                Bound::AtLeast(least) => ("at_least", least),
            };
            json!({ "what": check.what, "value": check.value, kind: bound, "passed": check.passed })
        })
        .collect()
}
