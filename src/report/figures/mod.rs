//! Figures: each is drawn from sheets, and its sheets lie beside it as CSV.

mod bars;
mod canvas;
mod chains;
mod colour;
mod corner;
mod maps;
mod raster;

pub use bars::SMALLEST_BAR;
pub use canvas::Figure;
pub use colour::Palette;
pub use raster::png;

use super::page::Page;
use super::sheet::Sheet;
use crate::error::Result;
use corner::Corner;

/// Figures of the whole run that a page shows, by their place in it.
pub struct Figures {
    /// The maps of each round: measured, predicted, residual of u1, then of u2.
    pub panels: Vec<Vec<Figure>>,
    /// Residuals of the last round on a scale of their own, where the common one hides them.
    pub closer: Vec<Figure>,
    /// All other figures, by name.
    pub others: Vec<Figure>,
    /// Figures made for papers only: maps side by side.
    pub papers: Vec<Figure>,
}

impl Figures {
    /// The figure called `name`.
    pub fn get(&self, name: &str) -> Option<&Figure> {
        self.others.iter().find(|f| f.name == name)
    }

    /// Those that go to `figures/`.
    pub fn files(&self) -> impl Iterator<Item = &Figure> {
        self.papers.iter().chain(&self.others)
    }
}

/// Below this share of the common residual scale a round's residual is shown on its own scale as well.
const FAINT: f64 = 0.5;

/// Draw all figures of a page.
///
/// # Errors
/// The program's fault if the library cannot draw.
pub fn all(page: &Page) -> Result<Figures> {
    let mut figures = Figures {
        panels: Vec::new(),
        closer: Vec::new(),
        others: Vec::new(),
        papers: Vec::new(),
    };
    draw_maps(page, &mut figures)?;
    let empty = Sheet::new("", &[]);
    let sheet = |name: String| page.sheet(&name).unwrap_or(&empty);
    let mut others = vec![
        bars::intervals(sheet("intervals".into()), "intervals")?,
        bars::blind_spots(sheet("blind-spots".into()), "blind-spots")?,
    ];
    for k in 0..page.rounds().len() {
        let named = |what: &str| format!("{what}-{k}");
        let of = |what: &str| sheet(named(what));
        let sheets = Corner {
            parameters: of("parameters"),
            marginals: of("marginals"),
            joint: of("corner"),
        };
        others.push(corner::corner(&sheets, &named("corner"))?);
        others.push(chains::traces(of("trace"), &named("trace"))?);
        others.push(chains::ranks(of("rank"), &named("rank"))?);
        others.push(chains::autocorrelation(
            of("autocorrelation"),
            &named("autocorrelation"),
        )?);
        others.push(chains::variogram(of("variogram"), &named("variogram"))?);
        others.push(bars::breakdown(of("breakdown"), &named("breakdown"))?);
        others.push(bars::ranking(of("candidates"), &named("candidates"))?);
    }
    figures.others = others.into_iter().flatten().collect();
    Ok(figures)
}

fn draw_maps(page: &Page, figures: &mut Figures) -> Result<()> {
    let sheets: Vec<&Sheet> = (0..page.rounds().len())
        .filter_map(|k| page.sheet(&format!("maps-{k}")))
        .collect();
    let residual = maps::residual_scale(sheets.iter().copied());
    for (k, sheet) in sheets.iter().enumerate() {
        let mut panels = Vec::new();
        for component in [1, 2] {
            let field = maps::field_scale(sheet, component);
            for what in maps::WHAT {
                let scale = if what == "residual" { residual } else { field };
                let name = format!("map-{k}-u{component}-{what}");
                panels.extend(maps::one(sheet, component, what, scale, &name)?);
            }
            let name = format!("maps-{k}-u{component}");
            let alt = format!(
                "Maps of u{component} in round {k}: measured, predicted, and residual on the scale that all rounds share"
            );
            let both = [field, residual];
            figures
                .papers
                .extend(maps::side_by_side(sheet, component, both, &name, &alt)?);
        }
        figures.panels.push(panels);
    }
    let Some(last) = sheets.last().filter(|_| sheets.len() > 1) else {
        return Ok(());
    };
    let own = maps::residual_scale(std::iter::once(*last));
    if own.range[1] < FAINT * residual.range[1] {
        for component in [1, 2] {
            let name = format!("map-{}-u{component}-residual-closer", sheets.len() - 1);
            figures
                .closer
                .extend(maps::one(last, component, "residual", own, &name)?);
        }
    }
    Ok(())
}
