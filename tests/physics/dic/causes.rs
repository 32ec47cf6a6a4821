//! What may act in a series, and how it goes over the frames.

use super::mechanics::Stiffness;

/// How a motion's size goes over the frames.
#[derive(Debug, Clone, PartialEq)]
pub enum Law {
    /// Arisen with the reference picture.
    Constant,
    /// In proportion to the force.
    Load,
    /// There once the specimen is loaded: f / (f + 0.05) of the relative force f.
    Seated,
    /// With the number of the step, the last loaded one 1.
    Drift,
    /// A size for each frame.
    Free(Vec<f64>),
}

impl Law {
    /// The word of the design for it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Load => "load",
            Self::Seated => "seated",
            Self::Drift => "drift",
            Self::Free(_) => "free",
        }
    }

    /// Sizes over the frames under some forces.
    pub fn weights(&self, forces_n: &[f64]) -> Vec<f64> {
        let most = forces_n.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let loaded = forces_n.iter().filter(|f| **f > 0.0).count().max(1) as f64;
        let weight = |(k, force): (usize, &f64)| {
            let f = force / most;
            match self {
                Self::Constant => 1.0,
                Self::Load => f,
                Self::Seated => f / (f + 0.05),
                Self::Drift => (k + 1) as f64 / loaded,
                Self::Free(sizes) => sizes[k],
            }
        };
        forces_n.iter().enumerate().map(weight).collect()
    }
}

/// What acts, undeclared. Lengths in mm, the data's axes.
#[derive(Debug, Clone)]
pub enum Cause {
    /// An effect of the dictionary that changes the test, with its amplitudes.
    Mechanical(&'static str, Vec<f64>),
    /// A stiffness that the dictionary lacks.
    Foreign(Stiffness),
    /// The gross section's curvature (1/m) along the load under the largest force, in proportion to the force, above 0 where it stretches the
    /// face that is seen; and by how much the hole's middle comes nearer to the camera with it, mm.
    Bending {
        per_m: f64,
        lift_mm: f64,
    },
    /// Strains xx, yy, xy, in millionths.
    UniformStrain([f64; 3], Law),
    /// Kelvin.
    ThermalStrain(f64, Law),
    /// Translation towards the camera, mm.
    Rise(f64, Law),
    /// Rotation about the axes x and y, mrad, and their pivot.
    Turn([f64; 2], [f64; 2], Law),
    /// Radial distortion: percent at 12 mm from its centre.
    Lens(f64, [f64; 2]),
    /// Decentring distortion, 1/mm, about a centre: not in the dictionary.
    Decentring([f64; 2], [f64; 2]),
    CameraRotation(f64),
    Magnification(f64),
    Registration([f64; 2]),
    CameraTilt([f64; 2]),
    /// A displacement read with an error periodic in pixels: amplitude, in pixels.
    Interpolation(f64),
}

/// An effect with the law and the amplitudes it really has.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueEffect {
    /// The dictionary's name, or what it is.
    pub name: String,
    /// A motion's law, "load" of mechanics, "static" of the picture.
    pub law: &'static str,
    pub amplitudes: Vec<(&'static str, f64)>,
}

/// Name, law, amplitudes by their names.
type Named = (&'static str, &'static str, Vec<(&'static str, f64)>);

impl Cause {
    pub fn truth(&self) -> TrueEffect {
        let (name, law, amplitudes) = self.motion().unwrap_or_else(|| self.other());
        TrueEffect {
            name: name.into(),
            law,
            amplitudes,
        }
    }

    /// Name, law and amplitudes of what mechanics or the picture do.
    fn other(&self) -> Named {
        match self {
            Self::Mechanical(name, a) => {
                let parameters = plychain::effect::find("simulator", name).unwrap();
                let names = parameters.parameters().iter().map(|p| p.name);
                (name, "load", names.zip(a.iter().copied()).collect())
            }
            Self::Foreign(Stiffness::Patch { loss, .. }) => {
                ("soft_patch", "load", vec![("loss", *loss)])
            }
            Self::Foreign(Stiffness::Worn { loss, .. } | Stiffness::Ring { loss, .. }) => {
                ("hole_edge_damage", "load", vec![("edge_loss", *loss)])
            }
            Self::Foreign(Stiffness::Waves { sd, .. }) => {
                ("random_stiffness", "load", vec![("sd", *sd)])
            }
            Self::Bending { per_m, .. } => (
                "out_of_plane_bending",
                "load",
                vec![("uniform_per_m", *per_m)],
            ),
            Self::Lens(k, [x, y]) => (
                "lens_distortion",
                "static",
                vec![("percent_at_12mm", *k), ("x_mm", *x), ("y_mm", *y)],
            ),
            Self::Decentring([a, b], _) => (
                "lens_decentring",
                "static",
                vec![("p1_per_mm", *a), ("p2_per_mm", *b)],
            ),
            Self::CameraRotation(a) => ("camera_rotation", "static", vec![("angle_deg", *a)]),
            Self::Magnification(a) => ("magnification", "static", vec![("percent", *a)]),
            Self::Registration([a, b]) => (
                "registration_offset",
                "static",
                vec![("dx_mm", *a), ("dy_mm", *b)],
            ),
            Self::CameraTilt([a, b]) => (
                "camera_tilt",
                "static",
                vec![("x_per_mm", *a), ("y_per_mm", *b)],
            ),
            Self::Interpolation(a) => ("interpolation_bias", "static", vec![("amplitude_px", *a)]),
            Self::UniformStrain(..) | Self::ThermalStrain(..) | Self::Rise(..) | Self::Turn(..) => {
                unreachable!("a motion")
            }
        }
    }

    /// The same of a motion.
    fn motion(&self) -> Option<Named> {
        Some(match self {
            Self::UniformStrain([a, b, c], law) => (
                "uniform_strain",
                law.name(),
                vec![
                    ("exx_microstrain", *a),
                    ("eyy_microstrain", *b),
                    ("exy_microstrain", *c),
                ],
            ),
            Self::ThermalStrain(t, law) => ("thermal_strain", law.name(), vec![("dT_K", *t)]),
            Self::Rise(w, law) => ("out_of_plane_translation", law.name(), vec![("w_mm", *w)]),
            Self::Turn([a, b], _, law) => (
                "out_of_plane_rotation",
                law.name(),
                vec![("about_x_mrad", *a), ("about_y_mrad", *b)],
            ),
            _ => return None,
        })
    }
}
