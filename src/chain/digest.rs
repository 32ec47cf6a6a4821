//! Running digests of the arrays of a store.

/// A running digest that notices damage; no protection against malice.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Digest(pub u64);

impl Digest {
    #[inline]
    pub fn with(self, bits: u64) -> Self {
        Self((self.0.rotate_left(5) ^ bits).wrapping_mul(0x9E37_79B9_7F4A_7C15))
    }

    /// As it is written.
    pub fn hex(self) -> String {
        format!("{:016x}", self.0)
    }
}
