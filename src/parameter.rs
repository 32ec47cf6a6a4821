//! What a parameter is. Names of parameters, as chain files and reports have them, are made and read here and nowhere else.

/// What a parameter is of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ParameterKind {
    /// An elastic constant.
    Constant,
    Thickness,
    /// The force of a step that nobody declared.
    Load,
    /// The error of a step's declared force.
    LoadError,
    /// A motion of the specimen as a whole.
    Motion,
    /// An effect's amplitude.
    Amplitude,
    Noise,
    /// What the sizes of noise and effects depend on.
    Hyper,
    /// Which effects act, and which answer was given.
    Choice,
}

/// A parameter, whole: its name is [`Parameter::name`].
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    pub kind: ParameterKind,
    /// The effect whose amplitude it is, or that acts.
    pub effect: Option<String>,
    /// Its own name, which ends in its unit: `E1_GPa`, `angle_deg`.
    pub own: String,
    /// The step of a series, where it is of one.
    pub step: Option<String>,
    /// The key of the law by which the effect acts over a series, where one is named.
    pub law: Option<String>,
}

/// Sd of the noise of a measured point.
pub const NOISE: &str = "noise_nm";
/// Name of one step's motion in the plane.
const RIGID_MOTION: &str = "rigid_motion";
const THICKNESS: &str = "thickness_mm";
/// What the names of forces that are not declared begin with.
const FORCE: &str = "force_";
/// Name of the error of one step's declared force.
const FORCE_ERROR: &str = "force_percent";
/// Own name of an amplitude that is a force. No step is called so: what begins as an undeclared force's name and has it after a point is an
/// effect's.
const FORCE_AMPLITUDE: &str = ".force_N";
/// What the names of effects' acting begin with.
const ACTS: &str = "acts";
/// The common size of effects that may act, the discrepancy, and the lengths of the noise.
pub const HYPER: [&str; 4] = [
    "effect_size",
    "discrepancy",
    "noise_length_1_mm",
    "noise_length_2_mm",
];
/// Which answer a draw is of.
const ANSWER: &str = "answer";
/// Units that stand alone at the end of a name.
const UNITS: [&str; 13] = [
    "deg",
    "urad",
    "mrad",
    "mm",
    "um",
    "nm",
    "px",
    "percent",
    "microstrain",
    "N",
    "K",
    "MPa",
    "GPa",
];
/// Between an amplitude and the step in which it acts.
const IN_STEP: &str = " in ";
/// Between an effect and the law by which it acts over a series.
const UNDER: &str = "@";

impl Parameter {
    fn new(kind: ParameterKind, own: &str) -> Self {
        Self {
            kind,
            effect: None,
            own: own.into(),
            step: None,
            law: None,
        }
    }

    /// An amplitude, by the names of its effect and of its own.
    pub fn amplitude(effect: &str, own: &str) -> Self {
        Self {
            effect: Some(effect.into()),
            ..Self::new(ParameterKind::Amplitude, own)
        }
    }

    /// Whether an effect acts.
    pub fn acts(effect: &str) -> Self {
        Self {
            effect: Some(effect.into()),
            ..Self::new(ParameterKind::Choice, ACTS)
        }
    }

    pub fn answer() -> Self {
        Self::new(ParameterKind::Choice, ANSWER)
    }

    /// The force of a step.
    pub fn force(step: &str) -> Self {
        Self::new(ParameterKind::Load, FORCE).in_step(step)
    }

    /// The error of the declared force of a step.
    pub fn force_error(step: &str) -> Self {
        Self::new(ParameterKind::LoadError, FORCE_ERROR).in_step(step)
    }

    pub fn rigid_motion() -> Self {
        Self::new(ParameterKind::Motion, RIGID_MOTION)
    }

    /// The parameter in one step.
    pub fn in_step(self, step: &str) -> Self {
        Self {
            step: Some(step.into()),
            ..self
        }
    }

    /// The parameter of an effect that acts by a law, named by its key.
    pub fn under(self, law: Option<String>) -> Self {
        Self { law, ..self }
    }

    /// What a name names.
    pub fn read(name: &str) -> Self {
        let error = name.strip_prefix(FORCE_ERROR);
        if let Some(step) = error.and_then(|rest| rest.strip_prefix(IN_STEP)) {
            return Self::force_error(step);
        }
        let step = name.strip_prefix(FORCE);
        if let Some(step) = step.filter(|s| !s.contains(FORCE_AMPLITUDE)) {
            return Self::force(step);
        }
        if let Some((effect, own)) = name.split_once('.') {
            let (own, law) = match own.split_once(UNDER) {
                Some((own, law)) => (own, Some(law)),
                None => (own, None),
            };
            if effect == ACTS {
                return Self::acts(own).under(law.map(Into::into));
            }
            let amplitude = match own.split_once(IN_STEP) {
                Some((own, step)) => Self::amplitude(effect, own).in_step(step),
                None => Self::amplitude(effect, own),
            };
            return amplitude.under(law.map(Into::into));
        }
        let kind = match name {
            NOISE => ParameterKind::Noise,
            THICKNESS => ParameterKind::Thickness,
            RIGID_MOTION => ParameterKind::Motion,
            ANSWER => ParameterKind::Choice,
            _ if HYPER.contains(&name) => ParameterKind::Hyper,
            _ => ParameterKind::Constant,
        };
        Self::new(kind, name)
    }

    /// As chain files and reports have it.
    pub fn name(&self) -> String {
        let own = &self.own;
        let step = self.step.as_deref().unwrap_or_default();
        let mut name = match (self.kind, &self.effect) {
            (ParameterKind::Load, _) => format!("{FORCE}{step}"),
            (ParameterKind::LoadError, _) => format!("{FORCE_ERROR}{IN_STEP}{step}"),
            (ParameterKind::Choice, Some(effect)) => format!("{own}.{effect}"),
            (_, Some(effect)) if self.step.is_some() => format!("{effect}.{own}{IN_STEP}{step}"),
            (_, Some(effect)) => format!("{effect}.{own}"),
            (_, None) => own.clone(),
        };
        if let Some(law) = &self.law {
            name += UNDER;
            name += law;
        }
        name
    }

    pub fn is(&self, kind: ParameterKind) -> bool {
        self.kind == kind
    }

    /// Whether it is the amplitude of an effect.
    pub fn is_amplitude(&self) -> bool {
        self.is(ParameterKind::Amplitude)
    }

    /// Whether a scale of all moduli scales it: an elastic constant in GPa.
    pub fn is_modulus(&self) -> bool {
        self.is(ParameterKind::Constant) && self.symbol() != self.own
    }

    /// A modulus without its unit: `E1` of `E1_GPa`.
    pub fn symbol(&self) -> &str {
        self.own.strip_suffix("_GPa").unwrap_or(&self.own)
    }

    /// Whether it cannot be negative, whatever the data say.
    pub fn is_positive(&self) -> bool {
        self.is_modulus() || self.is(ParameterKind::Noise) || self.is(ParameterKind::Thickness)
    }

    /// The unit in its name: `angle_deg` deg, `uniform_per_m` 1/m, `gradient_per_m_per_mm` 1/(m mm), `percent_at_12mm` percent.
    pub fn unit(&self) -> String {
        let own = self.own.split("_at_").next().unwrap_or(&self.own);
        let mut parts = own.split("_per_");
        let head = parts.next().unwrap_or(own);
        let below: Vec<&str> = parts.collect();
        match below[..] {
            [] if self.is(ParameterKind::Load) => "N".into(),
            [] => {
                let last = head.rsplit('_').next().filter(|unit| UNITS.contains(unit));
                last.unwrap_or_default().to_string()
            }
            // before it stands a symbol, or a temperature
            [one] if head.ends_with("_K") => format!("K/{one}"),
            [one] => format!("1/{one}"),
            _ => format!("1/({})", below.join(" ")),
        }
    }
}

/// Whether a name is that of a modulus.
pub fn is_modulus(name: &str) -> bool {
    Parameter::read(name).is_modulus()
}
