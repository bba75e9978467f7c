//! Boxes and polygons as YOLO has them: a line each, with a class and shares of the picture's width and height.

use pdk_labels::{Labels, area};
use pdk_sdk::error::{Error, Result};

use super::text::{each_line, number, numbers, pairs};

/// Numbers of a box: the class, its middle, its width and height.
const BOX: usize = 5;

/// Whether a text can be such a file: it has lines, all of them with a class and a box, or a polygon.
pub fn fits(text: &str) -> bool {
    let mut lines = text.lines().filter(|line| !line.trim().is_empty()).peekable();
    let of_label = |numbers: Vec<f64>| {
        let shares = numbers.iter().skip(1).all(|share| (-0.5..=1.5).contains(share));
        numbers.len() >= BOX && numbers[0] >= 0.0 && numbers[0].fract() == 0.0 && shares
    };
    // A picture in which there is nothing has an empty file.
    lines.all(|line| numbers(line).is_some_and(of_label))
}

/// The labels of a perturbed picture. What is visible to less than this share is left out.
///
/// # Errors
/// If a line is neither a box nor a polygon, or a perturbation cannot say where it moves things.
pub fn moved(text: &str, [width, height]: [usize; 2], labels: &mut Labels<'_>, least: f64) -> Result<String> {
    let (width, height) = (width as f64, height as f64);
    each_line(text, |line, content| {
        let found = numbers(content).unwrap_or_default();
        let class = content.split_whitespace().next().unwrap_or_default();
        let shares = |points: &[[f64; 2]]| -> String {
            let pair = |[x, y]: &[f64; 2]| format!(" {} {}", number(x / width, 6), number(y / height, 6));
            points.iter().map(pair).collect()
        };
        match found.len() {
            BOX => {
                let [x, y] = [found[1] * width, found[2] * height];
                let half = [found[3] * width / 2.0, found[4] * height / 2.0];
                let moved = labels.moved_box([x - half[0], y - half[1], x + half[0], y + half[1]])?;
                let [left, top, right, bottom] = moved.edges;
                if moved.visible < least || right <= left || bottom <= top {
                    return Ok(None);
                }
                let middle_and_size =
                    [[(left + right) / 2.0, (top + bottom) / 2.0], [right - left, bottom - top]];
                Ok(Some(format!("{class}{}", shares(&middle_and_size))))
            }
            count if count >= 7 && count % 2 == 1 => {
                let mut corners = pairs(&found[1..]);
                corners.iter_mut().for_each(|[x, y]| (*x, *y) = (*x * width, *y * height));
                let left = labels.polygon(&corners)?;
                labels.points(&mut corners)?;
                let (whole, left_over) = (area(&corners), area(&left));
                let gone = left.len() < 3 || left_over <= 0.0 || left_over < least * whole;
                Ok((!gone).then(|| format!("{class}{}", shares(&left))))
            }
            count => Err(Error::new(format!(
                "line {line} has {count} numbers, which is neither a box (5) nor a polygon (7, 9, ...); pdk does not move keypoints in such files"
            ))),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_and_polygons_are_distinguished_from_other_texts() {
        assert!(fits("0 0.5 0.5 0.25 1\n\n12 0.1 0.1 0.2 0.1 0.2 0.2\n") && fits(""));
        assert!(!fits("0 1 2 3 4") && !fits("cat\n") && !fits("0.5 0.1 0.1 0.1 0.1") && !fits("0 0.5"));
    }
}
