//! Numbers, dates, addresses and pictures as text.

/// A number that a person chose, such as a level: as short as it can be.
pub fn short(value: f64) -> String {
    format!("{}", (value * 1e6).round() / 1e6)
}

/// A level that was computed: two digits behind the point at most.
pub fn level(value: f64) -> String {
    short((value * 100.0).round() / 100.0)
}

/// A number for a table: three decimal places, fewer if it is large.
pub fn number(value: f64) -> String {
    match value.abs() {
        size if !size.is_finite() => "–".to_owned(),
        size if size >= 100.0 => format!("{value:.0}"),
        size if size >= 10.0 => format!("{value:.1}"),
        size if size >= 1.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

/// A share as a percentage.
pub fn percent(share: f64) -> String {
    format!("{:.0} %", share * 100.0)
}

/// A difference with its sign; one that is shown as zero has none.
pub fn signed(value: f64) -> String {
    let text = format!("{value:+.3}");
    if text.trim_start_matches(['+', '-']) == "0.000" { "0.000".to_owned() } else { text }
}

/// A difference of shares in points of percent with its sign; one that is shown as zero has none.
pub fn signed_percent(share: f64) -> String {
    let text = format!("{:+.0} %", share * 100.0);
    if text.trim_start_matches(['+', '-']) == "0 %" { "0 %".to_owned() } else { text }
}

/// A probability of a test.
pub fn p_value(p: f64) -> String {
    if p < 0.001 { "< 0.001".to_owned() } else { format!("{p:.3}") }
}

/// `1 scenario`, `2 scenarios`.
pub fn count(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

/// `1 scenario was`, `2 scenarios were`.
pub fn was(number: usize, noun: &str) -> String {
    format!("{} {}", count(number, noun), if number == 1 { "was" } else { "were" })
}

/// A point in time in universal time, to the minute. The calendar is counted in years that begin in March, because then
/// the day that comes and goes is the last one.
pub fn date(unix_seconds: u64) -> String {
    let (days, minutes) = (unix_seconds / 86_400, unix_seconds % 86_400 / 60);
    // Days since 1 March of the year 0, of which 146097 make four centuries.
    let days = days + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = era * 400 + year + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02} {:02}:{:02} UTC", minutes / 60, minutes % 60)
}

/// A relative path as an address in a page.
pub fn address(path: &str) -> String {
    let mut address = String::with_capacity(path.len());
    for byte in path.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' | b'/' => {
                address.push(char::from(byte));
            }
            _ => address += &format!("%{byte:02X}"),
        }
    }
    address
}

/// A JPEG picture as an address that holds it: base64 as in RFC 4648.
pub fn jpeg(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = "data:image/jpeg;base64,".to_owned();
    text.reserve(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let byte = |i: usize| u32::from(group.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for digit in 0..4 {
            match digit <= group.len() {
                true => text.push(char::from(DIGITS[(bits >> (18 - 6 * digit) & 63) as usize])),
                false => text.push('='),
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, expected) in [
            (0, "1970-01-01 00:00 UTC"),
            (951_782_399, "2000-02-28 23:59 UTC"),
            (951_782_400, "2000-02-29 00:00 UTC"),
            (1_795_225_303, "2026-11-21 01:41 UTC"),
            (4_107_542_400, "2100-03-01 00:00 UTC"),
        ] {
            assert_eq!(date(seconds), expected);
        }
    }

    #[test]
    fn pictures_are_base64() {
        let digits = |text: &str| jpeg(text.as_bytes()).split_once(',').unwrap().1.to_owned();
        for (text, expected) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(digits(text), expected);
        }
    }

    #[test]
    fn addresses_and_numbers() {
        assert_eq!(address("a b/ä%\"<.mp4"), "a%20b/%C3%A4%25%22%3C.mp4");
        assert_eq!([short(2.0), short(2.5), short(0.1 * 3.0)], ["2", "2.5", "0.3"]);
        assert_eq!(
            [number(0.0516), number(2.023), number(-31.26), number(314.6)],
            ["0.052", "2.02", "-31.3", "315"]
        );
        assert_eq!(number(f64::NAN), "–");
        assert_eq!([signed(0.25), signed(-0.25), signed(-0.0004)], ["+0.250", "-0.250", "0.000"]);
        assert_eq!(
            [signed_percent(0.1), signed_percent(-0.1), signed_percent(-0.004)],
            ["+10 %", "-10 %", "0 %"]
        );
        assert_eq!([p_value(0.0004), p_value(0.05)], ["< 0.001", "0.050"]);
        assert_eq!([count(1, "road"), count(0, "road")], ["1 road", "0 roads"]);
    }
}
