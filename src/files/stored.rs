//! Values as bytes, to the last bit: numbers in their own order of bytes, one after the other, without names.

use std::sync::Arc;

#[cfg(feature = "identify")]
use nalgebra::{DMatrix, DVector};

use super::Keyed;

/// What can be written as bytes and read back as the same value.
pub trait Stored: Sized {
    /// Append the bytes of the value.
    fn put(&self, out: &mut Vec<u8>);

    /// The value at the beginning of some bytes, which then begin behind it; none where they are those of no value.
    fn take(from: &mut &[u8]) -> Option<Self>;
}

/// The values of a struct, field by field.
macro_rules! stored {
    ($kind:ty { $($field:ident),* $(,)? }) => {
        impl $crate::files::Stored for $kind {
            fn put(&self, out: &mut Vec<u8>) {
                $($crate::files::Stored::put(&self.$field, out);)*
            }

            fn take(from: &mut &[u8]) -> Option<Self> {
                Some(Self { $($field: $crate::files::Stored::take(from)?),* })
            }
        }
    };
}
pub(crate) use stored;

/// Numbers by their bytes.
macro_rules! numbers {
    ($($kind:ty),*) => {
        $(impl Stored for $kind {
            fn put(&self, out: &mut Vec<u8>) {
                out.extend(self.to_le_bytes());
            }

            fn take(from: &mut &[u8]) -> Option<Self> {
                let (bytes, rest) = from.split_first_chunk()?;
                *from = rest;
                Some(Self::from_le_bytes(*bytes))
            }
        })*
    };
}
numbers!(u8, u64, f64);

impl Stored for usize {
    fn put(&self, out: &mut Vec<u8>) {
        (*self as u64).put(out);
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        u64::take(from)?.try_into().ok()
    }
}

impl Stored for bool {
    fn put(&self, out: &mut Vec<u8>) {
        out.push(u8::from(*self));
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        match u8::take(from)? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}

impl Stored for String {
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        out.extend(self.as_bytes());
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        let length = usize::take(from)?;
        let (bytes, rest) = from.split_at_checked(length)?;
        *from = rest;
        Self::from_utf8(bytes.to_vec()).ok()
    }
}

impl<T: Stored> Stored for Vec<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        self.iter().for_each(|value| value.put(out));
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        (0..usize::take(from)?).map(|_| T::take(from)).collect()
    }
}

impl<T: Stored> Stored for Option<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.is_some().put(out);
        self.iter().for_each(|value| value.put(out));
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        match bool::take(from)? {
            true => T::take(from).map(Some),
            false => Some(None),
        }
    }
}

impl<T: Stored, const N: usize> Stored for [T; N] {
    fn put(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|value| value.put(out));
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        let all: Option<Vec<T>> = (0..N).map(|_| T::take(from)).collect();
        all?.try_into().ok()
    }
}

impl<T: Stored> Stored for Arc<T> {
    fn put(&self, out: &mut Vec<u8>) {
        (**self).put(out);
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        T::take(from).map(Self::new)
    }
}

impl<T: Stored> Stored for Keyed<T> {
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        for (name, value) in self {
            name.put(out);
            value.put(out);
        }
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        Vec::<(String, T)>::take(from).map(|all| all.into_iter().collect())
    }
}

impl<A: Stored, B: Stored> Stored for (A, B) {
    fn put(&self, out: &mut Vec<u8>) {
        self.0.put(out);
        self.1.put(out);
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        Some((A::take(from)?, B::take(from)?))
    }
}

#[cfg(feature = "identify")]
impl Stored for DVector<f64> {
    fn put(&self, out: &mut Vec<u8>) {
        self.len().put(out);
        self.iter().for_each(|value| value.put(out));
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        Vec::take(from).map(Self::from_vec)
    }
}

#[cfg(feature = "identify")]
impl Stored for DMatrix<f64> {
    fn put(&self, out: &mut Vec<u8>) {
        [self.nrows(), self.ncols()].put(out);
        self.iter().for_each(|value| value.put(out));
    }

    fn take(from: &mut &[u8]) -> Option<Self> {
        let [rows, columns]: [usize; 2] = Stored::take(from)?;
        let count = rows.checked_mul(columns)?;
        let values: Option<Vec<f64>> = (0..count).map(|_| f64::take(from)).collect();
        Some(Self::from_vec(rows, columns, values?))
    }
}
