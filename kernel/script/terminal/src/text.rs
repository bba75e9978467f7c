//! Texts as wide as the terminal.

use std::io::IsTerminal;

use terminal_size::{Width, terminal_size};

/// Lines longer than this are hard to read, however wide the terminal is.
const WIDEST: usize = 120;
/// Below this, a text is wrapped as if the terminal had this width.
const NARROWEST: usize = 40;

/// A text after a label, in lines that fit the terminal, of which those after the first are indented as wide as the label. A file or
/// another program gets it on one line.
pub fn wrapped(label: &str, text: &str) -> String {
    let width = terminal_size().filter(|_| std::io::stdout().is_terminal());
    match width {
        Some((Width(width), _)) => within(label, text, width.into()),
        None => format!("{label}{text}"),
    }
}

fn within(label: &str, text: &str, width: usize) -> String {
    let indent = " ".repeat(label.chars().count());
    let options = textwrap::Options::new(width.clamp(NARROWEST, WIDEST))
        .initial_indent(label)
        .subsequent_indent(&indent)
        .word_splitter(textwrap::WordSplitter::NoHyphenation);
    textwrap::fill(text, options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_text_is_wrapped_between_words_and_indented() {
        let text = "the range of pixel values that the network was trained on, 0..255 or 0..1";
        let lines = within("scale  ", text, 40);
        assert!(lines.starts_with("scale  the range") && lines.lines().count() > 1, "{lines}");
        assert!(lines.lines().skip(1).all(|line| line.starts_with("       ") && line.len() <= 40), "{lines}");
        let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        assert_eq!(words(&lines)[1..], words(text));
        // A terminal without a width is one of the least width.
        assert_eq!(within("scale  ", text, 0), lines);
    }
}
