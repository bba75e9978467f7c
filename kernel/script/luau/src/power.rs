//! Refuses the uses of `^` whose result depends on the machine.
//!
//! Luau compiles `x ^ y` to the system's C function `pow`, and there is no way to replace that. With the exponents 2, 3
//! and 0.5 it multiplies or takes the square root instead, which is exact. So these are allowed, and everything
//! else has to be written `math.pow(x, y)`, which is the same everywhere.

use pdk_sdk::error::{Error, Result};

use crate::tokens::{Token, Tokens};

/// Checks a script.
///
/// # Errors
/// Names the first line with a use of `^` whose exponent is not 2, 3 or 0.5.
pub(super) fn check(script: &str, source: &[u8]) -> Result<()> {
    let mut tokens = Tokens::new(source);
    while let Some(token) = tokens.next() {
        if matches!(token, Token::Sign(b'^')) && !is_exact(tokens.clone()) {
            return Err(Error::new(format!(
                "{script}:{}: `^` takes the exponents 2, 3 and 0.5 only, because with others its result depends on the machine; \
                 write math.pow(x, y)",
                tokens.line()
            )));
        }
    }
    Ok(())
}

/// Whether what follows is 2, 3 or 0.5 and nothing that makes it another exponent.
fn is_exact(mut tokens: Tokens<'_>) -> bool {
    let rest = tokens.rest().trim_ascii_start();
    let is_of_number = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'_');
    let (number, rest) = rest.split_at(rest.iter().take_while(|byte| is_of_number(byte)).count());
    if !matches!(number, b"2" | b"3" | b"0.5") {
        return false;
    }
    tokens.skip_to(rest);
    // `x ^ 2 ^ y` is `x ^ (2 ^ y)`.
    !matches!(tokens.next(), Some(Token::Sign(b'^')))
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
        for source in [
            "x ^ y",
            "x^2.5",
            "x^2^3",
            "x^-2",
            "x^(2)",
            "x ^= 2.1",
            "x^20",
            "x^2e3",
            "x ^ --[[ no ]] y",
            "x ^ 2 --[[]] ^ 2",
        ] {
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
