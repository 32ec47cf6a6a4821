//! A frequencies experiment as a model file declares it, and as it is computed with.

use serde::{Deserialize, Serialize};
use serde_with::skip_serializing_none;

use super::assignment::{FrequencyPeak, PeakModel};
use super::basis::PlateEdge;
use super::perforated;
use super::plate::{PlateCoefficients, PlateParameter, TransverseShear, VibratingPlate, Weight};
use super::ritz::{Ritz, Settings, VibrationMode};
use super::theory::{PlateSupports, Theory};
use crate::error::{Error, Result};
use crate::experiment::check_name;
use crate::laminate::{HoleSpec, MeanSd, Ply};
use crate::quantity::MPA_PER_GPA;

/// t of a gram, t/mm^3 of a kg/m^3.
const T_PER_G: f64 = 1e-6;
const T_MM3_PER_KG_M3: f64 = 1e-12;

/// An entry of `experiments` of the kind `frequencies`. Unknown keys are errors.
#[skip_serializing_none]
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrequenciesSpec {
    pub name: String,
    /// Always `frequencies`.
    pub kind: String,
    pub specimen: PlateSpec,
    /// How the edges are held.
    pub support: SupportSpec,
    /// Measured peaks.
    #[serde(rename = "frequencies_Hz")]
    pub frequencies_hz: Vec<f64>,
    /// Standard deviation of a reading, percent of the frequency.
    pub sd_percent: f64,
    /// Whether opposite corners move together (even) or against each other (odd) in each peak, where that was seen.
    pub parity: Option<Vec<Option<Parity>>>,
    /// What was looked at; from a tenth below the lowest to a fiftieth above the highest peak where nothing is said.
    #[serde(rename = "band_Hz")]
    pub band_hz: Option<[f64; 2]>,
    /// Sd by which the model's frequencies are wrong beyond its parameters, percent; it is sampled where nothing is said.
    pub model_error_percent: Option<f64>,
    /// Probability that a mode leaves no peak.
    #[serde(default = "a_tenth")]
    pub missing: f64,
    /// Expected number of peaks that are no mode.
    #[serde(default = "one")]
    pub additional: f64,
    /// Density of the air that moves with the plate; 0 in vacuum.
    #[serde(rename = "air_kg_m3", default = "air")]
    pub air_kg_m3: MeanSd,
}

/// A rectangular plate.
#[skip_serializing_none]
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlateSpec {
    pub length_mm: MeanSd,
    pub width_mm: MeanSd,
    pub thickness_mm: MeanSd,
    /// Ply angles from the direction of the length; none for an isotropic plate.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub layup_deg: Vec<f64>,
    /// The plate's mass; or else its density.
    pub mass_g: Option<MeanSd>,
    pub density_kg_m3: Option<MeanSd>,
    /// Transverse shear moduli; of a transversely isotropic ply where nothing is said.
    #[serde(rename = "G13_GPa")]
    pub g13_gpa: Option<MeanSd>,
    #[serde(rename = "G23_GPa")]
    pub g23_gpa: Option<MeanSd>,
    /// A circular hole through the plate.
    pub hole: Option<HoleSpec>,
    /// A body that sits on the plate, an accelerometer.
    pub added_mass: Option<AddedMassSpec>,
}

/// A body on the plate that is small beside the modes' wavelengths.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AddedMassSpec {
    pub mass_g: MeanSd,
    /// Its place along length and width, shares from 0 to 1.
    pub at: [f64; 2],
}

/// How edges are held: all alike, or each by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected free, simply_supported or clamped, or a pair of them for x and for y"
)]
pub enum SupportSpec {
    All(EdgeSpec),
    /// At both ends of the length (x) and of the width (y).
    Each {
        x: [EdgeSpec; 2],
        y: [EdgeSpec; 2],
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EdgeSpec {
    Free,
    SimplySupported,
    Clamped,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Parity {
    Even,
    Odd,
}

impl Parity {
    pub fn of(odd: bool) -> Self {
        match odd {
            true => Self::Odd,
            false => Self::Even,
        }
    }
}

fn a_tenth() -> f64 {
    0.1
}

fn one() -> f64 {
    1.0
}

/// Air at 20 degrees, whatever the weather.
fn air() -> MeanSd {
    MeanSd {
        mean: 1.2,
        sd: 0.03,
    }
}

impl From<EdgeSpec> for PlateEdge {
    fn from(edge: EdgeSpec) -> Self {
        match edge {
            EdgeSpec::Free => PlateEdge::Free,
            EdgeSpec::SimplySupported => PlateEdge::SimplySupported,
            EdgeSpec::Clamped => PlateEdge::Clamped,
        }
    }
}

impl SupportSpec {
    fn supports(self) -> PlateSupports {
        match self {
            Self::All(edge) => PlateSupports::all(edge.into()),
            Self::Each { x, y } => PlateSupports {
                x: x.map(PlateEdge::from),
                y: y.map(PlateEdge::from),
            },
        }
    }
}

/// A quantity of the plate that is known with an sd: its name in files, its unit in those of [`VibratingPlate`].
#[derive(Debug, Clone, Copy)]
pub struct Nuisance {
    pub name: &'static str,
    pub parameter: PlateParameter,
    pub known: MeanSd,
    /// Value in the plate's unit for 1 in the file's.
    pub unit: f64,
}

impl FrequenciesSpec {
    /// Check everything that the types cannot; `isotropic` materials have no layup.
    ///
    /// # Errors
    /// The input's fault; the place is the key within this experiment.
    pub fn validate(&self, isotropic: bool) -> Result<()> {
        check_name(&self.name, "the experiment's own parameters")?;
        if self.kind != "frequencies" {
            return Err(Error::input("kind", "\"frequencies\"").found(&self.kind));
        }
        let given =
            self.specimen.mass_g.is_some() as u8 + self.specimen.density_kg_m3.is_some() as u8;
        if given != 1 {
            let expected = "either mass_g (weighed: the better one) or density_kg_m3";
            return Err(Error::input("specimen", expected).found(match given {
                0 => "neither",
                _ => "both",
            }));
        }
        match (isotropic, self.specimen.layup_deg.is_empty()) {
            (false, true) => {
                let expected = "the plies' angles from the direction of the length";
                return Err(Error::input("specimen.layup_deg", expected).found("none"));
            }
            (true, false) => {
                let expected = "no layup of an isotropic material";
                return Err(Error::input("specimen.layup_deg", expected).found("angles"));
            }
            _ => {}
        }
        for known in self.known() {
            if known.name != AIR || known.known.mean != 0.0 {
                let place = format!("specimen.{}", known.name);
                known.known.validate(&place)?;
            }
        }
        self.validate_peaks()
    }

    fn validate_peaks(&self) -> Result<()> {
        const PLACE: &str = "frequencies_Hz";
        if self.frequencies_hz.len() < 2 {
            return Err(Error::input(PLACE, "at least two peaks").found(self.frequencies_hz.len()));
        }
        if let Some(f) = self
            .frequencies_hz
            .iter()
            .find(|f| !(f.is_finite() && **f > 0.0))
        {
            return Err(Error::input(PLACE, "numbers above 0").found(f));
        }
        let mut sorted = self.frequencies_hz.clone();
        sorted.sort_by(f64::total_cmp);
        if let Some(pair) = sorted.windows(2).find(|p| p[0] == p[1]) {
            return Err(Error::input(PLACE, "every peak once").found(pair[0]).hint(
                "two modes of one frequency give two peaks; where they cannot be told apart leave one out",
            ));
        }
        if !(self.sd_percent > 0.0 && self.sd_percent < 20.0) {
            let expected = "percent of the frequency, above 0 and below 20";
            return Err(Error::input("sd_percent", expected).found(self.sd_percent));
        }
        if let Some(parity) = self
            .parity
            .as_ref()
            .filter(|p| p.len() != self.frequencies_hz.len())
        {
            let expected = format!(
                "one for each of {} peaks (null where it was not seen)",
                self.frequencies_hz.len()
            );
            return Err(Error::input("parity", expected).found(parity.len()));
        }
        if let Some(error) = self
            .model_error_percent
            .filter(|e| !(*e > 0.0 && *e < 20.0))
        {
            return Err(
                Error::input("model_error_percent", "a number above 0 and below 20").found(error),
            );
        }
        let band = self.peak_model(0.01);
        band.validate()?;
        let outside = |f: &&f64| !(band.band_hz[0]..=band.band_hz[1]).contains(*f);
        if let Some(f) = self.frequencies_hz.iter().find(outside) {
            return Err(Error::input("band_Hz", "a band that holds every peak")
                .found(format!("{f} Hz outside")));
        }
        Ok(())
    }

    /// What is known of the plate with an sd, and what is known exactly.
    pub fn known(&self) -> Vec<Nuisance> {
        let s = &self.specimen;
        let weight = s.mass_g.map(|m| ("mass_g", m, T_PER_G));
        let weight = weight.or(s
            .density_kg_m3
            .map(|d| ("density_kg_m3", d, T_MM3_PER_KG_M3)));
        let of = |name, parameter, known, unit| Nuisance {
            name,
            parameter,
            known,
            unit,
        };
        let mut all = vec![
            of("length_mm", PlateParameter::Length, s.length_mm, 1.0),
            of("width_mm", PlateParameter::Width, s.width_mm, 1.0),
            of(
                "thickness_mm",
                PlateParameter::Thickness,
                s.thickness_mm,
                1.0,
            ),
        ];
        all.extend(weight.map(|(name, known, unit)| of(name, PlateParameter::Weight, known, unit)));
        all.extend(s.added_mass.map(|body| {
            of(
                "added_mass_g",
                PlateParameter::PointMass,
                body.mass_g,
                T_PER_G,
            )
        }));
        all.push(of(
            AIR,
            PlateParameter::AirDensity,
            self.air_kg_m3,
            T_MM3_PER_KG_M3,
        ));
        let moduli = [
            ("G13_GPa", PlateParameter::G13, s.g13_gpa),
            ("G23_GPa", PlateParameter::G23, s.g23_gpa),
        ];
        all.extend(
            moduli
                .into_iter()
                .filter_map(|(name, p, known)| Some(of(name, p, known?, MPA_PER_GPA))),
        );
        all
    }

    /// The plate at the means of what is known of it.
    pub fn plate(&self, ply: Ply) -> VibratingPlate {
        let angles = match &self.specimen.layup_deg[..] {
            [] => vec![0.0],
            layup => layup.iter().map(|a| a.to_radians()).collect(),
        };
        let weight = match self.specimen.mass_g {
            Some(_) => Weight::Mass(0.0),
            None => Weight::Density(0.0),
        };
        let bare = VibratingPlate {
            length: 0.0,
            width: 0.0,
            thickness: 0.0,
            weight,
            ply,
            transverse: TransverseShear::default(),
            angles,
            air_density: 0.0,
            point_mass: 0.0,
        };
        let known = self.known().into_iter();
        known.fold(bare, |plate, n| {
            plate.with(n.parameter, n.known.mean * n.unit)
        })
    }

    pub fn peaks(&self) -> Vec<FrequencyPeak> {
        let parity = |k: usize| self.parity.as_ref().and_then(|p| p[k]);
        let all = self.frequencies_hz.iter().enumerate();
        all.map(|(k, &f)| FrequencyPeak {
            frequency_hz: f,
            sd_hz: f * self.sd_percent / 100.0,
            odd: parity(k).map(|p| p == Parity::Odd),
        })
        .collect()
    }

    /// What is stated about peaks, with a model error as a fraction.
    pub fn peak_model(&self, model_error: f64) -> PeakModel {
        /// How far beyond the peaks the band reaches where it is not said.
        const BEYOND: [f64; 2] = [0.9, 1.02];
        /// Probability that a parity is stated wrongly.
        const WRONG_PARITY: f64 = 0.02;
        let lowest = self
            .frequencies_hz
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min);
        let highest = self.frequencies_hz.iter().copied().fold(0.0, f64::max);
        PeakModel {
            model_error,
            missing: self.missing,
            additional: self.additional,
            wrong_parity: WRONG_PARITY,
            band_hz: self
                .band_hz
                .unwrap_or([BEYOND[0] * lowest, BEYOND[1] * highest]),
        }
    }

    /// The stored matrices of a plate.
    ///
    /// # Errors
    /// The input's fault: a plate that cannot be.
    pub fn ritz(&self, plate: &VibratingPlate) -> Result<Ritz> {
        plate.validate()?;
        let supports = self.support.supports();
        let is_free = supports == PlateSupports::all(PlateEdge::Free);
        let settings = Settings {
            supports,
            edge_layers: is_free.then(|| plate.edge_layers()),
            air_aspect: (plate.air_density > 0.0).then_some(plate.length / plate.width),
            point: self.specimen.added_mass.map(|body| body.at),
            ..Settings::free(Theory::Sheared)
        };
        let ritz = Ritz::new(&settings)?;
        let Some(hole) = &self.specimen.hole else {
            return Ok(ritz);
        };
        let modes = self.modes_of(&ritz, plate)?;
        let factors = perforated::factors(plate, hole, &supports, (&ritz, &modes))?;
        Ok(ritz.with_factors(&modes, &factors))
    }

    /// The modes that a hole's factors are computed for: those of the band, and some beyond.
    fn modes_of(&self, ritz: &Ritz, plate: &VibratingPlate) -> Result<Vec<VibrationMode>> {
        /// How far beyond the band, for other constants than the plate's.
        const BEYOND: f64 = 1.3;
        const MOST: usize = 40;
        let end = BEYOND * self.peak_model(0.01).band_hz[1];
        let mut modes = ritz.modes(&plate.coefficients(), MOST)?;
        let least = self.frequencies_hz.len() + 2;
        let below = modes.iter().filter(|m| m.frequency_hz() < end).count();
        modes.truncate(below.max(least));
        Ok(modes)
    }

    /// The matrices small enough for many draws about some plates, and how many modes pass the band in any of them.
    ///
    /// # Errors
    /// Those of [`Ritz::modes`].
    pub fn small(&self, ritz: &Ritz, plates: &[VibratingPlate]) -> Result<(Ritz, usize)> {
        /// Modes beyond the band that are predicted.
        const MORE: usize = 2;
        /// Modes that are looked through for the band's end, and most of them within it.
        const MOST: usize = 64;
        const MOST_WITHIN: usize = 48;
        /// How far beyond the band modes span the small problem.
        const SPAN: f64 = 1.15;
        let end = self.peak_model(0.01).band_hz[1];
        let designs: Vec<PlateCoefficients> =
            plates.iter().map(VibratingPlate::coefficients).collect();
        let small = ritz.reduced_below(&designs, SPAN * end)?;
        let mut count = 0;
        for design in &designs {
            let found = small.modes(design, MOST)?;
            count = count.max(found.iter().filter(|m| m.frequency_hz() < end).count());
        }
        if count > MOST_WITHIN {
            return Err(Error::input("frequencies_Hz", format!("peaks among the lowest {MOST_WITHIN} modes of the plate"))
                .found(format!("up to {count} modes below {end:.0} Hz"))
                .hint("leave the highest peaks out and state band_Hz; or check units (Hz, mm, g), thickness and support"));
        }
        Ok((small, count + MORE))
    }
}

/// The name of the air's density.
pub const AIR: &str = "air_kg_m3";
