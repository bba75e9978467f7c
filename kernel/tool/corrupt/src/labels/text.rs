//! Numbers and lines of texts.

use pdk_sdk::error::Result;

/// A number in a text, as short as it is exact to a thousandth of a pixel or so.
pub fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Rounds to a place behind the point, so that files do not say more than is known.
pub fn rounded(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}

/// Reads the numbers of a line.
pub fn numbers(line: &str) -> Option<Vec<f64>> {
    line.split_whitespace().map(|word| word.parse::<f64>().ok().filter(|number| number.is_finite())).collect()
}

/// The numbers of a list as points.
pub fn pairs(numbers: &[f64]) -> Vec<[f64; 2]> {
    numbers.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect()
}

/// Passes lines through a function that may leave them out.
pub fn each_line(
    text: &str,
    mut change: impl FnMut(usize, &str) -> Result<Option<String>>,
) -> Result<String> {
    let mut out = String::with_capacity(text.len());
    for (place, line) in text.lines().enumerate() {
        let kept = if line.trim().is_empty() { Some(line.to_owned()) } else { change(place + 1, line)? };
        if let Some(line) = kept {
            out += &line;
            out.push('\n');
        }
    }
    Ok(out)
}
