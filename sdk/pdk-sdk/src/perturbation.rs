//! Perturbations: components that change a frame.

use pdk_ops::warp::Affine;
use pdk_ops::{Frame, FrameMut};
use pdk_seed::{Key, Random};

use crate::error::{Error, Result};
use crate::history::History;

/// Changes a frame.
///
/// The output depends on the source frame, the parameters, the key in the context and the earlier frames in it alone. It must not depend on
/// which frames were computed before, so that any frame of a recording can be computed again on its own; what an
/// instance keeps between calls is a cache (a lookup table, a workspace), never a state that changes the result. A perturbation that needs
/// earlier frames asks for them with [`Description::history`](crate::describe::Description::history).
pub trait Perturbation: Send {
    /// Writes the perturbed `src` to `dst`. Both have the same size; `dst` starts out with unspecified content, and all
    /// of it has to be written.
    ///
    /// # Errors
    /// If the frame cannot be perturbed; the run records it and goes on with the next scenario.
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()>;

    /// Moves points as it moves the pixels of a frame of `size`, width and height, in the same context. A point is `[x, y]` in pixels, to
    /// the right and down from the centre of the first pixel, and may lie outside the frame; one that has nowhere to go becomes not a
    /// number.
    ///
    /// A perturbation that says it [moves geometry](crate::describe::Description::moves_geometry) has it; others do without.
    ///
    /// # Errors
    /// If it cannot say where the points go.
    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        size: [usize; 2],
        cx: &Context<'_>,
    ) -> Result<()> {
        let _ = (points, way, size, cx);
        Err(Error::new("it does not say where it moves things; implement `move_points`"))
    }
}

/// Which way points are moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// From the source frame to where the perturbed frame shows what is there: for corners, keypoints and lines.
    ToPerturbed,
    /// From the perturbed frame to the place in the source frame whose colour is seen there: for masks, pixel by pixel.
    ToSource,
}

impl Way {
    /// Moves points by the map by which the frame was warped, or back. A map that cannot be inverted leads nowhere.
    pub fn along(self, map: &Affine, points: &mut [[f64; 2]]) {
        match self {
            Self::ToPerturbed => points.iter_mut().for_each(|point| *point = map.at(*point)),
            Self::ToSource => {
                let back = map.inverse().unwrap_or(Affine([f64::NAN; 6]));
                points.iter_mut().for_each(|point| *point = back.at(*point));
            }
        }
    }
}

/// What a perturbation knows about the frame at hand.
pub struct Context<'a> {
    /// The intensity: 0 to 4, any real number in between.
    pub intensity: f64,
    /// The number of the frame in its sequence, from 0.
    pub frame_index: u64,
    /// Simulation time in seconds since the start of the sequence.
    pub time: f64,
    /// How far the vehicle has driven since the start of the sequence, in metres; if it is known.
    pub travelled: Option<f64>,
    /// How much each pixel matters to the driver, 0 to 1, row by row, as large as the frame; if there is a saliency map.
    pub saliency: Option<&'a [f32]>,
    /// The saliency maps of the sequence so far, this frame's among them; none if there are none.
    pub earlier: EarlierMaps<'a>,
    /// The frames before this one, if the description asks for any.
    pub history: History<'a>,
    pub(crate) key: &'a Key,
    /// The stream that [`Context::frame_random`] starts: the frame's own, unless the user wants the same draws in all.
    pub(crate) stream: u64,
    pub(crate) names: &'a [String],
    pub(crate) values: &'a [f64],
}

impl<'a> Context<'a> {
    /// A context made by hand, for tests and for hosts other than pdk.
    pub fn new(intensity: f64, frame_index: u64, time: f64, key: &'a Key) -> Self {
        Self {
            intensity,
            frame_index,
            time,
            travelled: None,
            saliency: None,
            earlier: EarlierMaps::default(),
            history: History::default(),
            key,
            stream: frame_index,
            names: &[],
            values: &[],
        }
    }

    /// The same context with parameter values, one for each name.
    pub fn with_values(mut self, names: &'a [String], values: &'a [f64]) -> Self {
        (self.names, self.values) = (names, values);
        self
    }

    /// The same context with the saliency map of the frame, and with those of the sequence so far.
    pub fn with_saliency(mut self, now: &'a [f32], earlier: EarlierMaps<'a>) -> Self {
        (self.saliency, self.earlier) = (Some(now), earlier);
        self
    }

    /// The same context with the frames before this one.
    pub fn with_history(mut self, history: History<'a>) -> Self {
        self.history = history;
        self
    }

    /// The same context in which [`Context::frame_random`] starts another stream than the frame's own. With the same
    /// stream for all frames, what is usually drawn for every frame is drawn once.
    pub fn with_stream(mut self, stream: u64) -> Self {
        self.stream = stream;
        self
    }

    /// The value of a parameter of this frame: what the user set, or what the intensity makes it.
    ///
    /// # Panics
    /// If the description has no such parameter, which is a mistake in the plugin; the host reports it as an error.
    pub fn number(&self, name: &str) -> f64 {
        match self.names.iter().position(|n| n == name).and_then(|i| self.values.get(i)) {
            Some(value) => *value,
            None => panic!("the description has no parameter `{name}`"),
        }
    }

    /// The value of a parameter, rounded to the nearest whole number.
    ///
    /// # Panics
    /// As [`Context::number`].
    pub fn integer(&self, name: &str) -> i64 {
        self.number(name).round() as i64
    }

    /// Whether a boolean parameter is set.
    ///
    /// # Panics
    /// As [`Context::number`].
    pub fn boolean(&self, name: &str) -> bool {
        self.number(name) != 0.0
    }

    /// Random numbers that are drawn anew for every frame. Every call starts the stream from its beginning.
    pub fn frame_random(&self) -> Random {
        self.key.frame(self.stream)
    }

    /// The random numbers that an earlier frame, or a later one, starts with [`Context::frame_random`]: for what has to be known of a frame
    /// while another one is perturbed, such as whether it was lost. If the user wants the same draws in all frames, they are this frame's.
    pub fn random_of(&self, frame_index: u64) -> Random {
        let stream = if self.stream == self.frame_index { frame_index } else { self.stream };
        self.key.frame(stream)
    }

    /// Random numbers that are the same for all frames of a sequence. Every call starts the stream from its beginning.
    pub fn sequence_random(&self) -> Random {
        self.key.sequence()
    }

    /// The key all random numbers of this instance come from.
    pub fn key(&self) -> &Key {
        self.key
    }
}

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
