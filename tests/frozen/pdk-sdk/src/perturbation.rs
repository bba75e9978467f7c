//! Perturbations: components that change a frame.

use pdk_ops::{Frame, FrameMut, Key, Random};

use crate::error::Result;

/// Changes a frame.
///
/// The output depends on the source frame, the parameters and the key in the context alone. It must not depend on
/// which frames were computed before, so that any frame of a recording can be computed again on its own; what an
/// instance keeps between calls is a cache (a lookup table, a workspace), never a state that changes the result.
pub trait Perturbation: Send {
    /// Writes the perturbed `src` to `dst`. Both have the same size; `dst` starts out with unspecified content, and all
    /// of it has to be written.
    ///
    /// # Errors
    /// Where the frame cannot be perturbed; the run records it and goes on with the next scenario.
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()>;
}

/// What a perturbation knows about the frame at hand.
pub struct Context<'a> {
    /// The intensity: 0 to 4, any real number in between.
    pub intensity: f64,
    /// The number of the frame in its sequence, from 0.
    pub frame_index: u64,
    /// Simulation time in seconds since the start of the sequence.
    pub time: f64,
    /// How much each pixel matters to the driver, 0 to 1, row by row, as large as the frame; where there is a saliency map.
    pub saliency: Option<&'a [f32]>,
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
            saliency: None,
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

    /// The same context in which [`Context::frame_random`] starts another stream than the frame's own. With the same
    /// stream for all frames, what is usually drawn for every frame is drawn once.
    pub fn with_stream(mut self, stream: u64) -> Self {
        self.stream = stream;
        self
    }

    /// The value of a parameter of this frame: what the user set, or what the intensity makes it.
    ///
    /// # Panics
    /// Where the description has no such parameter, which is a mistake in the plugin; the host reports it as an error.
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

    /// Random numbers that are the same for all frames of a sequence. Every call starts the stream from its beginning.
    pub fn sequence_random(&self) -> Random {
        self.key.sequence()
    }

    /// The key all random numbers of this instance come from.
    pub fn key(&self) -> &Key {
        self.key
    }
}
