//! Tables with steering: a row for each frame, in the order of the frames. The columns with the steering are those whose numbers are
//! those of the frames, up to a factor. Their signs are changed, and the pictures of the left and the right camera change places, if there are
//! such columns. Nothing else is changed, so that the rest of the file stays as it was.

use std::ops::Range;

use pdk_sdk::error::{Error, Result};

/// Numbers that differ by less, as a share, are the same.
const SAME: f64 = 1e-9;

/// A row, with the places of its cells in the text.
struct Row {
    line: usize,
    cells: Vec<Range<usize>>,
}

/// The columns with the pictures of the cameras to the left and to the right.
type Sides = [usize; 2];

/// The table in which the steering of mirrored frames has the other sign. `steering` is that of each frame, not a number if a frame has
/// none. `mirrored` is asked for the frames that are steered, and for all if there are several cameras; it also gets what names the pictures
/// to the left and to the right.
///
/// # Errors
/// If the rows are not those of the frames, no column has the steering, or it is not clear which ones have it.
pub fn moved(
    text: &str,
    steering: &[f64],
    mirrored: &mut dyn FnMut(usize, &[&str]) -> Result<bool>,
) -> Result<String> {
    let Steered { rows, columns, sides } = steered(text, steering)?;
    let mut out = String::with_capacity(text.len() + rows.len());
    let mut written = 0;
    for (index, row) in rows.iter().enumerate() {
        let is_steered = steering[index].is_finite() && steering[index] != 0.0;
        let cells: Option<[Range<usize>; 2]> = sides.map(|sides| sides.map(|side| row.cells[side].clone()));
        let pictures: Vec<&str> = cells.iter().flatten().map(|cell| &text[cell.clone()]).collect();
        if !(is_steered || sides.is_some()) || !mirrored(index, &pictures)? {
            continue;
        }
        let mut changes: Vec<(Range<usize>, String)> = Vec::new();
        for column in columns.iter().filter(|_| is_steered) {
            let cell = row.cells[*column].clone();
            let turned = match text[cell.clone()].strip_prefix('-') {
                Some(positive) => positive.to_owned(),
                None => format!("-{}", text[cell.clone()].trim_start_matches('+')),
            };
            changes.push((cell, turned));
        }
        if let Some([left, right]) = cells {
            let (left_text, right_text) = (text[left.clone()].to_owned(), text[right.clone()].to_owned());
            changes.extend([(left, right_text), (right, left_text)]);
        }
        changes.sort_by_key(|(cell, _)| cell.start);
        for (cell, changed) in changes {
            out += &text[written..cell.start];
            out += &changed;
            written = cell.end;
        }
    }
    out += &text[written..];
    Ok(out)
}

/// Whether the steering of frames stands in a table, so that it can be moved. Returns whether it has pictures of cameras to the left and
/// to the right, too.
///
/// # Errors
/// As [`moved`].
pub fn check(text: &str, steering: &[f64]) -> Result<bool> {
    steered(text, steering).map(|steered| steered.sides.is_some())
}

/// What is changed in a table.
struct Steered {
    /// The rows of the frames.
    rows: Vec<Row>,
    /// The columns with their steering.
    columns: Vec<usize>,
    sides: Option<Sides>,
}

fn steered(text: &str, steering: &[f64]) -> Result<Steered> {
    let mut rows = rows(text)?;
    // A header has a row of its own.
    let header = (rows.len() == steering.len() + 1).then(|| rows.remove(0));
    if rows.len() != steering.len() {
        return Err(Error::new(format!(
            "it has {} rows, and the recording {} frames",
            rows.len(),
            steering.len()
        )));
    }
    let number = |row: &Row, column: usize| text.get(row.cells.get(column)?.clone())?.parse::<f64>().ok();
    let holds = |column: &usize| {
        let mut factor: Option<f64> = None;
        rows.iter().zip(steering).filter(|(_, steering)| steering.is_finite()).all(|(row, steering)| {
            let Some(recorded) = number(row, *column) else { return false };
            if recorded == 0.0 || *steering == 0.0 {
                return recorded == *steering;
            }
            let own = steering / recorded;
            let known = *factor.get_or_insert(own);
            (own - known).abs() <= SAME * known.abs()
        })
    };
    let count = rows.iter().map(|row| row.cells.len()).max().unwrap_or(0);
    let columns: Vec<usize> = (0..count).filter(holds).collect();
    // A throttle that never changes is in proportion to a steering that never does, so then the numbers cannot tell them apart.
    let mut turned = steering.iter().filter(|steering| steering.is_finite() && **steering != 0.0);
    let first = turned.next();
    let tells = turned.any(|steering| Some(steering) != first);
    match columns.as_slice() {
        [] => Err(Error::new("none of its columns has the steering of the frames")),
        [one, another, ..] if first.is_some() && !tells => {
            let title = |column: usize| match &header {
                Some(header) => header.cells.get(column).map_or("", |cell| &text[cell.clone()]).to_owned(),
                None => (column + 1).to_string(),
            };
            Err(Error::new(format!(
                "the steering never changes, so it could be column `{}` or column `{}`",
                title(*one),
                title(*another)
            )))
        }
        _ => {
            let sides = sides(text, header.as_ref(), &rows);
            Ok(Steered { rows, columns, sides })
        }
    }
}

/// The columns whose titles are `left` and `right`, or whose pictures all have names that begin so, as those of Udacity do.
fn sides(text: &str, header: Option<&Row>, rows: &[Row]) -> Option<Sides> {
    let columns = rows.iter().map(|row| row.cells.len()).min().unwrap_or(0);
    let of = |side: &str| {
        let begins = |cell: &Range<usize>| {
            let name = text[cell.clone()].rsplit(['/', '\\']).next().unwrap_or_default();
            name.to_ascii_lowercase().starts_with(side)
        };
        (0..columns).find(|column| {
            let title = header.and_then(|header| header.cells.get(*column));
            title.is_some_and(|title| text[title.clone()].eq_ignore_ascii_case(side))
                || rows.iter().all(|row| begins(&row.cells[*column]))
        })
    };
    Some([of("left")?, of("right")?])
}

/// The rows of a table: lines that are neither empty nor comments. The separator is the one that the first line has most of.
fn rows(text: &str) -> Result<Vec<Row>> {
    let start = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
    let first = text[start..].lines().next().unwrap_or_default();
    let separators = [',', ';', '\t'];
    let separator =
        separators.into_iter().max_by_key(|separator| (first.matches(*separator).count(), *separator == ','));
    let separator = separator.unwrap_or(',');
    let mut rows = Vec::new();
    let mut at = start;
    for (number, whole) in text[start..].split_inclusive('\n').enumerate() {
        let line = whole.trim_end_matches(['\r', '\n']);
        if !line.trim().is_empty() && !line.trim_start().starts_with('#') {
            let row = Row { line: number + 1, cells: cells(line, at, separator) };
            if line.matches('"').count() % 2 == 1 {
                return Err(Error::new(format!(
                    "line {} has a cell that goes on in the next line",
                    row.line
                )));
            }
            rows.push(row);
        }
        at += whole.len();
    }
    Ok(rows)
}

/// The places of the cells of a line, without quotes and space around them; the line begins at `at`.
fn cells(line: &str, at: usize, separator: char) -> Vec<Range<usize>> {
    let mut cells = Vec::new();
    let (mut start, mut quoted) = (0, false);
    let mut add = |start: usize, end: usize| {
        let cell = &line[start..end];
        let trimmed = cell.trim_matches(|c: char| c.is_whitespace() || c == '"');
        let before = cell.len() - cell.trim_start_matches(|c: char| c.is_whitespace() || c == '"').len();
        cells.push(at + start + before..at + start + before + trimmed.len());
    };
    for (place, c) in line.char_indices() {
        match c {
            '"' => quoted = !quoted,
            c if c == separator && !quoted => {
                add(start, place);
                start = place + c.len_utf8();
            }
            _ => {}
        }
    }
    add(start, line.len());
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_signs_of_the_steering_change_and_nothing_else() {
        let text = "\u{feff}image, time,\"angle\" ,gas\r\n# a comment\r\n\"a,b.png\", 1, 12.50 ,0.5\r\nc.png,2,-0.0,1\r\nd.png,3,\"-6.25\",0\r\n";
        let steering = [0.5, 0.0, -0.25];
        let mirrored = moved(text, &steering, &mut |_, _| Ok(true)).unwrap();
        assert_eq!(
            mirrored,
            "\u{feff}image, time,\"angle\" ,gas\r\n# a comment\r\n\"a,b.png\", 1, -12.50 ,0.5\r\nc.png,2,-0.0,1\r\nd.png,3,\"6.25\",0\r\n"
        );
        let one = moved(text, &steering, &mut |index, _| Ok(index == 2)).unwrap();
        assert_eq!(one, text.replace("-6.25", "6.25"));
        assert_eq!(
            moved(&mirrored, &steering.map(|steering| -steering), &mut |_, _| Ok(true)).unwrap(),
            text
        );
    }

    #[test]
    fn tables_without_a_header_and_without_some_labels_are_read() {
        let text = "a.png;0.5;1\nb.png;;2\nc.png;-0.5;3";
        let found = moved(text, &[-0.25, f64::NAN, 0.25], &mut |_, _| Ok(true)).unwrap();
        assert_eq!(found, "a.png;-0.5;1\nb.png;;2\nc.png;0.5;3");
    }

    #[test]
    fn pictures_to_the_left_and_to_the_right_change_places() {
        let own = "C:\\IMG\\center_1.jpg, C:\\IMG\\left_1.jpg, C:\\IMG\\right_1.jpg, -0.5, 1\n\
                   IMG/center_2.jpg,IMG/left_2.jpg,IMG/right_2.jpg,0,1\n";
        let mut asked = Vec::new();
        let mirrored = moved(own, &[-0.5, 0.0], &mut |index, sides| {
            asked.push((index, sides.join(" ")));
            Ok(true)
        });
        assert_eq!(
            mirrored.unwrap(),
            "C:\\IMG\\center_1.jpg, C:\\IMG\\right_1.jpg, C:\\IMG\\left_1.jpg, 0.5, 1\n\
             IMG/center_2.jpg,IMG/right_2.jpg,IMG/left_2.jpg,0,1\n"
        );
        assert_eq!(asked[1], (1, "IMG/left_2.jpg IMG/right_2.jpg".to_owned()));
        let titled = "right,angle,Left\na,0.5,b\n";
        assert_eq!(moved(titled, &[0.5], &mut |_, _| Ok(true)).unwrap(), "right,angle,Left\nb,-0.5,a\n");
        assert!(check(titled, &[0.5]).unwrap() && !check("c,angle\na,0.5\n", &[0.5]).unwrap());
    }

    #[test]
    fn the_steering_is_not_taken_for_another_column_that_is_like_it() {
        // The throttle of a drive that never steers straight may be constant, too.
        let text = "throttle,angle\n0.5,0.25\n0.5,0.25\n";
        let error = |text: &str, steering: &[f64]| {
            moved(text, steering, &mut |_, _| Ok(true)).unwrap_err().message().to_owned()
        };
        assert_eq!(
            error(text, &[0.25, 0.25]),
            "the steering never changes, so it could be column `throttle` or column `angle`"
        );
        assert!(error("0.5;x;0.25\n0;y;0", &[0.25, 0.0]).ends_with("column `1` or column `3`"));
        // A drive straight ahead has nothing to turn, and one with different steerings tells.
        assert_eq!(moved("0,0\n0,0", &[0.0, 0.0], &mut |_, _| Ok(true)).unwrap(), "0,0\n0,0");
        let both = moved("5,a,0.5,1\n-2,b,-0.2,1", &[0.5, -0.2], &mut |_, _| Ok(true)).unwrap();
        assert_eq!(both, "-5,a,-0.5,1\n2,b,0.2,1");
    }

    #[test]
    fn a_table_of_something_else_is_refused() {
        for (text, part) in [
            ("a.png,0.5\nb.png,0.1", "none of its columns has the steering"),
            ("a.png,0.5", "it has 1 rows, and the recording 2 frames"),
            ("a.png,0.5,\"x\nb.png\",0.5", "goes on in the next line"),
        ] {
            let error = moved(text, &[0.5, 0.25], &mut |_, _| Ok(true)).unwrap_err();
            assert!(error.message().contains(part), "{error}");
        }
    }
}
