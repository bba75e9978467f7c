//! How long a saliency map is used.

/// How long a saliency map is used before the next one is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// A map is made of every this many frames, and stays until the next: that of frame `i` is the one of frame
    /// `floor(i / every) * every`, or of the first one behind that where frames are left out.
    pub every: u64,
    /// A map stays until a frame differs from the map's own by more than this: the mean difference of all values from 0 to 255.
    pub change: Option<f64>,
    /// Whether a map moves with the image until the next one is made.
    pub follow: bool,
}

impl Pace {
    /// What is wrong with it; nothing if it can be kept to.
    pub fn mistake(&self) -> Option<&'static str> {
        if self.every == 0 {
            Some("a map of every 0 frames cannot be made")
        } else if self.change.is_some() && self.every != 1 {
            Some("a map stays either for a number of frames, `every`, or until a `change`")
        } else if self.change.is_some_and(|change| !(0.0..=255.0).contains(&change)) {
            Some("a change has to be from 0 to 255")
        } else if self.follow && self.every == 1 && self.change.is_none() {
            Some("a map that is made of every frame has nothing to follow; set `every` or `change` as well")
        } else {
            None
        }
    }
}
