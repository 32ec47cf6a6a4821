//! The error tables of a reduced model, in the article's order.

use serde_json::{Map, Value, json};

use crate::fem::Certificate;
use crate::quantity::NM_PER_MM;
use crate::reduce::{Quality, ReducedModel, Surface};
use crate::section::{Section, Table, TableCell, row};

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
        "surface_kept": surface_numbers(&reduced.surface),
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

/// The box, and the errors of modes and surfaces.
pub fn sections(reduced: &ReducedModel) -> Vec<Section> {
    let [elements, unknowns] = reduced.mesh_size;
    let mesh = match elements {
        0 => String::new(),
        _ => format!(" of {elements} quadratic elements, {unknowns} unknowns"),
    };
    let title = format!(
        "{} snapshots{mesh}; {} modes kept",
        reduced.snapshots,
        reduced.modes_per_component()
    );
    let sides = reduced.dimensions.iter().map(|d| {
        let ends = [d.low, d.high].map(|v| TableCell::fixed(v, 6));
        row(&d.name, ends)
    });
    let sides = Table::new("DoE box", ["", "low", "high"], sides);
    let surface = &reduced.surface;
    let caption = format!(
        "response surfaces kept: {:?} variables, {} monomials, held-out error {:.2e} mm (Tables 9 and 10)",
        surface.variables.choice,
        surface.exponents.len(),
        surface.held_out()
    );
    let rows = coefficients(surface).map(|(name, q)| surface_row(name, q));
    let section = Section::new(title).with(sides).with(truncations(reduced));
    vec![section.with(Table::new(caption, SURFACE, rows))]
}

/// Columns of the errors of response surfaces.
const SURFACE: [&str; 6] = [
    "coefficient",
    "mean mm",
    "sd mm",
    "R^2",
    "RMS mm",
    "PRESS mm",
];

fn surface_row(coefficient: String, q: &Quality) -> Vec<TableCell> {
    let cells = [
        TableCell::science(q.mean, 3),
        TableCell::science(q.sd, 3),
        TableCell::fixed(q.r2, 9),
        TableCell::science(q.rms, 2),
        TableCell::science(q.press, 2),
    ];
    row(coefficient, cells)
}

fn truncations(reduced: &ReducedModel) -> Table {
    let most = reduced.truncation[0].len();
    let rows = (1..most).map(|k| {
        let errors = reduced.truncation.iter();
        let errors = errors.map(|eps| TableCell::science(eps.get(k).copied(), 3));
        row((k + 1).to_string(), errors)
    });
    let caption = "truncation error eps (Table 3)";
    Table::new(caption, ["K", "eps U", "eps V"], rows)
}

/// A reduced basis beside the solver.
pub fn basis_section(certificates: &[Certificate]) -> Section {
    let section = Section::default();
    let Some(first) = certificates.first() else {
        return section.say("no reduced basis: every prediction is solved");
    };
    let largest = |of: fn(&Certificate) -> f64| certificates.iter().map(of).fold(0.0, f64::max);
    let mean = |of: fn(&Certificate) -> f64| {
        certificates.iter().map(of).sum::<f64>() / certificates.len() as f64
    };
    section.say(format!(
        "The reduced basis of the finite elements has {} solutions. At {} random points of the box its error is at most {:.1e} of the energy norm, its bound at most {:.1e}. At the measured points it is off by {:.1e} nm at most, by its bound {:.1e} nm. An answer takes {:.2} ms, a solution {:.1} ms.",
        first.solutions,
        certificates.len(),
        largest(|c| c.error),
        largest(|c| c.bound),
        NM_PER_MM * largest(|c| c.largest_mm),
        NM_PER_MM * largest(|c| c.bound_mm),
        1e3 * mean(|c| c.answer_s),
        1e3 * mean(|c| c.solve_s),
    ))
}

/// [`basis_section`] as JSON.
pub fn basis_numbers(certificates: &[Certificate]) -> Value {
    let one = |c: &Certificate| json!({ "solutions": c.solutions, "bound": c.bound, "error": c.error, "largest_nm": NM_PER_MM * c.largest_mm, "bound_nm": NM_PER_MM * c.bound_mm, "effectivity": c.effectivity() });
    certificates.iter().map(one).collect()
}
