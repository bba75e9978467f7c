//! Documents and sources keep to docs/STYLE.md in what a program can find: the patterns that make a native reader stop.

use std::fs;

use pdk_tests::repository;

/// A pattern that docs/STYLE.md rules out.
struct Pattern {
    text: &'static str,
    /// Whether it only counts in a sentence with a comma: "Where it fails, ..." is a condition, "Where it stands." is a place.
    in_a_condition: bool,
    /// Words right before the pattern with which it is good English.
    unless_after: &'static [&'static str],
    /// Words right after the pattern with which it is good English.
    unless_before: &'static [&'static str],
    remedy: &'static str,
}

const PATTERNS: [Pattern; 13] = [
    // "There is no driver `x`" and "it is no longer used" are good English, "it is no driver" is not.
    Pattern { unless_after: &["there"], unless_before: COMPARED, ..pattern("is no ", "write `is not a`") },
    Pattern { unless_after: &["there"], unless_before: COMPARED, ..pattern("are no ", "write `are not`") },
    Pattern {
        unless_before: &["that", "of", "as"],
        ..pattern("so many", "write `this many` or a noun with its number")
    },
    pattern("none where", "write `none if`"),
    pattern("nothing where", "write `nothing if`"),
    Pattern { in_a_condition: true, ..pattern("Where it", "write `If it`") },
    Pattern { in_a_condition: true, ..pattern("Where there is", "write `If there is`") },
    Pattern { in_a_condition: true, ..pattern("Where they", "write `If they`") },
    pattern("nobody", "say who, or write `none`"),
    pattern("Nobody", "say who, or write `none`"),
    pattern("somebody", "say who"),
    pattern("whoever", "say who"),
    pattern("is told", "a program reports, a callback is called with"),
];

/// "Is no better than" is good English.
const COMPARED: &[&str] = &["better", "brighter", "larger", "longer", "more"];

const fn pattern(text: &'static str, remedy: &'static str) -> Pattern {
    Pattern { text, in_a_condition: false, unless_after: &[], unless_before: &[], remedy }
}

/// The files and folders with documents.
const DOCUMENTS: [&str; 9] = [
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "docs",
    "plugins",
    "scripts",
    "sdk",
];
/// One quotes what it rules out, and the other is written from the components' descriptions, which are searched themselves.
const NOT_DOCUMENTS: [&str; 2] = ["docs/STYLE.md", "docs/reference"];

#[test]
fn the_documents_are_in_plain_english() {
    let mut found = Vec::new();
    let pages = DOCUMENTS.iter().flat_map(|document| files(document, &["md"]));
    for page in pages.filter(|page| NOT_DOCUMENTS.iter().all(|not| !page.starts_with(not))) {
        let text = fs::read_to_string(repository().join(&page)).unwrap();
        found.extend(findings(&sentences(&text)).iter().map(|finding| finding.shown(&page)));
    }
    assert!(found.is_empty(), "docs/STYLE.md rules these out:\n{}", found.join("\n"));
}

/// The folders with sources. Copies of earlier versions and inputs of tests stay as they are.
const SOURCES: [&str; 7] = ["kernel", "plugins", "sdk", "dist", "product", "scripts", "tests"];
const NOT_SOURCES: [&str; 5] = [
    "tests/frozen",
    "tests/golden",
    "tests/fuzz/corpus",
    "tests/fuzz/target",
    "tests/tests/product/english.rs",
];

#[test]
fn comments_and_messages_are_in_plain_english() {
    let mut found = Vec::new();
    let sources = SOURCES.iter().flat_map(|folder| files(folder, &["rs", "lua", "py"]));
    for source in sources.filter(|source| NOT_SOURCES.iter().all(|not| !source.starts_with(not))) {
        let text = fs::read_to_string(repository().join(&source)).unwrap();
        found.extend(findings(&prose(&text, &source)).iter().map(|finding| finding.shown(&source)));
        found.extend(odd_names(&text).into_iter().map(|name| format!("{source}: the name `{name}`")));
    }
    assert!(found.is_empty(), "docs/STYLE.md rules these out:\n{}", found.join("\n"));
}

#[test]
fn no_text_is_one_that_the_style_replaced() {
    let style = fs::read_to_string(repository().join("docs/STYLE.md")).unwrap();
    let replaced = replaced(&style);
    assert!(replaced.len() > 20, "{replaced:?}");
    let pages = DOCUMENTS.iter().flat_map(|document| files(document, &["md"]));
    let sources =
        SOURCES.iter().flat_map(|folder| files(folder, &["rs", "lua", "luau", "py", "pyi", "html"]));
    let mut found = Vec::new();
    for file in pages.chain(sources) {
        // Descriptions of components are searched where they are written.
        if NOT_DOCUMENTS.iter().chain(&NOT_SOURCES).any(|not| file.starts_with(not)) {
            continue;
        }
        let text = joined(&fs::read_to_string(repository().join(&file)).unwrap());
        let still = replaced.iter().filter(|replaced| replaced.is_in(&text));
        found.extend(still.map(|Replaced { before, .. }| format!("{file}: {before}")));
    }
    assert!(found.is_empty(), "docs/STYLE.md has better texts for these:\n{}", found.join("\n"));
}

/// A row of the tables of docs/STYLE.md, as [`joined`] writes it.
#[derive(Debug)]
struct Replaced {
    before: String,
    after: String,
}

impl Replaced {
    /// Whether a text has the one before. Some begin the one after, which does not count.
    fn is_in(&self, text: &str) -> bool {
        let after = self.after.find(&self.before);
        text.match_indices(&self.before).any(|(place, _)| {
            let is_after =
                |at: usize| place.checked_sub(at).is_some_and(|start| text[start..].starts_with(&self.after));
            !after.is_some_and(is_after)
        })
    }
}

/// The rows of the tables of docs/STYLE.md.
fn replaced(style: &str) -> Vec<Replaced> {
    let rows =
        style.lines().filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |")?.split_once(" | "));
    let rows = rows.map(|(before, after)| Replaced { before: joined(before), after: joined(after) });
    rows.filter(|row| row.before != "before").collect()
}

/// A text with one space between words, without the marks of comments and of continued lines, and with `{}` for each placeholder.
fn joined(text: &str) -> String {
    let mut words: Vec<&str> = Vec::new();
    for line in text.lines() {
        let line = line.trim().trim_end_matches('\\');
        let comment = ["///", "//!", "//", "---", "--", "#:", "#"];
        words.extend(
            comment.iter().find_map(|mark| line.strip_prefix(mark)).unwrap_or(line).split_whitespace(),
        );
    }
    let text = words.join(" ");
    let mut parts = text.split('{');
    let mut joined = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        // A placeholder has no spaces, a block of code or a table of Lua has.
        let rest = part.split_once('}').filter(|(name, _)| !name.contains(' ')).map(|(_, rest)| rest);
        joined.push_str(if rest.is_some() { "{}" } else { "{" });
        joined.push_str(rest.unwrap_or(part));
    }
    joined
}

#[test]
fn a_replaced_text_is_found_over_lines_and_with_other_placeholders() {
    let style = "| before | after |\n|---|---|\n| `{text}` is no part of a run | `{text}` is not a part of a run |\n\
                 | there are no pictures | there are no pictures; name one |\n";
    let replaced = replaced(style);
    assert_eq!(
        replaced.iter().map(|row| &*row.before).collect::<Vec<_>>(),
        ["`{}` is no part of a run", "there are no pictures"]
    );
    let finds = |row: usize, text: &str| replaced[row].is_in(&joined(text));
    assert!(finds(0, "/// If `{name:?}` is\n    /// no part of a run."));
    assert!(finds(
        0,
        "fn f() {\n    Error::new(format!(\"`{}` is no part \\\n         of a run; see {place}\"))\n}\n"
    ));
    assert!(finds(0, "--- `{x}` is no\n    --- part of a run"));
    assert!(!finds(0, "`{text}` is not a part of a run") && !finds(0, "`text` is no part of a run"));
    assert!(finds(1, "// there are no\n// pictures"));
    assert!(!finds(1, "\"there are no pictures; name one\""));
}

/// Names of test functions that are not plain sentences.
fn odd_names(source: &str) -> Vec<&str> {
    let names = source.lines().filter_map(|line| line.trim().strip_prefix("fn ")?.split_once("() {"));
    let names = names.map(|(name, _)| name);
    let odd = ["_is_no_", "_are_no_", "_is_said", "_is_told", "_are_said", "_are_told", "nobody", "so_many"];
    names.filter(|name| !name.contains("there_") && odd.iter().any(|odd| name.contains(odd))).collect()
}

#[test]
fn a_pattern_is_found_in_a_sentence_and_not_in_code() {
    let lines = |text: &str| findings(&sentences(text)).iter().map(|found| found.line).collect::<Vec<_>>();
    assert_eq!(lines("It is no plugin."), [1]);
    assert_eq!(lines("A line.\nAfter so\nmany worlds"), [2]);
    assert_eq!(lines("Where it cannot be read, it fails."), [1]);
    assert_eq!(lines("Where it stands. And so, on."), [0; 0]);
    assert_eq!(lines("It is there, where it belongs. There is no driver `x`, so many that fail."), [0; 0]);
    assert_eq!(lines("```\nis no plugin\n```\n`is no plugin`\nis no plugin"), [5]);
    assert_eq!(lines("<!-- a -->\nis no plugin\n<!-- end of a -->\nis no plugin"), [4]);
}

#[test]
fn a_pattern_is_found_in_a_comment_and_in_a_message_and_not_in_code() {
    let lines = |text: &str, file: &str| {
        findings(&prose(text, file)).iter().map(|found| found.line).collect::<Vec<_>>()
    };
    let source =
        "/// It is\n/// no plugin.\nlet nobody = is_told;\nError::new(\"it is no plugin\") // nobody\n";
    assert_eq!(lines(source, "a.rs"), [1, 4, 4]);
    assert_eq!(lines("x = 1 -- is no plugin\ny = nobody\n", "a.lua"), [1]);
    assert_eq!(lines("x = 1 # is no plugin\n\"\"\"Is told so.\"\"\"\nnobody = 1\n", "a.py"), [1]);
    assert_eq!(odd_names("fn a_file_is_said() {}\nfn there_is_no_way() {}"), ["a_file_is_said"]);
}

/// The files of a folder with one of these endings, or the file itself.
fn files(name: &str, endings: &[&str]) -> Vec<String> {
    let path = repository().join(name);
    if path.is_file() {
        let ending = path.extension().unwrap_or_default();
        return if endings.iter().any(|one| *one == ending) { vec![name.to_owned()] } else { Vec::new() };
    }
    let names = fs::read_dir(path).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let names = names.filter(|name| !name.starts_with('.') && name != "target");
    names.flat_map(|entry| files(&format!("{name}/{entry}"), endings)).collect()
}

/// A pattern that was found.
struct Finding {
    /// The line on which it begins, from 1.
    line: usize,
    pattern: &'static Pattern,
}

impl Finding {
    fn shown(&self, file: &str) -> String {
        format!("{file}:{}: `{}`; {}", self.line, self.pattern.text, self.pattern.remedy)
    }
}

/// The patterns in sentences whose line breaks are vertical tabs.
fn findings(sentences: &str) -> Vec<Finding> {
    let mut found = Vec::new();
    // With one space between words, and the place of each byte.
    let (mut words, mut places) = (String::new(), Vec::new());
    for (place, sign) in sentences.char_indices() {
        let sign = if sign.is_whitespace() { ' ' } else { sign };
        if sign != ' ' || !words.ends_with(' ') {
            words.push(sign);
            places.resize(words.len(), place);
        }
    }
    let not_in_a_word = |sign: char| !sign.is_alphanumeric();
    for pattern in &PATTERNS {
        for (start, _) in words.match_indices(pattern.text) {
            let (before, after) = (&words[..start], &words[start + pattern.text.len()..]);
            let word = |word: Option<&str>| word.unwrap_or_default().to_lowercase();
            let last = word(before.split(not_in_a_word).rfind(|part| !part.is_empty()));
            let next = word(after.split(not_in_a_word).find(|part| !part.is_empty()));
            let in_a_word = before.ends_with(char::is_alphanumeric);
            let sentence = after.split(". ").next().unwrap_or_default();
            let is_meant = !pattern.in_a_condition || sentence.contains(", ");
            if !in_a_word
                && is_meant
                && !pattern.unless_after.contains(&&*last)
                && !pattern.unless_before.contains(&&*next)
            {
                found.push(Finding { line: sentences[..places[start]].matches(BREAK).count() + 1, pattern });
            }
        }
    }
    found.sort_by_key(|found| found.line);
    found
}

/// Stands for a line break in sentences, which are otherwise on one line.
const BREAK: char = '\u{b}';

/// Stands for code, which is not searched.
const CODE: char = '\u{1}';

/// What a person reads of a source: its comments and texts.
fn prose(source: &str, file: &str) -> String {
    let comment = match file.rsplit('.').next() {
        Some("lua") => "--",
        Some("py") => "#",
        _ => "//",
    };
    let mut prose = String::new();
    for line in source.lines() {
        let (mut in_text, mut rest) = (false, line);
        while let Some(sign) = rest.chars().next() {
            if !in_text && rest.starts_with(comment) {
                let text = rest.trim_start_matches(['/', '!', '-', '#']);
                prose.push(' ');
                prose.push_str(&sentences(text));
                break;
            }
            in_text ^= sign == '"';
            let is_read = sign.is_whitespace() || in_text && sign != '"';
            prose.push(if is_read { sign } else { CODE });
            rest = &rest[sign.len_utf8()..];
        }
        prose.push(BREAK);
    }
    prose
}

/// The sentences of Markdown without code, and without what is written by programs.
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
            match sign {
                '\n' => sentences.push(BREAK),
                _ if in_block || fence || in_code || generated => sentences.push(CODE),
                _ => sentences.push(sign),
            }
        }
    }
    sentences
}
