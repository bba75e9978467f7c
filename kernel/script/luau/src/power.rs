//! Refuses the uses of `^` whose result depends on the machine.
//!
//! Luau compiles `x ^ y` to the system's C function `pow`, and there is no way to replace that. With the exponents 2, 3
//! and 0.5 it multiplies or takes the square root instead, which is exact. So these are allowed, and everything
//! else has to be written `math.pow(x, y)`, which is the same everywhere.

use pdk_sdk::error::{Error, Result};

/// Checks a script.
///
/// # Errors
/// Names the first line with a use of `^` whose exponent is not 2, 3 or 0.5.
pub(super) fn check(script: &str, source: &[u8]) -> Result<()> {
    let mut scanner = Scanner { source, at: 0, line: 1 };
    // One entry per open brace: whether it is the brace of an expression inside of a `text {expression}`.
    let mut braces = Vec::new();
    while let Some(byte) = scanner.next() {
        match byte {
            b'-' if scanner.peek() == Some(b'-') => {
                scanner.at += 1;
                match scanner.long_bracket() {
                    Some(level) => scanner.skip_long(level),
                    None => scanner.skip_line(),
                }
            }
            b'[' => {
                scanner.at -= 1;
                match scanner.long_bracket() {
                    Some(level) => scanner.skip_long(level),
                    None => scanner.at += 1,
                }
            }
            b'"' | b'\'' => scanner.skip_text(byte),
            b'{' => braces.push(false),
            b'`' | b'}' => {
                // A text begins, or goes on behind an expression.
                let text = byte == b'`' || braces.pop() == Some(true);
                if text && scanner.skip_interpolated() {
                    braces.push(true);
                }
            }
            b'^' => {
                let line = scanner.line;
                if !scanner.exact_exponent() {
                    return Err(Error::new(format!(
                        "{script}:{line}: `^` takes the exponents 2, 3 and 0.5 only, because with others its result \
                         depends on the machine; write math.pow(x, y)"
                    )));
                }
            }
            _ => {}
        }
    }
    Ok(())
}

struct Scanner<'a> {
    source: &'a [u8],
    at: usize,
    line: usize,
}

impl Scanner<'_> {
    fn peek(&self) -> Option<u8> {
        self.source.get(self.at).copied()
    }

    fn next(&mut self) -> Option<u8> {
        let byte = self.peek()?;
        self.at += 1;
        self.line += usize::from(byte == b'\n');
        Some(byte)
    }

    fn skip_line(&mut self) {
        while self.peek().is_some_and(|byte| byte != b'\n') {
            self.at += 1;
        }
    }

    /// Reads `[[`, `[=[`, `[==[`, ... and returns the number of equals signs; stays where it is at anything else.
    fn long_bracket(&mut self) -> Option<usize> {
        let rest = self.source.get(self.at..)?.strip_prefix(b"[")?;
        let level = rest.iter().take_while(|&&byte| byte == b'=').count();
        (rest.get(level) == Some(&b'[')).then(|| {
            self.at += level + 2;
            level
        })
    }

    fn skip_long(&mut self, level: usize) {
        while let Some(byte) = self.next() {
            let rest = &self.source[self.at..];
            if byte == b']'
                && rest.len() > level
                && rest[..level].iter().all(|&byte| byte == b'=')
                && rest[level] == b']'
            {
                self.at += level + 1;
                return;
            }
        }
    }

    fn skip_text(&mut self, quote: u8) {
        while let Some(byte) = self.next() {
            match byte {
                b'\\' => {
                    self.next();
                }
                b'\n' => return, // Not closed; the compiler says so.
                byte if byte == quote => return,
                _ => {}
            }
        }
    }

    /// Skips to the end of an interpolated text, or behind the brace where an expression begins: then it is true.
    fn skip_interpolated(&mut self) -> bool {
        while let Some(byte) = self.next() {
            match byte {
                b'\\' => {
                    self.next();
                }
                b'{' => return true,
                b'`' => return false,
                _ => {}
            }
        }
        false
    }

    /// Whether what follows is 2, 3 or 0.5 and nothing that makes it another exponent.
    fn exact_exponent(&mut self) -> bool {
        while self.peek().is_some_and(|byte| byte.is_ascii_whitespace()) {
            self.next();
        }
        let start = self.at;
        while self.peek().is_some_and(|byte| byte.is_ascii_alphanumeric() || byte == b'.' || byte == b'_') {
            self.at += 1;
        }
        let exact = matches!(&self.source[start..self.at], b"2" | b"3" | b"0.5");
        while self.peek().is_some_and(|byte| byte.is_ascii_whitespace()) {
            self.next();
        }
        // `x ^ 2 ^ y` is `x ^ (2 ^ y)`.
        exact && self.peek() != Some(b'^')
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(source: &str) -> Option<String> {
        check("s.lua", source.as_bytes()).err().map(|error| error.to_string())
    }

    #[test]
    fn exact_exponents_are_allowed() {
        for source in ["x = y^2", "x = (a + b) ^ 0.5", "x ^ 3\n", "return x^2 + y^2", "x = y^2"] {
            assert_eq!(line(source), None, "{source}");
        }
    }

    #[test]
    fn others_are_refused_with_their_line() {
        for source in
            ["x ^ y", "x^2.5", "x^2^3", "x^-2", "x^(2)", "x ^= 2.1", "x^20", "x^2e3", "x ^ --[[ no ]] y"]
        {
            let source = format!("local a = 1\n{source}");
            assert!(line(&source).is_some_and(|error| error.starts_with("s.lua:2: `^` takes")), "{source}");
        }
        assert!(line("`{x ^ y}`").is_some());
        assert!(line("`{ {1} }` y = x ^ y").is_some());
        assert!(line("`a{ `b{x}` }` .. x^y").is_some());
    }

    #[test]
    fn texts_and_comments_are_not_code() {
        for source in [
            "x = '^' .. \"a\\\"^b\" -- x^y",
            "--[==[ x^y ]] x^y ]==] return 1",
            "x = [[ ^y ]] .. [=[ ]] ^y ]=]",
            "x = `x^y {1} ^y \\{^y`",
            "string.find(s, '^%s*')",
            "t[i] = 1 t[ [[^]] ] = 2",
        ] {
            assert_eq!(line(source), None, "{source}");
        }
    }
}
