//! Numbers as the simulator writes and reads them: by the rules of the country that its computer is set to.

/// Reads a number with four decimals and maybe separators of thousands, as in `1,234.5000` or `1.234,5000`. There are always
/// decimals, so the last separator is the decimal one. None if it is not a number.
pub fn read(text: &str) -> Option<f64> {
    let decimal = text.rfind(['.', ',']);
    let plain: String = text
        .char_indices()
        .filter_map(|(place, c)| match c {
            '.' | ',' => (Some(place) == decimal).then_some('.'),
            // Blanks and apostrophes separate thousands in some countries.
            ' ' | '\u{a0}' | '\u{202f}' | '\'' | '\u{2019}' => None,
            '\u{2212}' => Some('-'),
            c => Some(c),
        })
        .collect();
    plain.parse().ok().filter(|number: &f64| number.is_finite())
}

/// Writes a number so that it is read alike everywhere: without a decimal separator, as in `-125e-3`. No digit is lost.
pub fn write(number: f64) -> String {
    let text = format!("{number:e}");
    let Some((digits, exponent)) = text.split_once('e') else { return text };
    let (whole, decimals) = digits.split_once('.').unwrap_or((digits, ""));
    let exponent = exponent.parse::<i64>().unwrap_or_default() - decimals.len() as i64;
    match exponent {
        0 => format!("{whole}{decimals}"),
        exponent => format!("{whole}{decimals}e{exponent}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_all_countries_are_read() {
        for (text, number) in [
            ("0.0213", 0.0213),
            ("-3,2500", -3.25),
            ("1,234.5000", 1234.5),
            ("1.234,5000", 1234.5),
            ("1\u{a0}234,5000", 1234.5),
            ("1\u{202f}234\u{202f}567,2500", 1_234_567.25),
            ("1'234.5000", 1234.5),
            ("\u{2212}3,2500", -3.25),
            ("12", 12.0),
            ("1E-05", 1e-5),
        ] {
            assert_eq!(read(text), Some(number), "{text}");
        }
        for text in ["", "none", "NaN", "1.2.x", "Infinity"] {
            assert_eq!(read(text), None, "{text}");
        }
    }

    #[test]
    fn what_is_written_has_no_separator_and_loses_nothing() {
        for (number, text) in [(0.0, "0"), (1.0, "1"), (-1.0, "-1"), (0.0625, "625e-4"), (-0.3, "-3e-1")] {
            assert_eq!(write(number), text);
        }
        for i in -1000..=1000 {
            let number = f64::from(i) / 997.0;
            let text = write(number);
            assert!(!text.contains(['.', ',']), "{text}");
            assert_eq!(text.parse::<f64>().unwrap(), number);
        }
    }
}
