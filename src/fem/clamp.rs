//! A clamped end: held still along its whole edge, and widened towards it by circular fillets if it is wider than
//! the plate.

/// A clamped end of the plate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clamp {
    /// Which end: 0 for s = high, 1 for s = low, as in [`super::Mesh::ends`].
    pub end: usize,
    /// Width of the plate at the clamp over its width elsewhere, at least 1.
    pub widening: f64,
    /// Radius of the fillets, mm; they touch the parallel part tangentially.
    pub fillet_radius: f64,
}

impl Clamp {
    /// How far from the clamp the fillets reach, mm, for a plate of width `width`.
    pub fn fillet_length(&self, width: f64) -> f64 {
        let rise = 0.5 * width * (self.widening - 1.0);
        let drop = (self.fillet_radius - rise).max(0.0);
        (self.fillet_radius.powi(2) - drop.powi(2)).max(0.0).sqrt()
    }

    /// Factor by which the plate of width `width` is wider at a distance from the clamp.
    pub fn factor(&self, width: f64, distance: f64) -> f64 {
        let along = self.fillet_length(width) - distance;
        if along <= 0.0 || self.fillet_radius == 0.0 {
            return 1.0;
        }
        let r = self.fillet_radius;
        let rise = r - (r * r - along * along).max(0.0).sqrt();
        1.0 + 2.0 * rise / width
    }
}
