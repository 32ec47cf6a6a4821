//! A field experiment: a flat specimen under load, solved by finite elements and seen by a camera.

use std::borrow::Cow;
use std::collections::BTreeSet;

use rayon::prelude::*;
use serde::Serialize;

use super::gauge::{Gauge, ZeroAt, hold_window};
use super::{Experiment, Look, NEAR_EDGE_HARMONICS, NEAR_EDGE_REACH, Sight, State, gauged};
use crate::effect::limit::alter_checked;
use crate::effect::{Scene, Seen};
use crate::error::{Error, Result};
use crate::fem::{Anchor, Certificate, EdgeStress, Locator, Observer, Plate, Setup, Solution};
use crate::field::Frame;
use crate::geometry::{Density, Mesh};
use crate::laminate::{LoadSpec, Ply, SpecimenSpec};

/// Everything that determines what a field experiment predicts.
#[derive(Debug, Clone, Serialize)]
pub struct FieldTest {
    pub specimen: SpecimenSpec,
    pub load: LoadSpec,
    /// The data's frame.
    pub frame: Frame,
    /// How the rigid motion of predictions is fixed.
    pub gauge: Gauge,
    /// Frequency of the fringes a mm of displacement, where displacements are read from fringes.
    pub fringe_frequency_per_mm: Option<f64>,
    /// Bounding box of the measured points, (s, t) mm, low and high corner.
    pub window: [[f64; 2]; 2],
    /// Mesh density.
    pub density: Density,
    /// Solve for every prediction instead of answering from a reduced basis and, where metal yields, from a table.
    pub full_order: bool,
}

/// A meshed specimen, ready to be solved.
pub struct FieldExperiment {
    test: FieldTest,
    scene: Scene,
    plate: Plate,
    zero: Option<ZeroAt>,
    /// Nodes of the elements that touch the window.
    nodes: Vec<u32>,
    support: Sight,
}

impl FieldExperiment {
    /// Mesh the specimen; `scene` holds what effects need to know of the same test.
    ///
    /// # Errors
    /// A specimen that cannot be meshed, a gauge's point beside it, a window beside it.
    pub fn new(test: FieldTest, scene: Scene) -> Result<Self> {
        let plate = Plate::new(&scene.setup, test.density)?;
        let zero = ZeroAt::new(test.gauge, &test.frame, &plate)?;
        let nodes = window_nodes(&plate.mesh, test.window);
        if nodes.is_empty() {
            return Err(Error::input("measurement", "points on the plate")
                .found(format!("{:?}", test.window)));
        }
        let points: Vec<[f64; 2]> = nodes
            .iter()
            .map(|&n| plate.mesh.nodes[n as usize])
            .collect();
        let observer = Locator::new(&plate.mesh).observe_extended(&points);
        Ok(Self {
            support: Sight::anywhere(&points, &[]).with_observer(observer),
            test,
            scene,
            plate,
            zero,
            nodes,
        })
    }

    /// The plate that is solved.
    pub fn plate(&self) -> &Plate {
        &self.plate
    }

    /// The specimen and the load as a state leaves them.
    fn setup(&self, state: &State) -> Result<Setup> {
        let mut setup = self.scene.setup.clone();
        setup.thickness = state.thickness_mm;
        alter_checked("effects", state.acting(), &mut setup)?;
        Ok(setup)
    }

    /// The test of a state, and the ply.
    fn tested(&self, state: &State) -> Result<(Setup, Ply)> {
        let ply = self.scene.material.ply(&state.constants);
        let ply = ply.admissible("elastic constants")?;
        Ok((self.setup(state)?, ply))
    }

    /// Stages 1 and 2: the loaded specimen, `held` where its rigid motion matters before the gauge removes it.
    fn loaded(&self, about: Option<&Anchor>, state: &State, held: bool) -> Result<Solution<'_>> {
        let (setup, ply) = self.tested(state)?;
        let mut solution = match about {
            Some(anchor) => self.plate.solve_near(anchor, &setup, &ply)?,
            None if self.test.full_order => self.plate.solve_full_order(&setup, &ply)?,
            None => self.plate.solve(&setup, &ply)?,
        };
        match &self.zero {
            Some(zero) => zero.apply(&mut solution),
            None if held => hold_window(&mut solution, self.test.window),
            None => {}
        }
        Ok(solution)
    }

    /// The camera's report, of a solution near an anchor's where there is one.
    fn seen(
        &self,
        about: Option<&Anchor>,
        state: &State,
        sight: &Sight,
        gradient: bool,
    ) -> Result<Look> {
        let camera = Seen::new(state.acting(), &self.scene);
        // what optics make of a rotation depends on the rotation; a plain camera reports it as it is
        let solution = self.loaded(about, state, gradient || !camera.is_plain())?;
        let own = sight
            .observer()
            .filter(|_| solution.is_nominal() && camera.is_plain());
        let located;
        let observer = match own {
            Some(observer) => observer,
            None => {
                let places: Vec<[f64; 2]> =
                    sight.all().iter().map(|&p| camera.true_point(p)).collect();
                // where an effect moves points into the hole or past an edge, the field is continued
                located = Locator::new(&solution.mesh).observe_extended(&places);
                &located
            }
        };
        let mut displacement = observer.displacement(&solution.nodal);
        if !camera.is_plain() {
            for (u, &p) in displacement.iter_mut().zip(sight.all()) {
                *u = camera.components(p, *u);
            }
        }
        let gradient = if gradient {
            observer.gradient(&solution.nodal)
        } else {
            Vec::new()
        };
        Ok(Look {
            displacement,
            gradient,
        })
    }

    /// What a nominal plate's displacements show under the gauge, by a plain camera.
    fn shown(&self, nodal: Vec<f64>, observer: &Observer, sight: &Sight) -> Vec<[f64; 2]> {
        let mut solution = Solution {
            mesh: Cow::Borrowed(&self.plate.mesh),
            nodal,
        };
        if let Some(zero) = &self.zero {
            zero.apply(&mut solution);
        }
        gauged(
            self.test.gauge,
            sight,
            &observer.displacement(&solution.nodal),
        )
    }
}

impl Experiment for FieldExperiment {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn gauge(&self) -> Gauge {
        self.test.gauge
    }

    fn window(&self) -> [[f64; 2]; 2] {
        self.test.window
    }

    fn serialisation(&self) -> serde_json::Value {
        let scene = &self.scene;
        serde_json::json!([self.test, scene.material, scene.setup.yield_stress])
    }

    fn mesh_size(&self) -> [usize; 2] {
        [self.plate.mesh.elements.len(), self.plate.mesh.unknowns()]
    }

    fn support(&self) -> &Sight {
        &self.support
    }

    fn spread(&self, at_support: &[[f64; 2]], sight: &Sight) -> Vec<[f64; 2]> {
        let mut nodal = vec![0.0; self.plate.mesh.unknowns()];
        for (&node, u) in self.nodes.iter().zip(at_support) {
            nodal[2 * node as usize] = u[0];
            nodal[2 * node as usize + 1] = u[1];
        }
        match sight.observer() {
            Some(observer) => observer.displacement(&nodal),
            None => Locator::new(&self.plate.mesh)
                .observe_extended(sight.all())
                .displacement(&nodal),
        }
    }

    fn locate(&self, points: &[[f64; 2]], further: &[[f64; 2]]) -> (Sight, Vec<bool>) {
        let locator = Locator::new(&self.plate.mesh);
        let (observer, mut inside) = locator.observe(&[points, further].concat());
        let on_plate = |points: &[[f64; 2]], inside: &[bool]| -> Vec<[f64; 2]> {
            let kept = points.iter().zip(inside).filter(|(_, inside)| **inside);
            kept.map(|(p, _)| *p).collect()
        };
        let further = on_plate(further, &inside[points.len()..]);
        inside.truncate(points.len());
        let sight = Sight::anywhere(&on_plate(points, &inside), &further);
        (sight.with_observer(observer), inside)
    }

    fn shows(&self, state: &State, points: &[[f64; 2]]) -> Result<Vec<bool>> {
        let camera = Seen::new(state.acting(), &self.scene);
        let places: Vec<[f64; 2]> = points.iter().map(|&p| camera.true_point(p)).collect();
        let mesh = self.plate.mesh_of(&self.setup(state)?)?;
        Ok(Locator::new(&mesh).observe(&places).1)
    }

    fn look(&self, state: &State, sight: &Sight, gradient: bool) -> Result<Look> {
        self.seen(None, state, sight, gradient)
    }

    fn anchor(&self, about: &State) -> Result<Option<Anchor>> {
        let (setup, ply) = self.tested(about)?;
        Ok(Some(self.plate.anchor(&setup, &ply)?))
    }

    fn look_near(&self, about: Option<&Anchor>, state: &State, sight: &Sight) -> Result<Look> {
        self.seen(about, state, sight, false)
    }

    fn near_edge(
        &self,
        about: Option<&Anchor>,
        state: &State,
        sight: &Sight,
    ) -> Result<Vec<Vec<[f64; 2]>>> {
        let Some(anchor) = about else {
            return Ok(Vec::new());
        };
        let (setup, _) = self.tested(state)?;
        let (mesh, fields) =
            self.plate
                .near_edge(anchor, &setup, NEAR_EDGE_REACH, NEAR_EDGE_HARMONICS)?;
        let nominal = setup.load.axial / setup.width();
        let camera = Seen::new(state.acting(), &self.scene);
        let places: Vec<[f64; 2]> = sight.all().iter().map(|&p| camera.true_point(p)).collect();
        let observer = Locator::new(&mesh).observe_extended(&places);
        let seen = |nodal: &Vec<f64>| {
            let u = observer.displacement(nodal);
            let u: Vec<[f64; 2]> = u.into_iter().map(|u| u.map(|u| nominal * u)).collect();
            // where the specimen stands still does not matter to a rival: without the rigid motion of the window
            gauged(Gauge::Window, sight, &u)
        };
        Ok(fields.iter().map(seen).collect())
    }

    fn edge_stress(&self, state: &State) -> Result<Option<EdgeStress>> {
        let (setup, ply) = self.tested(state)?;
        self.plate.edge_stress(&setup, &ply)
    }

    fn span(&self, states: &[State]) -> Result<()> {
        if self.test.full_order {
            return Ok(());
        }
        let tests = states.iter().map(|state| self.tested(state));
        self.plate
            .span(&tests.collect::<Result<Vec<_>>>()?, WORTH_A_BASIS)
    }

    fn certify(&self, states: &[State]) -> Result<Vec<Certificate>> {
        let certify = |state| {
            let (setup, ply) = self.tested(state)?;
            self.plate.certify(&setup, &ply)
        };
        let all: Result<Vec<_>> = states.iter().map(certify).collect();
        Ok(all?.into_iter().flatten().collect())
    }

    fn spanning(&self, sight: &Sight) -> Vec<Vec<[f64; 2]>> {
        let (Some(basis), Some(observer)) = (self.plate.nominal_basis(), sight.observer()) else {
            return Vec::new();
        };
        let fields = (0..basis.size()).into_par_iter();
        let shown = |k: usize| self.shown(basis.vector(k), observer, sight);
        fields.map(shown).collect()
    }

    fn coordinates(&self, state: &State) -> Option<Vec<f64>> {
        if !Seen::new(state.acting(), &self.scene).is_plain() {
            return None;
        }
        let (setup, ply) = self.tested(state).ok()?;
        self.plate.coordinates(&setup, &ply)
    }

    fn rest(&self) {
        self.plate.rest();
    }
}

/// Predictions for a uniform plate from which a basis is worth it: it takes some fifteen solutions, and as long again for their bound.
const WORTH_A_BASIS: usize = 30;

/// Nodes of all elements whose bounding box meets the window, in increasing order.
fn window_nodes(mesh: &Mesh, [low, high]: [[f64; 2]; 2]) -> Vec<u32> {
    let mut nodes = BTreeSet::new();
    for (e, element) in mesh.elements.iter().enumerate() {
        let x = mesh.corners(e);
        let outside = (0..2).any(|k| {
            let (min, max) = x
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| {
                    (a.min(p[k]), b.max(p[k]))
                });
            let margin = 0.125 * (max - min) + 1e-6;
            max + margin < low[k] || min - margin > high[k]
        });
        if !outside {
            nodes.extend(element);
        }
    }
    nodes.into_iter().collect()
}
