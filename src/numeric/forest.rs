//! Integers known relative to each other: disjoint sets whose members have offsets (union by size, path halving).

/// A forest of points, each with a whole offset relative to its parent.
pub(crate) struct Forest {
    parent: Vec<u32>,
    offset: Vec<i32>,
    size: Vec<u32>,
}

impl Forest {
    pub(crate) fn new(count: usize) -> Self {
        Self {
            parent: (0..count as u32).collect(),
            offset: vec![0; count],
            size: vec![1; count],
        }
    }

    /// The root of a point's set, and the offset of the point from it.
    pub(crate) fn root(&mut self, point: u32) -> (u32, i32) {
        let mut at = point as usize;
        let mut total = 0;
        while self.parent[at] as usize != at {
            let parent = self.parent[at] as usize;
            self.offset[at] += self.offset[parent];
            self.parent[at] = self.parent[parent];
            total += self.offset[at];
            at = self.parent[at] as usize;
        }
        (at as u32, total)
    }

    /// Declare that `second` lies `step` above `first`, unless they are in one set already.
    pub(crate) fn join(&mut self, first: u32, second: u32, step: i32) {
        let ((a, above_a), (b, above_b)) = (self.root(first), self.root(second));
        if a == b {
            return;
        }
        // offset of root b from root a
        let between = above_a + step - above_b;
        let (parent, child, offset) = if self.size[a as usize] >= self.size[b as usize] {
            (a, b, between)
        } else {
            (b, a, -between)
        };
        self.parent[child as usize] = parent;
        self.offset[child as usize] = offset;
        self.size[parent as usize] += self.size[child as usize];
    }

    /// Points in the set of a root.
    pub(crate) fn size(&self, root: u32) -> usize {
        self.size[root as usize] as usize
    }
}
