//! A series of loads as image correlation reports it: strained specimen, motion of each frame, camera, subsets, noise.

use rayon::prelude::*;

use super::bending::Bent;
use super::camera::{Exposure, Motion, Picture, Pinhole};
use super::causes::{Cause, Law, TrueEffect};
use super::mechanics::{Loaded, Specimen};
use super::noise::Noise;
use super::subsets::{Filter, Layout};

/// Everything that a series is made of.
#[derive(Debug, Clone)]
pub struct Series {
    pub name: String,
    pub specimen: Specimen,
    /// True constants, in the order of the priors, border units.
    pub constants: Vec<f64>,
    pub thickness_mm: f64,
    /// Declared over true force, less 1.
    pub load_error: f64,
    /// True forces; frames at 0 are unloaded.
    pub forces_n: Vec<f64>,
    /// Motion of each frame in the plane: translation (mm) and rotation about the hole's centre (rad).
    pub rigid: Vec<([f64; 2], f64)>,
    pub pinhole: Pinhole,
    pub declared_distance_mm: f64,
    pub causes: Vec<Cause>,
    pub layout: Layout,
    pub noise: Noise,
    pub seed: u64,
    /// Density of the finite elements over the program's.
    pub finer: f64,
}

/// A measured series.
pub struct Observed {
    /// Reported points, mm.
    pub points: Vec<[f64; 2]>,
    /// Reported displacements of each frame, mm.
    pub frames: Vec<Vec<[f64; 2]>>,
}

impl Series {
    /// The specimen as it is loaded.
    pub fn loaded(&self) -> Loaded {
        let mut loaded = Loaded {
            specimen: self.specimen.clone(),
            constants: self.constants.clone(),
            thickness_mm: self.thickness_mm,
            effects: Vec::new(),
            stiffness: None,
            finer: self.finer,
        };
        for cause in &self.causes {
            match cause {
                Cause::Mechanical(name, a) => loaded.effects.push((name, a.clone())),
                Cause::Foreign(stiffness) => loaded.stiffness = Some(*stiffness),
                _ => {}
            }
        }
        loaded
    }

    /// The static map of the picture.
    pub fn picture(&self) -> Picture {
        let mut picture = Picture::default();
        for cause in &self.causes {
            match *cause {
                Cause::Lens(percent, center) => {
                    picture.k1_per_mm2 = 0.01 * percent / 144.0;
                    picture.lens_mm = center;
                }
                Cause::Decentring(p, center) => {
                    picture.decentring_per_mm = p;
                    picture.lens_mm = center;
                }
                Cause::CameraRotation(angle) => picture.rotation_deg = angle,
                Cause::Magnification(percent) => picture.magnification_percent = percent,
                Cause::Registration(offset) => picture.offset_mm = offset,
                Cause::CameraTilt(tilt) => picture.tilt_per_mm = tilt,
                _ => {}
            }
        }
        picture
    }

    /// Rigid motion of each frame, in the plane and out of it.
    fn motions(&self) -> Vec<Motion> {
        let plane = |(shift_mm, angle_rad): &([f64; 2], f64)| Motion {
            shift_mm: *shift_mm,
            angle_rad: *angle_rad,
            ..Motion::default()
        };
        let mut motions: Vec<Motion> = self.rigid.iter().map(plane).collect();
        for cause in &self.causes {
            let law = match cause {
                Cause::Rise(_, law) | Cause::Turn(_, _, law) => law,
                _ => continue,
            };
            for (motion, w) in motions.iter_mut().zip(law.weights(&self.forces_n)) {
                match cause {
                    Cause::Rise(rise, _) => motion.rise_mm += w * rise,
                    Cause::Turn(turn, pivot, _) => {
                        motion.turn_rad = turn.map(|a| 1e-3 * w * a);
                        motion.pivot_mm = *pivot;
                    }
                    _ => {}
                }
            }
        }
        motions
    }

    /// Strain (xx, yy, xy) of each frame that the load does not cause.
    fn strains(&self, loaded: &Loaded) -> Vec<[f64; 3]> {
        let mut strains = vec![[0.0; 3]; self.forces_n.len()];
        for cause in &self.causes {
            let (unit, law) = match cause {
                Cause::UniformStrain(e, law) => (e.map(|e| 1e-6 * e), law),
                Cause::ThermalStrain(t, law) => (loaded.expansion_per_k().map(|e| e * t), law),
                _ => continue,
            };
            for (strain, w) in strains.iter_mut().zip(law.weights(&self.forces_n)) {
                *strain = [0, 1, 2].map(|k| strain[k] + w * unit[k]);
            }
        }
        strains
    }

    /// The face's displacements (x, y, z) by bending under the largest force.
    fn bent(&self, loaded: &Loaded, points: &[[f64; 2]]) -> Vec<[f64; 3]> {
        let found = self.causes.iter().find_map(|cause| match cause {
            Cause::Bending { per_m, lift_mm } => Some((1e-3 * per_m, *lift_mm)),
            _ => None,
        });
        let Some((curvature, lift)) = found else {
            return vec![[0.0; 3]; points.len()];
        };
        let (bent, half) = (Bent::new(loaded), 0.5 * self.thickness_mm);
        let at = |&p: &[f64; 2]| {
            let (w, [along_x, along_y]) = bent.at(p);
            [
                -half * curvature * along_x,
                -half * curvature * along_y,
                curvature * w + lift,
            ]
        };
        points.par_iter().map(at).collect()
    }

    /// What would be reported without noise, and by which subsets.
    pub fn exact(&self) -> (Filter, Vec<Vec<[f64; 2]>>) {
        let (loaded, picture) = (self.loaded(), self.picture());
        let places = self.layout.places();
        let material: Vec<[f64; 2]> = places.par_iter().map(|&p| picture.true_point(p)).collect();
        let on: Vec<bool> = material.iter().map(|&p| loaded.holds(p)).collect();
        let filter = Filter::new(&self.layout, &on);
        let kept: Vec<usize> = (0..on.len()).filter(|&i| on[i]).collect();
        let points: Vec<[f64; 2]> = kept.iter().map(|&i| material[i]).collect();
        let mechanics = loaded.displacements(&self.forces_n, &points);
        let bent = self.bent(&loaded, &points);
        let (motions, strains) = (self.motions(), self.strains(&loaded));
        let bending = Law::Load.weights(&self.forces_n);
        let frame = |k: usize| {
            let exposure = Exposure::new(&motions[k], self.pinhole, picture);
            let [xx, yy, xy] = strains[k];
            let reported = |i: usize| {
                let ([x, y], u, b) = (points[i], mechanics[k][i], bent[i]);
                let moved = exposure.place([
                    x + u[0] + xx * x + xy * y + bending[k] * b[0],
                    y + u[1] + xy * x + yy * y + bending[k] * b[1],
                    bending[k] * b[2],
                ]);
                let p = places[kept[i]];
                [moved[0] - p[0], moved[1] - p[1]]
            };
            let values: Vec<[f64; 2]> = (0..points.len()).into_par_iter().map(reported).collect();
            let component = |c: usize| {
                let mut all = vec![0.0; on.len()];
                for (&i, u) in kept.iter().zip(&values) {
                    all[i] = u[c];
                }
                filter.apply(&all)
            };
            let (u, v) = (component(0), component(1));
            u.into_iter()
                .zip(v)
                .map(|(u, v)| self.read([u, v]))
                .collect()
        };
        let frames = (0..self.forces_n.len()).map(frame).collect();
        (filter, frames)
    }

    /// A displacement as the interpolation of grey values reads it.
    fn read(&self, u: [f64; 2]) -> [f64; 2] {
        let pixel = self.layout.pixel_mm;
        let bias = self.causes.iter().map(|cause| match cause {
            Cause::Interpolation(amplitude) => *amplitude,
            _ => 0.0,
        });
        let bias = pixel * bias.sum::<f64>();
        u.map(|u| u + bias * (std::f64::consts::TAU * u / pixel).sin())
    }

    /// The series with its noise.
    pub fn observed(&self) -> Observed {
        let (filter, mut frames) = self.exact();
        let [columns, rows] = self.layout.pixels();
        let pixels = columns * rows;
        let noise = self
            .noise
            .exposures(&filter, pixels, frames.len(), self.seed);
        for (frame, noise) in frames.iter_mut().zip(noise) {
            for (u, n) in frame.iter_mut().zip(noise) {
                *u = [u[0] + n[0], u[1] + n[1]];
            }
        }
        Observed {
            points: filter.points,
            frames,
        }
    }

    /// Forces that the machine shows, to 1 N.
    pub fn declared_n(&self) -> Vec<f64> {
        let shown = |f: &f64| (f * (1.0 + self.load_error)).round();
        self.forces_n.iter().map(shown).collect()
    }

    /// Effects that really act.
    pub fn truth(&self) -> Vec<TrueEffect> {
        self.causes.iter().map(Cause::truth).collect()
    }
}
