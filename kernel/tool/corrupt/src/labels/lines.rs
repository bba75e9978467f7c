//! Lines of points, such as those of lanes, as CULane has them: a line each, `x y x y ...` in pixels.

use pdk_labels::Labels;
use pdk_sdk::error::Result;

use super::text::{each_line, number, numbers, pairs};

/// Whether a text can be such a file.
pub fn fits(text: &str) -> bool {
    text.lines().all(|line| numbers(line).is_some_and(|numbers| numbers.len() % 2 == 0))
}

/// The lines of a perturbed picture. Points outside of it are left out, and lines of fewer than two points.
///
/// # Errors
/// If a perturbation cannot say where it moves things.
pub fn moved(text: &str, labels: &mut Labels<'_>) -> Result<String> {
    each_line(text, |_, content| {
        // The points are those of pixels, of which the first has its centre at 0, 0.
        let mut points = pairs(&numbers(content).unwrap_or_default());
        points.iter_mut().flatten().for_each(|place| *place += 0.5);
        labels.points(&mut points)?;
        points.retain(|point| labels.is_inside(*point));
        let pair = |[x, y]: &[f64; 2]| format!("{} {}", number(x - 0.5, 3), number(y - 0.5, 3));
        Ok((points.len() >= 2).then(|| points.iter().map(pair).collect::<Vec<_>>().join(" ")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_have_pairs_of_numbers() {
        assert!(fits("1 2 3 4.5\n5 6 7 8 9 10\n") && fits(""));
        assert!(!fits("1 2 3") && !fits("a b"));
    }
}
