//! A population in words, as a page, and as chain files.

use std::path::{Path, PathBuf};

use super::report::{Basis, Estimate, OfConstant, PopulationReport};
use super::sampled::Sampled;
use crate::chain::write_zarr;
use crate::error::Result;
use crate::files;
use crate::report::html;
use crate::report::learned::{self, Learned};
use crate::section::{Digits, Document, Piece, Section, Table, TableCell, row};

/// Write chains, `population.json` and `population.html` into a folder, in place of what was written there before, and return the page's path.
///
/// # Errors
/// Of the input: a folder that cannot be written.
pub fn write(report: &PopulationReport, sampled: &Sampled, folder: &Path) -> Result<PathBuf> {
    files::make_folder(folder)?;
    files::replace_folder(&folder.join("chain.zarr"), |store| {
        write_zarr(&sampled.draws, store)
    })?;
    files::write_json(&folder.join("population.json"), report)?;
    let page = folder.join("population.html");
    files::replace(&page, html(&report.page(), &[]))?;
    Ok(page)
}

impl Estimate {
    fn cell(&self) -> TableCell {
        TableCell::interval([self.mean, self.sd, self.low, self.high])
    }
}

impl Basis {
    fn cell(&self) -> TableCell {
        TableCell::number(self.value, Digits::Sd(self.percentile.sd))
    }
}

impl OfConstant {
    /// The prior of a run, and what the data of a typical specimen added to it.
    fn learned_cells(&self) -> [TableCell; 2] {
        let [mean, sd] = self.prior;
        Learned::cells(Some(&Learned {
            prior: self.prior.into(),
            from_data: self.from_data,
            shift_prior_sd: (self.mean.mean - mean) / sd,
            lacks_force: false,
        }))
    }
}

impl PopulationReport {
    /// For the terminal.
    pub fn section(&self) -> Section {
        let count = self.specimens.len();
        let left = self.left_out.iter();
        let left = left.map(|(name, reason)| format!("not among the specimens: {name} ({reason})"));
        let notes = self.warnings.iter().map(|w| format!("note: {w}"));
        Section::new(format!("{}: population of {count} specimens", self.name))
            .with(self.constants_table())
            .say(&self.convergence)
            .with_all(left.chain(notes).map(Piece::Paragraph))
    }

    fn constants_table(&self) -> Table {
        let [prior, data] = learned::HEADERS;
        let header = [
            "constant",
            "mean of the population",
            "sd between specimens",
            "B-basis",
            "A-basis",
            prior,
            data,
        ];
        let rows = self.constants.iter().map(|(name, c)| {
            let cells = [
                c.mean.cell(),
                c.sd.cell(),
                c.b_basis.cell(),
                c.a_basis.cell(),
            ];
            row(name, cells.into_iter().chain(c.learned_cells()))
        });
        let caption = "Mean +- sd [95 % interval] of the population's mean and of the sd between specimens; basis values";
        Table::new(caption, header, rows)
    }

    fn specimens_table(&self) -> Table {
        let heads = |name: &String| [format!("{name} alone"), format!("{name} given all")];
        let header = self.constants.keys().flat_map(heads);
        let header = std::iter::once("specimen".to_string()).chain(header);
        let rows = self.specimens.iter().map(|(name, s)| {
            let both = s.alone.iter().flat_map(|(constant, alone)| {
                let given_all = s.shrunken.get(constant).map(Estimate::cell);
                let alone = TableCell::mean_sd(Some(*alone));
                [alone, given_all.unwrap_or(TableCell::Missing)]
            });
            row(name, both)
        });
        Table::new(
            "Alone, without the prior, and given all specimens",
            header,
            rows,
        )
        .sortable()
    }

    fn page(&self) -> Document {
        let correlations = self
            .correlations
            .iter()
            .map(|(name, r)| row(name, [r.cell()]));
        let header = ["pair", "correlation"];
        let correlations = Table::new("Mean +- sd [95 % interval]", header, correlations);
        let left = self.left_out.iter();
        let left =
            left.map(|(name, reason)| format!("{name} is not among the specimens: {reason}"));
        let basis = "B-basis: with 95 % confidence nine of ten specimens lie above it; A-basis: 99 of 100. Both are the 5 % quantile of the percentile's posterior, for a normal population.";
        let about = format!("{} specimens; {}", self.specimens.len(), self.convergence);
        Document {
            title: format!("{}: population", self.name),
            heading: format!("Population of {}", self.name),
            lead: vec![Piece::Note(about)],
            sections: vec![
                Section::new("Constants")
                    .with(self.constants_table())
                    .with(Piece::Note(basis.into())),
                Section::new("Correlations between specimens").with(correlations),
                Section::new("Specimens").with(self.specimens_table()),
                Section::new("Notes").with(Piece::list(left.chain(self.warnings.iter().cloned()))),
            ],
            folded: false,
            footer: "Chains: chain.zarr; numbers: population.json.".into(),
        }
    }
}
