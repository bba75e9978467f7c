//! The documents keep to docs/STYLE.md in what a program can find: the patterns that make a native reader stop.

use std::fs;

use pdk_tests::repository;

/// A pattern that docs/STYLE.md rules out.
struct Pattern {
    text: &'static str,
    /// Words right before the pattern with which it is good English.
    unless_after: &'static [&'static str],
    /// Words right after the pattern with which it is good English.
    unless_before: &'static [&'static str],
    remedy: &'static str,
}

const PATTERNS: [Pattern; 10] = [
    // "There is no driver `x`" and "it is no longer used" are good English, "it is no driver" is not.
    Pattern { unless_after: &["there"], unless_before: &["longer"], ..pattern("is no ", "write `is not a`") },
    Pattern { unless_after: &["there"], unless_before: &["longer"], ..pattern("are no ", "write `are not`") },
    Pattern { unless_before: &["that"], ..pattern("so many", "write `this many` or a noun with its number") },
    pattern("none where", "write `none if`"),
    pattern("nothing where", "write `nothing if`"),
    // In these cases "where" is a condition; a place has no "it" or "there" right after it at the start of a sentence.
    pattern("Where it", "write `If it`"),
    pattern("Where there is", "write `If there is`"),
    pattern("Where they", "write `If they`"),
    pattern("nobody", "say who, or write `none`"),
    pattern("is told", "a program reports, a callback is called with"),
];

const fn pattern(text: &'static str, remedy: &'static str) -> Pattern {
    Pattern { text, unless_after: &[], unless_before: &[], remedy }
}

/// The files and folders whose texts keep to the rules. `docs/STYLE.md` is missing because it quotes what it rules out, and
/// `docs/reference` because it is written from the components' descriptions.
const DOCUMENTS: [&str; 17] = [
    "README.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "docs/guide",
    "docs/simulators",
    "docs/adapter.md",
    "docs/drivers.md",
    "docs/external-drivers.md",
    "docs/external-simulators.md",
    "docs/generative.md",
    "docs/python.md",
    "docs/record.md",
    "docs/saliency.md",
    "docs/search.md",
    "docs/session-protocol.md",
    "docs/speed.md",
    "sdk",
];

#[test]
fn the_documents_are_in_plain_english() {
    let mut found = Vec::new();
    for document in DOCUMENTS {
        for page in pages(document) {
            let text = fs::read_to_string(repository().join(&page)).unwrap();
            for (line, pattern) in findings(&text) {
                found.push(format!("{page}:{line}: `{}`; {}", pattern.text, pattern.remedy));
            }
        }
    }
    assert!(found.is_empty(), "docs/STYLE.md rules these out:\n{}", found.join("\n"));
}

#[test]
fn a_pattern_is_found_in_a_sentence_and_not_in_code() {
    let lines = |text: &str| findings(text).iter().map(|(line, _)| *line).collect::<Vec<_>>();
    assert_eq!(lines("It is no plugin."), [1]);
    assert_eq!(lines("A line.\nAfter so\nmany worlds"), [2]);
    assert_eq!(lines("Where it cannot be read."), [1]);
    assert_eq!(lines("It is there, where it belongs. There is no driver `x`, so many that fail."), [0; 0]);
    assert_eq!(lines("```\nis no plugin\n```\n`is no plugin`\nis no plugin"), [5]);
    assert_eq!(lines("<!-- a -->\nis no plugin\n<!-- end of a -->\nis no plugin"), [4]);
}

/// The Markdown files of a folder, or the file itself.
fn pages(document: &str) -> Vec<String> {
    if document.ends_with(".md") {
        return vec![document.to_owned()];
    }
    let mut pages = Vec::new();
    for entry in fs::read_dir(repository().join(document)).unwrap() {
        let entry = entry.unwrap();
        let name = format!("{document}/{}", entry.file_name().to_str().unwrap());
        if entry.file_type().unwrap().is_dir() {
            pages.extend(self::pages(&name));
        } else if name.ends_with(".md") {
            pages.push(name);
        }
    }
    pages
}

/// The patterns in a text with the lines on which they begin, from 1.
fn findings(text: &str) -> Vec<(usize, &'static Pattern)> {
    let sentences = sentences(text);
    let mut found = Vec::new();
    for pattern in &PATTERNS {
        for (start, _) in sentences.match_indices(pattern.text) {
            let (before, after) = (&sentences[..start], &sentences[start + pattern.text.len()..]);
            let last = before.split_whitespace().next_back().unwrap_or_default().to_lowercase();
            let next = after.split_whitespace().next().unwrap_or_default();
            let in_a_word = before.ends_with(char::is_alphanumeric);
            if !in_a_word && !pattern.unless_after.contains(&&*last) && !pattern.unless_before.contains(&next)
            {
                // Sentences have as many bytes as the text.
                found.push((text[..start].matches('\n').count() + 1, pattern));
            }
        }
    }
    found.sort_by_key(|(line, _)| *line);
    found
}

/// The text on one line, with spaces in the place of code and of what is written by programs. Its bytes stay in their places.
fn sentences(text: &str) -> String {
    let mut sentences = String::new();
    let (mut in_block, mut in_code, mut generated) = (false, false, false);
    for line in text.split_inclusive('\n') {
        let fence = line.trim_start().starts_with("```");
        in_block ^= fence;
        // Code in a sentence ends with its paragraph at the latest.
        in_code &= !line.trim().is_empty();
        if line.starts_with("<!-- ") {
            generated =
                !line.starts_with("<!-- end of ") && text.contains(&line.replace("<!-- ", "<!-- end of "));
        }
        for sign in line.chars() {
            in_code ^= sign == '`' && !fence && !in_block;
            let read = !(in_block || fence || in_code || generated || sign == '\n');
            if read {
                sentences.push(sign);
            } else {
                sentences.extend(std::iter::repeat_n(' ', sign.len_utf8()));
            }
        }
    }
    sentences
}
