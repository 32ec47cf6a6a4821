//! Figures: each is drawn from the report and from tables that lie beside it as CSV.

mod bars;
mod canvas;
mod cells;
mod chains;
mod colour;
mod corner;
pub mod data;
mod gather;
mod maps;
mod mesh;
mod pictures;
#[cfg(feature = "png")]
mod raster;
mod steps;

pub use bars::SMALLEST_BAR;
pub use canvas::{Figure, span};
pub use cells::FieldCells;
pub use colour::Palette;
pub use corner::{MOST as AXES, corner as posterior_corner};
pub use data::FigureData;
pub use maps::Scale;
pub use mesh::{lines as mesh_lines, mesh as mesh_figure, on_mesh};
pub use pictures::Picture;
#[cfg(feature = "png")]
pub use raster::png;

use super::page::{Page, places};
use crate::error::Result;
use data::MapCell;
use maps::Mapped;

/// Without the feature `png` there is nothing to draw one with.
///
/// # Errors
/// Always.
#[cfg(not(feature = "png"))]
pub fn png(figure: &Figure) -> Result<Vec<u8>> {
    let place = format!("figure {}", figure.name);
    Err(crate::error::Error::program(place, "the feature `png`"))
}

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
pub fn all(page: &Page) -> Result<Figures> {
    let mut figures = Figures {
        panels: Vec::new(),
        closer: Vec::new(),
        others: Vec::new(),
        papers: Vec::new(),
    };
    draw_maps(page, &mut figures)?;
    let mut others = vec![
        bars::intervals(&page.intervals())?,
        bars::blind_spots(page.report.blind_spots(), &page.constants())?,
        page.figures
            .first()
            .map_or(Ok(None), |data| mesh::mesh(&data.mesh))?,
        page.figures
            .last()
            .map_or(Ok(None), |data| steps::steps(&data.steps))?,
        page.figures
            .last()
            .map_or(Ok(None), |data| steps::stiffness(&data.stiffness))?,
    ];
    for (k, (round, data)) in page.report.rounds.iter().zip(&page.figures).enumerate() {
        let residual = &round.residual;
        let candidates = round.tracing.as_ref();
        let drawn = [
            ("corner", corner::corner(data)?),
            ("trace", chains::traces(&data.trace)?),
            ("rank", chains::ranks(&data.rank)?),
            (
                "autocorrelation",
                chains::autocorrelation(&data.autocorrelation)?,
            ),
            ("variogram", chains::variogram(&residual.variogram)?),
            ("breakdown", bars::breakdown(&places(residual))?),
            ("candidates", candidates.map_or(Ok(None), bars::ranking)?),
        ];
        others.extend(drawn.into_iter().map(|(name, figure)| {
            let name = format!("{name}-{k}");
            figure.map(|f| Figure { name, ..f })
        }));
    }
    let quoted = corner::corner(&page.quoted)?;
    others.push(quoted.map(|f| Figure {
        name: "corner-averaged".into(),
        ..f
    }));
    figures.others = others.into_iter().flatten().collect();
    Ok(figures)
}

fn draw_maps(page: &Page, figures: &mut Figures) -> Result<()> {
    let fields = page.figures.iter().map(|f| &f.maps[..]);
    let placed = |m: &&[MapCell]| {
        m.iter().any(|c| c.x_mm.is_finite()) && m.iter().any(|c| c.y_mm.is_finite())
    };
    let fields: Vec<&[MapCell]> = fields.filter(placed).collect();
    let residual = maps::residual_scale(&fields);
    for (k, field) in fields.iter().enumerate() {
        let mut panels = Vec::new();
        for component in [1, 2] {
            let scales = [maps::field_scale(field, component), residual];
            for what in Mapped::ALL {
                let name = format!("map-{k}-u{component}-{}", what.name());
                panels.push(maps::one(field, component, what, scales, &name)?);
            }
            let name = format!("maps-{k}-u{component}");
            let alt = format!(
                "Maps of u{component} in round {k}: measured, predicted, and residual on the scale that all rounds share"
            );
            let paper = maps::side_by_side(field, component, scales, &name, &alt)?;
            figures.papers.push(paper);
        }
        figures.panels.push(panels);
    }
    let Some(last) = fields.last().filter(|_| fields.len() > 1) else {
        return Ok(());
    };
    let own = maps::residual_scale(&[last]);
    if own.range[1] < FAINT * residual.range[1] {
        for component in [1, 2] {
            let name = format!("map-{}-u{component}-residual-closer", fields.len() - 1);
            let scales = [own, own];
            let closer = maps::one(last, component, Mapped::Residual, scales, &name)?;
            figures.closer.push(closer);
        }
    }
    Ok(())
}
