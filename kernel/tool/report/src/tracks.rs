//! Estimates with their intervals, a row for each perturbation, all on one scale.

use serde::Serialize;

use crate::color::Rgb;

/// A picture of estimates. Places are shares of its width.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tracks {
    /// What it shows.
    pub title: String,
    /// What its marks mean.
    pub note: String,
    /// What the scale measures.
    pub scale: String,
    /// Texts and places on the scale.
    pub ticks: Vec<(String, f64)>,
    /// From where on a mark says that the scale ends before the estimate, with the text for it.
    pub beyond: Option<(String, f64)>,
    /// A line through all rows with its text, such as what was measured without perturbation.
    pub reference: Option<(String, f64)>,
    /// Keys, names and colours if a row has several estimates; else empty.
    pub series: Vec<(String, String, Rgb)>,
    /// The rows, the worst first.
    pub rows: Vec<Row>,
}

/// A row.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The perturbation.
    pub label: String,
    /// An estimate of each series, as far as there is one.
    pub tracks: Vec<Option<Track>>,
}

/// An estimate with its interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Track {
    /// The place of the estimate; none if only the interval is known.
    pub at: Option<f64>,
    /// The ends of the interval.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
    /// Whether it goes on beyond the scale.
    pub is_open: bool,
    /// Whether the estimate lies on the scale, and not beyond.
    pub is_reached: bool,
    /// The estimate as text.
    pub text: String,
    /// Its interval as text.
    pub interval: String,
    /// All of it as a sentence.
    pub sentence: String,
}

/// Where the scale begins, and where it ends if nothing lies beyond.
const ENDS: (f64, f64) = (0.015, 0.985);
/// Where it ends if something may.
const BEYOND: f64 = 0.84;

/// The place of a value on a scale from 0 to `end`.
pub fn place(value: f64, end: f64, has_beyond: bool) -> f64 {
    let last = if has_beyond { BEYOND } else { ENDS.1 };
    let share = if end > 0.0 { (value / end).clamp(0.0, 1.0) } else { 0.0 };
    // Whole thousandths are short, and the same on any machine.
    ((ENDS.0 + share * (last - ENDS.0)) * 1000.0).round() / 1000.0
}

/// The place of what lies beyond the scale.
pub fn beyond() -> f64 {
    0.5 * (BEYOND + 1.0)
}

/// Where it begins.
pub fn limit() -> f64 {
    0.5 * (BEYOND + beyond())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_lie_in_order() {
        let places = [0.0, 1.0, 4.0, 9.0].map(|value| place(value, 4.0, true));
        assert!(places.is_sorted() && places[2] == places[3]);
        assert!(places[3] < limit() && limit() < beyond() && beyond() < 1.0);
        assert!(place(4.0, 4.0, false) > places[3]);
        assert!(place(1.0, 0.0, true).is_finite());
    }
}
