//! Which recorded values are what the light was: those that the detector clips, above or below, are not.

use std::ops::RangeInclusive;

/// Frames of one component in one state: intensities of every pixel, frame after frame.
pub type StateFrames = Vec<Vec<u16>>;

/// Values that are not clipped.
#[derive(Debug)]
pub struct Clear(RangeInclusive<u16>);

/// A value at the end of all that occurs is the detector's limit where it occurs more often than this, and than the typical one of those
/// next to it times [`HEAP`].
const OFTEN: usize = 20;
const HEAP: usize = 5;
const NEXT: usize = 8;

impl Clear {
    /// By how often each value occurs: one end or both of those that do may be heaps. The largest value that pictures can hold, `full_scale`, and
    /// the smallest are limits in any case if they occur as the top or the bottom of a heap; full scale is one always.
    pub fn new(counts: &[usize], full_scale: u16) -> Self {
        let occurring: Vec<u16> = (0..=full_scale)
            .filter(|v| counts[usize::from(*v)] > 0)
            .collect();
        let heap = |mut ends: Box<dyn Iterator<Item = &u16> + '_>| -> Option<u16> {
            let end = *ends.next()?;
            // values of 12 bits leave gaps in 16: those that occur count
            let next: Vec<usize> = ends.take(NEXT).map(|v| counts[usize::from(*v)]).collect();
            let typical = next.iter().sum::<usize>() / next.len().max(1);
            (counts[usize::from(end)] > OFTEN.max(HEAP * typical)).then_some(end)
        };
        let top = heap(Box::new(occurring.iter().rev())).unwrap_or(full_scale);
        let low = heap(Box::new(occurring.iter())).map_or(0, |v| v.saturating_add(1));
        Self(low..=top.saturating_sub(1))
    }

    /// Whether a value is clipped at the top.
    pub fn is_saturated(&self, value: u16) -> bool {
        value > *self.0.end()
    }

    pub fn holds(&self, value: u16) -> bool {
        self.0.contains(&value)
    }

    /// Whether no frame of either state is clipped at a pixel.
    pub fn shows(&self, states: [&StateFrames; 2], pixel: usize) -> bool {
        let mut frames = states.iter().flat_map(|frames| frames.iter());
        frames.all(|f| self.holds(f[pixel]))
    }
}
