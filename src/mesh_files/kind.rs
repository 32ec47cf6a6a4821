//! The kinds of elements that are read.

/// Kinds of plane elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
pub enum ElementKind {
    /// Linear triangle.
    T3,
    /// Quadratic triangle.
    T6,
    /// Bilinear quadrilateral.
    Q4,
    /// Eight-node serendipity quadrilateral.
    Q8,
}

impl ElementKind {
    /// Number of corners, which is that of sides.
    pub fn corners(self) -> usize {
        match self {
            ElementKind::T3 | ElementKind::T6 => 3,
            ElementKind::Q4 | ElementKind::Q8 => 4,
        }
    }

    /// Number of nodes.
    pub fn nodes(self) -> usize {
        match self {
            ElementKind::T3 => 3,
            ElementKind::Q4 => 4,
            ElementKind::T6 => 6,
            ElementKind::Q8 => 8,
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
            ElementKind::T3 | ElementKind::T6 => ElementKind::T6,
            ElementKind::Q4 | ElementKind::Q8 => ElementKind::Q8,
        }
    }
}
