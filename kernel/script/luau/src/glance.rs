//! What a script is, as far as its text says so: nothing of it is run.
//!
//! Perturbations, pipelines and the modules of pipelines lie side by side, and looking for the first must not run the others.
//! A perturbation sees neither `pdk` nor `require`, so a script that names one of them is a pipeline or belongs to one; and a
//! perturbation or a mask has a field of that name. What is in comments and texts does not count.

use crate::tokens::{Token, Tokens};

/// What a script is by its text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Glance {
    /// It names what only pipelines have.
    Pipeline,
    /// It may return a perturbation or a mask.
    Component,
    /// It has nothing that a component has.
    Other,
}

/// What only pipelines have.
const OF_PIPELINES: [&[u8]; 2] = [b"pdk", b"require"];
/// Fields of which a component has at least one.
const OF_COMPONENTS: [&[u8]; 3] = [b"apply", b"mask", b"doc"];

/// Looks at the text of a script.
pub(crate) fn glance(text: &[u8]) -> Glance {
    let mut found = Glance::Other;
    // The sign before the token: a field may have any name, and a key in brackets is a text.
    let mut before = b' ';
    for token in Tokens::new(text) {
        match token {
            Token::Name(name) if OF_PIPELINES.contains(&name) && before != b'.' && before != b':' => {
                return Glance::Pipeline;
            }
            Token::Name(name) if OF_COMPONENTS.contains(&name) => found = Glance::Component,
            Token::Text(text) if before == b'[' && OF_COMPONENTS.contains(&text) => found = Glance::Component,
            Token::Name(_) | Token::Text(_) | Token::Sign(_) => {}
        }
        before = if let Token::Sign(sign) = token { sign } else { b' ' };
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pipelines_and_what_they_require_name_what_only_they_have() {
        for text in [
            "local settings = pdk.settings({}) pdk.drive({})",
            "local drive = pdk['dri' .. 've'] return drive({})",
            "print('a') while true do end pdk.drive({})",
            "local m = require('./x') return { doc = 'x', apply = m.apply }",
            "print(`level {pdk.mean({1}).mean}`)",
            "local text = [==[ ]] ]==] pdk.show({})",
            "local t = { a = `{ { b = 1 }.b } {pdk}` }",
        ] {
            assert_eq!(glance(text.as_bytes()), Glance::Pipeline, "{text}");
        }
    }

    #[test]
    fn components_have_a_field_of_their_name() {
        for text in [
            "return { doc = 'Fog', apply = function(image) image:fill(1, 2, 3) end }",
            "-- Not what pdk.drive({}) does.\nreturn { mask = print }",
            "local text = 'pdk.drive(' local t = {} t.apply = print return t",
            "--[[ require('./x') ]] return { ['apply'] = print }",
            "function f(image) return image.pdk, image:require() end return { apply = f, note = `pdk` }",
        ] {
            assert_eq!(glance(text.as_bytes()), Glance::Component, "{text}");
        }
    }

    #[test]
    fn everything_else_is_something_else() {
        for text in [
            "",
            "while true do end",
            "return { once = function() end }",
            "print('apply', \"doc\")",
            "-- mask",
            "[[ doc",
        ] {
            assert_eq!(glance(text.as_bytes()), Glance::Other, "{text}");
        }
    }

    #[test]
    fn any_text_is_something() {
        let signs = b"a`{}[]='\"\\-\n";
        let mut text = [0; 5];
        for number in 0..signs.len().pow(text.len() as u32) {
            let mut rest = number;
            for byte in &mut text {
                *byte = signs[rest % signs.len()];
                rest /= signs.len();
            }
            (0..=text.len()).for_each(|length| assert_eq!(glance(&text[..length]), Glance::Other));
        }
    }
}
