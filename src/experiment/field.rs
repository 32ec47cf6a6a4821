//! A field experiment: a flat specimen under load, solved by finite elements and seen by a camera.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use super::bending::Bending;
use super::field_test::FieldTest;
use super::gauge::{Gauge, ZeroAt, hold_window, window_motions};
use super::mesh_error::{MeshError, mesh_error};
use super::smoothing::Smoothing;
use super::solver::in_closed_form;
use super::subset::Subsets;
use super::window::{off_the_plate, widened, window_nodes};
use super::{
    CameraField, Mechanics, NEAR_EDGE_HARMONICS, NEAR_EDGE_REACH, Places, PointSet, Softening,
    Spanning, State, gauged,
};
use crate::effect::limit::alter_checked;
use crate::effect::{Effect, Scene, Seen};
use crate::error::Result;
use crate::fem::{
    self, Anchor, Answer, Certificate, EdgeStress, Locator, Observer, Plate, Setup, Solution,
    SpanBasis, View,
};
use crate::field::rigid::RigidMotion;
use crate::geometry::Mesh;
use crate::laminate::Ply;
use crate::numeric::add_scaled;

/// A meshed specimen, ready to be solved.
pub struct FieldExperiment {
    test: FieldTest,
    scene: Scene,
    plate: Arc<Plate>,
    zero: Option<ZeroAt>,
    /// Nodes of the elements that touch the window.
    nodes: Vec<u32>,
    support: PointSet,
    /// The nominal specimen bent out of its plane, once it was asked for.
    bending: OnceLock<Bending>,
    /// What averages over subsets about the nodes read, and what the nodes themselves do, once it was asked for.
    of_nodes: OnceLock<[Observer; 2]>,
}

impl FieldExperiment {
    /// Mesh the specimen; `scene` holds what effects need to know of the same test.
    ///
    /// # Errors
    /// A specimen that cannot be meshed, a gauge's point beside it, a window beside it.
    pub fn new(test: FieldTest, scene: Scene) -> Result<Self> {
        let plate = Plate::new(&scene.setup, test.density)?;
        Self::on(Arc::new(plate), test, scene)
    }

    /// The same on a mesh of the specimen that was made before.
    ///
    /// # Errors
    /// A gauge's point or a window beside the specimen.
    pub fn on(plate: Arc<Plate>, test: FieldTest, scene: Scene) -> Result<Self> {
        let zero = ZeroAt::new(test.gauge, &test.frame, &plate)?;
        let reach = test
            .images
            .as_ref()
            .map_or(0.0, |i| 0.5 * i.subsets.side_mm);
        let nodes = window_nodes(&plate.mesh, widened(test.window, reach));
        if nodes.is_empty() {
            return Err(off_the_plate(test.window, scene.setup.geometry.extents()));
        }
        let points: Vec<[f64; 2]> = nodes
            .iter()
            .map(|&n| plate.mesh.nodes[n as usize])
            .collect();
        let observer = Locator::new(&plate.mesh).observe_extended(&points);
        Ok(Self {
            support: PointSet::anywhere(&points, &[]).with_observer(observer),
            test,
            scene,
            plate,
            zero,
            nodes,
            bending: OnceLock::new(),
            of_nodes: OnceLock::new(),
        })
    }

    /// The nominal specimen bent out of its plane. Threads that ask at once each solve it: one that waited could hold up the other's
    /// parallel loops.
    fn bending(&self) -> Result<&Bending> {
        if let Some(bending) = self.bending.get() {
            return Ok(bending);
        }
        let bending = Bending::new(&self.scene, &self.plate.mesh, self.test.window)?;
        Ok(self.bending.get_or_init(|| bending))
    }

    /// What a sight sees of the nominal specimen bent out of its plane.
    fn bent<T>(&self, sight: &PointSet, see: impl Fn(&Bending, &Observer) -> T) -> Result<T> {
        let bending = self.bending()?;
        if let Some(observer) = sight.observer() {
            return Ok(see(bending, observer));
        }
        let located = self.observer(&self.plate.mesh, &Seen::new(&[], &self.scene), sight);
        Ok(see(bending, &located))
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
        let setup = self.setup(state)?;
        let ply = self.scene.material.ply(&state.constants);
        let ply = setup.of_ply(ply).admissible("elastic constants")?;
        Ok((setup, ply))
    }

    /// Stages 1 and 2: the loaded specimen, `held` where its rigid motion matters before the gauge removes it.
    fn loaded(&self, about: Option<&Anchor>, state: &State, held: bool) -> Result<Solution<'_>> {
        let (setup, ply) = self.tested(state)?;
        let mut solution = match about {
            Some(anchor) => anchor.solve_near(&self.plate, &setup, &ply)?,
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

    /// The camera's report, of a solution near an anchor's where there is one. Where the points lie on a mesh and in a picture that are not the
    /// nominal ones is found once and left in `located`.
    fn seen(
        &self,
        about: Option<&Anchor>,
        state: &State,
        (sight, located): (&PointSet, &mut Option<Observer>),
        gradient: bool,
    ) -> Result<CameraField> {
        let camera = Seen::new(state.acting(), &self.scene).moved(self.motion());
        // what optics make of a rotation depends on the rotation; a plain camera reports it as it is
        let solution = self.loaded(about, state, gradient || !camera.is_plain())?;
        let own = sight
            .observer()
            .filter(|_| solution.is_nominal() && camera.is_plain());
        let observer = match own {
            Some(observer) => observer,
            None => located.get_or_insert_with(|| self.observer(&solution.mesh, &camera, sight)),
        };
        let mut loaded = observer.displacement(&solution.nodal);
        if let Some((smoothing, share)) = self.smoothing(state) {
            let added = smoothing.added(&solution.nodal, (sight, observer));
            add_scaled(&mut loaded, &added, share);
        }
        let displacement = if camera.is_plain() {
            loaded.clone()
        } else {
            let points = loaded.par_iter().zip(sight.all());
            points.map(|(u, &p)| camera.report_at_rest(p, *u)).collect()
        };
        let gradient = if gradient {
            observer.gradient(&solution.nodal)
        } else {
            Vec::new()
        };
        Ok(CameraField {
            displacement,
            loaded,
            gradient,
        })
    }

    /// How subsets average, and by how much more than the declared ones do they do so, where effects say so.
    fn smoothing(&self, state: &State) -> Option<(Smoothing<'_>, f64)> {
        let subsets = self.subsets()?;
        let acting = state.acting().iter();
        let share = acting.map(|a| a.effect.smoothing(&a.amplitude, subsets.power()));
        let smoothing = Smoothing {
            subsets,
            mesh: &self.plate.mesh,
            of_nodes: &self.of_nodes,
        };
        let lacking = subsets.lacking(share.sum());
        Some((smoothing, lacking)).filter(|(_, share)| *share != 0.0)
    }

    /// Where a sight's points lie on a mesh, as a camera shows them. Where an effect moves points into the hole or past an edge, the
    /// field is continued.
    fn observer(&self, mesh: &Mesh, camera: &Seen<'_>, sight: &PointSet) -> Observer {
        let places: Vec<[f64; 2]> = sight.all().iter().map(|&p| camera.true_point(p)).collect();
        let locator = Locator::new(mesh);
        match self.subsets().filter(|_| sight.is_correlated()) {
            Some(subsets) => subsets.observe(&places, &locator),
            None => locator.observe_extended(&places),
        }
    }

    /// Which places show the specimen: of subsets those that lie on it altogether or, where cut ones are kept, whose centres do.
    fn on_specimen(&self, locator: &Locator<'_>, places: &[[f64; 2]]) -> Vec<bool> {
        match self.subsets().filter(|s| !s.kept) {
            Some(subsets) => subsets.are_whole(places, locator),
            None => locator.holds(places),
        }
    }

    /// The subsets of an image correlation.
    fn subsets(&self) -> Option<Subsets> {
        self.test.images.as_ref().map(|i| i.subsets)
    }

    /// A basis as a sight's points see it, of tests like `setup`; of a subset its middle, which moves more than its average.
    fn view_of(&self, basis: Arc<SpanBasis>, setup: &Setup, sight: &PointSet) -> Result<View> {
        let mesh = self.plate.mesh_of(setup)?;
        let own = sight
            .observer()
            .filter(|_| matches!(mesh, Cow::Borrowed(_)) && !sight.is_correlated());
        let observer = own.cloned();
        let observer =
            observer.unwrap_or_else(|| Locator::new(&mesh).observe_extended(sight.all()));
        let motions = match &self.zero {
            Some(zero) => zero.motions(&mesh, sight),
            None => window_motions(&mesh, &observer, sight),
        };
        View::new(&self.plate, basis, &mesh, observer, motions)
    }

    /// What a nominal plate's displacements show under the gauge, by a plain camera.
    fn shown(&self, nodal: Vec<f64>, observer: &Observer, sight: &PointSet) -> Vec<[f64; 2]> {
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

impl Mechanics for FieldExperiment {
    fn scene(&self) -> &Scene {
        &self.scene
    }

    fn gauge(&self) -> Gauge {
        self.test.gauge
    }

    fn is_held(&self) -> bool {
        self.plate.is_held()
    }

    fn motion(&self) -> RigidMotion {
        let images = self.test.images.as_ref();
        images.map_or(RigidMotion::NONE, |i| i.motion)
    }

    fn shows(&self, state: &State, points: &[[f64; 2]]) -> Result<Vec<bool>> {
        let camera = Seen::new(state.acting(), &self.scene);
        let places: Vec<[f64; 2]> = points.iter().map(|&p| camera.true_point(p)).collect();
        let mesh = self.plate.mesh_of(&self.setup(state)?)?;
        Ok(self.on_specimen(&Locator::new(&mesh), &places))
    }

    fn added(&self, of: &dyn Effect, amplitude: &[f64], sight: &PointSet) -> Result<Vec<[f64; 2]>> {
        let Some(curvature) = of.curvature(amplitude) else {
            return Ok(in_closed_form(&self.scene, of, amplitude, sight));
        };
        self.bent(sight, |bending, observer| {
            bending.shown(curvature, observer, sight)
        })
    }

    fn off_axis(
        &self,
        effect: &dyn Effect,
        amplitude: &[f64],
        sight: &PointSet,
    ) -> Result<Option<Vec<f64>>> {
        let camera = self.scene.camera_distance_mm;
        let Some(curvature) = effect.curvature(amplitude).filter(|_| camera.is_some()) else {
            return Ok(None);
        };
        let all = self.bent(sight, |bending, observer| {
            bending.off_axis(curvature, observer)
        })?;
        Ok(Some(all[..sight.points().len()].to_vec()))
    }

    fn look(&self, state: &State, sight: &PointSet, gradient: bool) -> Result<CameraField> {
        self.seen(None, state, (sight, &mut None), gradient)
    }

    fn anchor(&self, about: &State, times: &[f64]) -> Result<Option<Anchor>> {
        let (setup, ply) = self.tested(about)?;
        Anchor::new(&self.plate, &setup, &ply, times).map(Some)
    }

    fn looks_near(
        &self,
        about: Option<&Anchor>,
        states: &[State],
        sight: &PointSet,
    ) -> Result<Vec<CameraField>> {
        let about = about.filter(|_| !self.test.full_order);
        let mut located = None;
        let look = |state| self.seen(about, state, (sight, &mut located), false);
        states.iter().map(look).collect()
    }

    fn softened(
        &self,
        about: Option<&Anchor>,
        state: &State,
        sight: &PointSet,
        softening: Softening<'_>,
    ) -> Result<Vec<Vec<[f64; 2]>>> {
        let Some(anchor) = about else {
            return Ok(Vec::new());
        };
        let (setup, ply) = self.tested(state)?;
        let ((mesh, fields), unit) = match softening {
            Softening::NearEdge => {
                let nominal = setup.load.axial / setup.width();
                (
                    anchor.near_edge(&self.plate, &setup, NEAR_EDGE_REACH, NEAR_EDGE_HARMONICS)?,
                    nominal,
                )
            }
            Softening::Bumps(bumps) => (anchor.softened(&self.plate, (&setup, &ply), bumps)?, 1.0),
        };
        let camera = Seen::new(state.acting(), &self.scene);
        let observer = self.observer(&mesh, &camera, sight);
        let seen = |nodal: &Vec<f64>| {
            let mut u = observer.displacement(nodal);
            u.iter_mut().flatten().for_each(|u| *u *= unit);
            // where the specimen stands still does not matter to a rival: without the rigid motion of the window
            gauged(Gauge::Window, sight, &u)
        };
        Ok(fields.iter().map(seen).collect())
    }

    fn edge_stress(&self, state: &State) -> Result<Option<EdgeStress>> {
        let (setup, ply) = self.tested(state)?;
        self.plate.edge_stress(&setup, &ply)
    }

    fn mesh_error(&self, state: &State) -> Result<Option<MeshError>> {
        let over = (self.test.window, self.test.density);
        mesh_error(&self.plate, &self.tested(state)?, over)
    }
}

impl Places for FieldExperiment {
    fn window(&self) -> [[f64; 2]; 2] {
        self.test.window
    }

    fn support(&self) -> &PointSet {
        &self.support
    }

    fn spread(&self, at_support: &[[f64; 2]], sight: &PointSet) -> Vec<[f64; 2]> {
        let mut nodal = vec![0.0; self.plate.mesh.unknowns()];
        for (&node, u) in self.nodes.iter().zip(at_support) {
            nodal[2 * node as usize] = u[0];
            nodal[2 * node as usize + 1] = u[1];
        }
        match sight.observer() {
            Some(observer) => observer.displacement(&nodal),
            None => self
                .observer(&self.plate.mesh, &Seen::new(&[], &self.scene), sight)
                .displacement(&nodal),
        }
    }

    fn locate(&self, points: &[[f64; 2]], further: &[[f64; 2]]) -> (PointSet, Vec<bool>) {
        let locator = Locator::new(&self.plate.mesh);
        let mut inside = self.on_specimen(&locator, &[points, further].concat());
        let on_plate = |points: &[[f64; 2]], inside: &[bool]| -> Vec<[f64; 2]> {
            let kept = points.iter().zip(inside).filter(|(_, inside)| **inside);
            kept.map(|(p, _)| *p).collect()
        };
        let further = on_plate(further, &inside[points.len()..]);
        inside.truncate(points.len());
        (self.extended(&on_plate(points, &inside), &further), inside)
    }

    fn extended(&self, points: &[[f64; 2]], further: &[[f64; 2]]) -> PointSet {
        let sight = PointSet::anywhere(points, further);
        let sight = match self.subsets() {
            Some(_) => sight.correlated(),
            None => sight,
        };
        let observer = self.observer(&self.plate.mesh, &Seen::new(&[], &self.scene), &sight);
        sight.with_observer(observer)
    }

    fn sight(&self, points: &[[f64; 2]]) -> PointSet {
        let sight = PointSet::anywhere(points, &[]);
        match self.subsets() {
            Some(_) => sight.correlated(),
            None => sight,
        }
    }
}

impl Spanning for FieldExperiment {
    fn plate_of(&self, test: &FieldTest) -> Option<Arc<Plate>> {
        let of = |test: &FieldTest| serde_json::json!([test.specimen, test.load, test.density]);
        let is_same = of(&self.test) == of(test);
        is_same.then(|| Arc::clone(&self.plate))
    }

    fn mesh_size(&self) -> [usize; 2] {
        [self.plate.mesh.elements.len(), self.plate.mesh.unknowns()]
    }

    fn span(&self, states: &[State]) -> Result<()> {
        if self.test.full_order {
            return Ok(());
        }
        let tests = states.iter().map(|state| self.tested(state));
        let tests = tests.collect::<Result<Vec<_>>>()?;
        fem::span(&self.plate, &tests, WORTH_A_BASIS)
    }

    fn view(&self, sight: &PointSet) -> Result<Option<View>> {
        let basis = self.plate.nominal_basis();
        basis
            .map(|basis| self.view_of(basis, &self.scene.setup, sight))
            .transpose()
    }

    fn certify(&self, states: &[State], sight: &PointSet) -> Result<Vec<Certificate>> {
        let mut views: Vec<View> = Vec::new();
        let mut certificates = Vec::new();
        for state in states {
            let (setup, ply) = self.tested(state)?;
            let Some(basis) = self.plate.basis_for(&setup, &ply) else {
                continue;
            };
            let known = views.iter().position(|v| Arc::ptr_eq(&v.basis, &basis));
            let known = known.unwrap_or(views.len());
            if known == views.len() {
                views.push(self.view_of(basis, &setup, sight)?);
            }
            certificates.extend(Certificate::of(&self.plate, &setup, &ply, &views[known])?);
        }
        Ok(certificates)
    }

    fn spanning(&self, sight: &PointSet) -> Vec<Vec<[f64; 2]>> {
        let (Some(basis), Some(observer)) = (self.plate.nominal_basis(), sight.observer()) else {
            return Vec::new();
        };
        let fields = (0..basis.size()).into_par_iter();
        let shown = |k: usize| self.shown(basis.vector(k), observer, sight);
        fields.map(shown).collect()
    }

    fn coordinates(&self, state: &State) -> Option<Answer> {
        if !Seen::new(state.acting(), &self.scene).is_plain() || self.smoothing(state).is_some() {
            return None;
        }
        let (setup, ply) = self.tested(state).ok()?;
        self.plate.coordinates(&setup, &ply)
    }

    fn drop_caches(&self) {
        self.plate.drop_caches();
    }
}

/// Predictions for a uniform plate from which a basis is worth it: it takes some fifteen solutions, and as long again for their bound.
const WORTH_A_BASIS: usize = 30;
