//! The kinds of elements that are read.

/// Kinds of plane elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
pub enum Kind {
    /// Linear triangle.
    T3,
    /// Quadratic triangle.
    T6,
    /// Bilinear quadrilateral.
    Q4,
    /// Eight-node serendipity quadrilateral.
    Q8,
}

impl Kind {
    /// Number of corners, which is that of sides.
    pub fn corners(self) -> usize {
        match self {
            Kind::T3 | Kind::T6 => 3,
            Kind::Q4 | Kind::Q8 => 4,
        }
    }

    /// Number of nodes.
    pub fn nodes(self) -> usize {
        match self {
            Kind::T3 => 3,
            Kind::Q4 => 4,
            Kind::T6 => 6,
            Kind::Q8 => 8,
        }
    }

    /// Whether its sides have midside nodes.
    pub fn is_quadratic(self) -> bool {
        self.nodes() > self.corners()
    }

    /// The quadratic kind of the same shape.
    #[must_use]
    pub fn quadratic(self) -> Self {
        match self {
            Kind::T3 | Kind::T6 => Kind::T6,
            Kind::Q4 | Kind::Q8 => Kind::Q8,
        }
    }
}
