//! The saliency maps that a perturbation may look back at.

use crate::error::{Error, Result};

/// The saliency maps of a sequence so far, at a low resolution: for what begins in one frame and goes on in later ones.
#[derive(Debug, Clone, Copy, Default)]
pub struct EarlierMaps<'a> {
    pub(crate) times: &'a [f64],
    pub(crate) values: &'a [f32],
    pub(crate) width: usize,
    pub(crate) height: usize,
}

impl<'a> EarlierMaps<'a> {
    /// Maps of `width` x `height` values, 0 to 1, one after the other, each in use since its time; the oldest comes first.
    ///
    /// # Errors
    /// If there are not as many values as that.
    pub fn new(times: &'a [f64], values: &'a [f32], width: usize, height: usize) -> Result<Self> {
        let length = width.checked_mul(height).and_then(|cells| cells.checked_mul(times.len()));
        if length != Some(values.len()) || (!times.is_empty() && values.is_empty()) {
            let (values, count) = (values.len(), times.len());
            return Err(Error::new(format!("{values} values cannot be {count} maps of {width}x{height}")));
        }
        Ok(Self { times, values, width, height })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.times.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
    }

    /// The place among them of the map that was in use at a time; the first one for times before it. Nothing if there are
    /// none.
    pub fn place_at(&self, time: f64) -> Option<usize> {
        let began = self.times.partition_point(|begin| *begin <= time);
        (!self.is_empty()).then(|| began.saturating_sub(1))
    }

    /// Width, height and values of one of them, row by row.
    ///
    /// # Panics
    /// If the place is not below [`EarlierMaps::len`].
    pub fn map(&self, place: usize) -> (usize, usize, &'a [f32]) {
        let cells = self.width * self.height;
        (self.width, self.height, &self.values[place * cells..][..cells])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_of_a_time_is_the_one_in_use_then() {
        let values = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
        let maps = EarlierMaps::new(&[0.0, 1.0, 2.5], &values, 2, 1).unwrap();
        let places = [-5.0, 0.0, 0.9, 1.0, 2.4, 9.0].map(|time| maps.place_at(time).unwrap());
        assert_eq!(places, [0, 0, 0, 1, 1, 2]);
        assert_eq!(maps.map(1), (2, 1, &values[2..4]));
        assert_eq!(EarlierMaps::default().place_at(1.0), None);
        assert!(EarlierMaps::new(&[0.0], &values, 2, 1).is_err());
        assert!(EarlierMaps::new(&[0.0], &[], 0, 0).is_err());
    }
}
