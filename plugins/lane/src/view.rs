//! From where the renderer looks.

/// The camera's place and directions on the ground, relative to the corner of the field.
pub struct View {
    /// x and z in metres.
    pub at: [f32; 2],
    /// One metre ahead.
    pub ahead: [f32; 2],
    /// One metre to the right.
    pub right: [f32; 2],
    /// Sine and cosine of the heading.
    pub direction: [f64; 2],
}
