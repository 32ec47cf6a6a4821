//! Figures: each is drawn from the report and from the numbers that lie beside it as JSON.

mod bars;
mod canvas;
mod chains;
mod colour;
mod corner;
mod maps;
mod mesh;
mod pictures;
mod steps;

pub use canvas::{Figure, span};
pub use colour::Palette;
pub use corner::corner as posterior_corner;
pub use maps::Scale;
pub use mesh::mesh as mesh_figure;
pub use pictures::PixelPicture;

use super::numbers::MapCell;
use super::page::Page;
use crate::error::Result;
use maps::Mapped;

/// Draw all figures of a page.
///
/// # Errors
/// The program's fault if one cannot be drawn.
pub fn all(page: &Page) -> Result<Vec<Figure>> {
    let mut figures = maps_of_rounds(page)?;
    let [first, last] = [page.figures.first(), page.figures.last()];
    let once = [
        bars::intervals(&page.intervals())?,
        first.map_or(Ok(None), |data| mesh::mesh(&data.mesh))?,
        last.map_or(Ok(None), |data| steps::steps(&data.steps))?,
        last.map_or(Ok(None), |data| steps::stiffness(&data.stiffness))?,
        corner::corner(&page.quoted)?.map(|f| f.called("corner-averaged")),
    ];
    figures.extend(once.into_iter().flatten());
    for (k, data) in page.figures.iter().enumerate() {
        let drawn = [
            ("corner", corner::corner(data)?),
            ("trace", chains::traces(&data.trace)?),
            ("rank", chains::ranks(&data.rank)?),
        ];
        let named = drawn
            .into_iter()
            .filter_map(|(name, figure)| Some((name, figure?)));
        figures.extend(named.map(|(name, figure)| figure.called(&format!("{name}-{k}"))));
    }
    Ok(figures)
}

/// The maps of each round, on the page one by one and for papers side by side; residuals of the last round once more on a scale of their
/// own, where the common one hides them.
fn maps_of_rounds(page: &Page) -> Result<Vec<Figure>> {
    let mut figures = Vec::new();
    let on_page = |figure: Figure| Figure {
        has_file: false,
        ..figure
    };
    let fields = page.figures.iter().map(|f| &f.maps[..]);
    let placed = |m: &&[MapCell]| {
        m.iter().any(|c| c.x_mm.is_finite()) && m.iter().any(|c| c.y_mm.is_finite())
    };
    let fields: Vec<&[MapCell]> = fields.filter(placed).collect();
    let residual = maps::residual_scale(&fields);
    for (k, field) in fields.iter().enumerate() {
        for component in [1, 2] {
            let scales = [maps::field_scale(field, component), residual];
            for what in Mapped::ALL {
                let name = format!("map-{k}-u{component}-{}", what.name());
                figures.push(on_page(maps::one(field, component, what, scales, &name)?));
            }
            let name = format!("maps-{k}-u{component}");
            let alt = format!(
                "Maps of u{component} in round {k}: measured, predicted, and residual on the scale that all rounds share"
            );
            figures.push(maps::side_by_side(field, component, scales, &name, &alt)?);
        }
    }
    let Some(last) = fields.last() else {
        return Ok(figures);
    };
    let own = maps::residual_scale(&[last]);
    for component in [1, 2] {
        let name = format!("map-{}-u{component}-residual-closer", fields.len() - 1);
        let closer = maps::one(last, component, Mapped::Residual, [own, own], &name)?;
        figures.push(on_page(closer));
    }
    Ok(figures)
}
