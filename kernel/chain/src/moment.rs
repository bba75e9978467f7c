//! What is known of a frame besides its pixels.

/// What is known of a frame besides its pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment<'a> {
    /// The number of the frame in its sequence, from 0.
    pub frame_index: u64,
    /// Simulation time in seconds since the start of the sequence.
    pub time: f64,
    /// The vehicle's speed in metres per second, if it is known.
    pub speed: Option<f64>,
    /// How far the vehicle has driven since the start of the sequence, in metres, if it is known.
    pub travelled: Option<f64>,
    /// How long a frame lasts at the camera's rate, in seconds, if it is known.
    pub period: Option<f64>,
    /// Whether the frame counts for itself, as those of datasets do, which are looked at in any order: then nothing of other
    /// frames has an influence on what becomes of it.
    pub alone: bool,
    /// What its pixels show, if the simulator reports it.
    pub labels: Option<Labels<'a>>,
    /// How far away each pixel is in metres, row by row, if the simulator knows it and a component needs it.
    pub depth: Option<&'a [f32]>,
}

/// What the pixels of a frame show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Labels<'a> {
    /// What can be told apart.
    pub names: &'a [String],
    /// For each pixel the place of what it shows among the names, row by row.
    pub pixels: &'a [u8],
}

impl<'a> Moment<'a> {
    /// The moment of a frame of which nothing else is known.
    pub fn new(frame_index: u64, time: f64) -> Self {
        let (speed, travelled, period, labels, depth) = (None, None, None, None, None);
        Self { frame_index, time, speed, travelled, period, alone: false, labels, depth }
    }

    /// The moment of a frame that counts for itself.
    pub fn alone(self) -> Self {
        Self { alone: true, ..self }
    }

    /// The same moment at a speed.
    pub fn at_speed(self, speed: f64) -> Self {
        Self { speed: Some(speed), ..self }
    }

    /// The same moment this many metres from the start.
    pub fn after(self, metres: f64) -> Self {
        Self { travelled: Some(metres), ..self }
    }

    /// The same moment of a camera with this rate.
    pub fn at_rate(self, rate: f64) -> Self {
        Self { period: Some(1.0 / rate), ..self }
    }

    /// The same moment with what the pixels show.
    pub fn with_labels(self, labels: Option<Labels<'a>>) -> Self {
        Self { labels, ..self }
    }

    /// The same moment with how far away the pixels are.
    pub fn with_depth(self, depth: Option<&'a [f32]>) -> Self {
        Self { depth, ..self }
    }
}
