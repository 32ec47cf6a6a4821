//! What a plate of metal adds to its elastic displacements where it yields.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Arc, Mutex};

use nalgebra::Vector3;

use super::element;
use super::initial_stress::gauss_points;
use super::load::EndLoad;
use super::plastic_table::{Metal, PlasticTable, width};
use super::plasticity::{J2, von_mises};
use super::plate::Plate;
use super::setup::Setup;
use super::yielding::{Body, Walk};
use crate::error::{Error, Result, locked};
use crate::geometry::{HIGH, LOW, Mesh};
use crate::laminate::Ply;

/// A plate at a point of a history of loads.
#[derive(Debug)]
pub struct YieldFrame {
    /// Factor on the test's load.
    pub factor: f64,
    /// Nodal displacements, mm, rigid motion as the plate's supports leave it.
    pub nodal: Vec<f64>,
    /// The same less those of an elastic plate.
    pub plastic_part: Vec<f64>,
    /// Stresses (s11, s22, s12), MPa, at the 3 x 3 Gauss points of all elements, those of an element together, the second local coordinate
    /// running faster.
    pub stresses: Vec<Vector3<f64>>,
    /// Equivalent plastic strain there.
    pub equivalent: Vec<f64>,
}

/// The highest stress of an elastic plate at an edge that carries no load.
#[derive(Debug, Clone)]
pub struct EdgeStress {
    /// Von Mises stress, MPa.
    pub stress: f64,
    /// The edge's name.
    pub edge: String,
    /// Where, mm.
    pub place: [f64; 2],
}

/// Tables of the last meshes that were asked for: a loop makes its plates anew in every round, and a table takes as long as a round.
static TABLES: Mutex<Vec<(TableKey, Arc<PlasticTable>)>> = Mutex::new(Vec::new());

/// Tables that are kept: of a fine mesh and a coarse one.
const KEPT: usize = 2;

/// What a table is of.
#[derive(Clone, Copy, PartialEq)]
struct TableKey(u64);

impl TableKey {
    fn of(mesh: &Mesh, held: Option<&str>) -> Self {
        let mut hash = DefaultHasher::new();
        for place in mesh.nodes.iter().chain(&mesh.extents) {
            place.map(f64::to_bits).hash(&mut hash);
        }
        mesh.elements.hash(&mut hash);
        mesh.edges.hash(&mut hash);
        format!("{held:?} {:?}", mesh.boundary).hash(&mut hash);
        Self(hash.finish())
    }

    fn kept(self) -> Option<Arc<PlasticTable>> {
        let tables = locked(&TABLES);
        let own = tables.iter().find(|(of, _)| *of == self);
        own.map(|(_, table)| table.clone())
    }

    fn keep(self, table: &Arc<PlasticTable>) {
        let mut tables = locked(&TABLES);
        tables.truncate(KEPT - 1);
        tables.insert(0, (self, table.clone()));
    }
}

impl Plate {
    /// The table of plastic parts of the declared shape under an axial force, made when it is first asked for.
    ///
    /// # Errors
    /// Those of [`PlasticTable::new`]; of the program, for a mesh with regions, of which no table is made.
    pub fn plastic_table(&self) -> Result<Arc<PlasticTable>> {
        if self.assembly.stacks() > 1 {
            return Err(
                Error::program("Plate::plastic_table", "a plate of one stack")
                    .found(format!("one of {}", self.assembly.stacks())),
            );
        }
        let make = || {
            let of = TableKey::of(&self.mesh, self.held);
            if let Some(table) = of.kept() {
                return Ok(table);
            }
            let table = Arc::new(PlasticTable::new(&self.mesh, &|| self.factor())?);
            of.keep(&table);
            Ok(table)
        };
        self.plastic.get_or_init(make).clone()
    }

    /// Whether some of a test's metal yields. Threads that ask at once each find the onset, as each would solve for it.
    fn begins_to_yield(&self, setup: &Setup, metal: &Metal) -> Result<bool> {
        let onset = match self.onset.get() {
            Some(onset) => *onset,
            None => {
                let found = PlasticTable::onset_of(&self.mesh, &|| self.factor())?;
                *self.onset.get_or_init(|| found)
            }
        };
        let level = metal.level(setup.peak(), setup.thickness, width(&self.mesh));
        Ok(level > onset)
    }

    /// Add the tabulated plastic part of a test that yields: that of the declared shape under the axial force alone. What a morph, a taper
    /// or a skew load changes about it is of second order.
    ///
    /// # Errors
    /// Those of [`Plate::plastic_table`].
    pub(super) fn add_plastic(&self, setup: &Setup, ply: &Ply, nodal: &mut [f64]) -> Result<()> {
        let Some((share, metal)) = metal(setup, ply) else {
            return Ok(());
        };
        if !self.begins_to_yield(setup, &metal)? {
            return Ok(());
        }
        let table = self.plastic_table()?;
        if !table.reaches(setup.peak(), setup.thickness, &metal)
            && self.add_plastic_solved(setup, ply, nodal).is_ok()
        {
            return Ok(());
        }
        // a plate that does not come to rest is far from any that was measured
        let part = table.plastic(setup.peak(), setup.thickness, &metal);
        for (u, part) in nodal.iter_mut().zip(part) {
            *u += share * part;
        }
        Ok(())
    }

    /// The same without the table, for everything that the test's shape and load are.
    ///
    /// # Errors
    /// Those of [`Plate::yielding`].
    pub(super) fn add_plastic_solved(
        &self,
        setup: &Setup,
        ply: &Ply,
        nodal: &mut [f64],
    ) -> Result<()> {
        let Some((share, _)) = metal(setup, ply) else {
            return Ok(());
        };
        let mut loaded = setup.clone();
        if setup.peak() > setup.load.axial {
            // unloading is elastic
            loaded.load = match setup.load.axial {
                0.0 => EndLoad {
                    axial: setup.peak(),
                    ..EndLoad::default()
                },
                axial => setup.load.times(setup.peak() / axial),
            };
        }
        let frames = self.yielding(&loaded, ply, &[1.0], 1.0)?;
        for frame in frames {
            for (u, part) in nodal.iter_mut().zip(frame.plastic_part) {
                *u += share * part;
            }
        }
        Ok(())
    }

    /// Take the virgin plate of a test through factors on its load, one after the other, in increments `finer` times smaller than usual.
    /// Every increment follows the flow rule, on the way down as well.
    ///
    /// # Errors
    /// A test in which nothing yields; those of [`Plate::solve`]; a plate that does not come to rest.
    pub fn yielding(
        &self,
        setup: &Setup,
        ply: &Ply,
        factors: &[f64],
        finer: f64,
    ) -> Result<Vec<YieldFrame>> {
        let Some((_, metal)) = metal(setup, ply) else {
            return Err(Error::program(
                "Plate::yielding",
                "a test with a yield stress and yielding",
            ));
        };
        let (mut factor, solution) = self.factorised(setup, ply)?;
        let geometry = self.geometry.morphed(&setup.morph)?;
        let gauss = gauss_points(&solution.mesh);
        let stacks = setup.stacks();
        let thickness = gauss
            .iter()
            .map(|at| stacks[at.stack].1 * setup.profile.factor(&*geometry, at.place))
            .collect();
        let body = Body {
            law: J2 {
                young: metal.young,
                poisson: metal.poisson,
                yield_stress: metal.yield_stress,
                hardening: metal.hardening,
            },
            mesh: &solution.mesh,
            gauss: &gauss,
            thickness,
            elastic: solution.nodal,
        };
        let mut walk = Walk::new(&body, &mut factor, finer);
        let mut frames = Vec::with_capacity(factors.len());
        for &factor in factors {
            let loaded = walk.to(factor)?.clone();
            let pairs = body.elastic.iter().zip(&loaded.plastic_part);
            frames.push(YieldFrame {
                factor,
                nodal: pairs.map(|(e, p)| factor * e + p).collect(),
                stresses: body.stresses(&loaded),
                equivalent: loaded.flow.iter().map(|p| p.equivalent).collect(),
                plastic_part: loaded.plastic_part,
            });
        }
        Ok(frames)
    }

    /// The highest elastic von Mises stress along the edges that carry no load; none where the plate has none. Of a test that is isotropic.
    ///
    /// # Errors
    /// Those of [`Plate::solve`].
    pub fn edge_stress(&self, setup: &Setup, ply: &Ply) -> Result<Option<EdgeStress>> {
        let elastic = Setup {
            yielding: None,
            ..setup.clone()
        };
        let solution = self.solve(&elastic, ply)?;
        let law = J2 {
            young: ply.e1,
            poisson: ply.nu12,
            yield_stress: f64::INFINITY,
            hardening: 0.0,
        };
        Ok(highest(&solution.mesh, &solution.nodal, &law))
    }
}

/// Local coordinates of an element's nodes.
const NODES: [[f64; 2]; 8] = [
    [-1.0, -1.0],
    [1.0, -1.0],
    [1.0, 1.0],
    [-1.0, 1.0],
    [0.0, -1.0],
    [1.0, 0.0],
    [0.0, 1.0],
    [-1.0, 0.0],
];

/// The highest von Mises stress at the midside nodes of edges without load. The mean of a Q8 element's stress along its side is most accurate
/// there, and no two elements differ about it.
fn highest(mesh: &Mesh, nodal: &[f64], law: &J2) -> Option<EdgeStress> {
    let mut name_of = vec![None; mesh.nodes.len()];
    let free = mesh
        .edges
        .iter()
        .filter(|(name, _)| *name != LOW && *name != HIGH);
    for (name, edges) in free {
        for [_, middle, _] in edges {
            name_of[*middle as usize] = Some(name);
        }
    }
    let mut most: Option<EdgeStress> = None;
    for (e, nodes) in mesh.elements.iter().enumerate() {
        for (k, &node) in nodes.iter().enumerate().skip(4) {
            let Some(edge) = name_of[node as usize] else {
                continue;
            };
            let [a, b] = NODES[k];
            let (gradient, _) = element::physical_gradient(&mesh.corners(e), a, b);
            let mut strain = Vector3::zeros();
            for (g, &n) in gradient.iter().zip(nodes) {
                let [u, v] = [nodal[2 * n as usize], nodal[2 * n as usize + 1]];
                strain += Vector3::new(g[0] * u, g[1] * v, g[1] * u + g[0] * v);
            }
            let stress = von_mises(&law.stress(&strain));
            if most.as_ref().is_none_or(|m| stress > m.stress) {
                most = Some(EdgeStress {
                    stress,
                    edge: edge.clone(),
                    place: mesh.nodes[node as usize],
                });
            }
        }
    }
    most
}

/// The share of the plastic part that a test has, and its metal; none where nothing yields.
fn metal(setup: &Setup, ply: &Ply) -> Option<(f64, Metal)> {
    let yielding = setup.yielding?;
    Some((
        yielding.share,
        Metal {
            young: ply.e1,
            poisson: ply.nu12,
            yield_stress: yielding.stress,
            hardening: yielding.hardening * ply.e1,
        },
    ))
}
