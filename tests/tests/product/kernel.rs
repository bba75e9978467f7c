//! The kernel names no plugin: no text in it has the name of a component. What it has to know of one, the component's description says.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use pdk_product::PRODUCT;
use pdk_tests::{Pdk, repository};

/// Names that are English words too. They may stand in a sentence, but not alone, in quotes or before a parameter.
const WORDS: &[&str] =
    &["contrast", "folder", "gradient", "grid", "lane", "network", "pictures", "process", "random", "video"];

/// Names that are something else in one place: the name, the beginning of the path, and what it is there.
const OTHERWISE: &[(&str, &str, &str)] = &[
    ("contrast", "kernel/script/luau/src/image/", "a function of images in scripts"),
    ("defocus_blur", "kernel/script/luau/src/image/", "a function of images in scripts"),
    ("elastic", "kernel/script/luau/src/image/", "a function of images in scripts"),
    ("gaussian_noise", "kernel/script/luau/src/image/", "a function of images in scripts"),
    ("glass_blur", "kernel/script/luau/src/image/", "a function of images in scripts"),
    ("impulse_noise", "kernel/script/luau/src/image/", "a function of images in scripts"),
    ("motion_blur", "kernel/script/luau/src/image/", "a function of images in scripts"),
    ("pixelate", "kernel/script/luau/src/image/", "a function of images in scripts"),
    ("poisson_noise", "kernel/script/luau/src/image/", "a function of images in scripts"),
    ("zoom_blur", "kernel/script/luau/src/image/", "a function of images in scripts"),
    (
        "random",
        "kernel/script/luau/src/",
        "the argument of scripts that random numbers come from, and math.random",
    ),
    ("random", "kernel/script/pipeline/src/records/", "a field of `where`, and an argument as above"),
    ("folder", "kernel/tool/cli/src/verbs/corrupt.rs", "what stands for a folder in the help"),
    ("video", "kernel/tool/cli/src/verbs/", "the English word before the name of a file"),
    ("pictures", "kernel/script/pipeline/src/table.rs", "the English word behind a number"),
    ("pictures", "kernel/tool/cli/src/verbs/reference.rs", "a folder"),
    ("csv", "kernel/tool/", "the format, and the ending of its files"),
    ("segmentation", "kernel/tool/corrupt/", "a field of COCO's annotations"),
    ("segmentation", "kernel/script/pipeline/src/", "a kind of task"),
    ("random", "kernel/script/pipeline/src/api.rs", "a function of pipelines"),
    ("folder", "kernel/tool/cli/src/verbs/cache.rs", "a field of JSON"),
    ("folder", "kernel/tool/corrupt/", "a field of JSON"),
    ("pictures", "kernel/tool/corrupt/", "a field of JSON"),
    ("pictures", "kernel/tool/cli/src/verbs/corrupt.rs", "a field of JSON"),
    ("folder", "kernel/tool/cli/templates/dataset/", "a variable, and a word of documentation"),
    ("process", "kernel/tool/cli/templates/dataset/", "a module of Rust's library"),
    ("grid", "kernel/tool/report/src/template/", "a class of tables in CSS"),
    ("grid", "kernel/tool/watch/src/template/", "a layout of CSS"),
    ("video", "kernel/tool/watch/src/server.rs", "a media type"),
    ("gradient", "kernel/tool/report/src/", "a blend of colours in CSS"),
    ("gradient", "kernel/tool/cli/src/verbs/", "a verb, and what it writes"),
    ("onnx", "kernel/tool/cli/", "the format of networks, whose files `pdk show` shows"),
];

/// A text of the kernel: the file, the line, and what stands there.
struct Text {
    file: String,
    line: usize,
    text: String,
}

#[test]
fn no_text_of_the_kernel_names_a_component_or_a_plugin() {
    let names = names();
    assert!(names.len() > 100, "{names:?}");
    let (mut found, mut used) = (Vec::new(), BTreeSet::new());
    let texts = texts();
    assert!(texts.len() > 3000, "{} texts", texts.len());
    for Text { file, line, text } in &texts {
        let lower = text.to_lowercase();
        for name in &names {
            for at in words(&lower, name) {
                let otherwise =
                    OTHERWISE.iter().position(|(other, place, _)| other == name && file.starts_with(place));
                if WORDS.contains(&name.as_str()) && is_prose(&lower, at, name.len()) {
                    used.insert(name.clone());
                } else if let Some(place) = otherwise {
                    used.insert(place.to_string());
                } else {
                    found.push(format!("{file}:{line}: `{name}` in {text:?}"));
                }
            }
        }
    }
    assert!(found.is_empty(), "the kernel names components:\n{}", found.join("\n"));
    // What is no longer needed here goes.
    let unused: Vec<_> = WORDS.iter().filter(|word| !used.contains(**word)).collect();
    assert!(unused.is_empty(), "{unused:?} are not words of sentences in the kernel any more");
    let unused: Vec<_> = (0..OTHERWISE.len()).filter(|place| !used.contains(&place.to_string())).collect();
    assert!(unused.is_empty(), "{:?}", unused.iter().map(|place| OTHERWISE[*place]).collect::<Vec<_>>());
}

/// The names of all components, and of the libraries of the plugins.
fn names() -> BTreeSet<String> {
    let list = Pdk::new(["list", "--json"]).succeed();
    let list: serde_json::Value = serde_json::from_str(&list.stdout).unwrap();
    let components =
        list.as_array().unwrap().iter().map(|entry| entry["description"]["name"].as_str().unwrap());
    let plugins = PRODUCT
        .plugins
        .iter()
        .flat_map(|name| [format!("pdk_{name}"), format!("pdk-{name}"), format!("libpdk_{name}")]);
    components.map(str::to_owned).chain(plugins).collect()
}

/// Where a name stands as a word: not as a part of another one, not as the ending of a file, and not as a variable in braces.
fn words<'a>(text: &'a str, name: &'a str) -> impl Iterator<Item = usize> + 'a {
    let part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    text.match_indices(name).map(|(at, _)| at).filter(move |&at| {
        let (before, behind) = (text[..at].chars().next_back(), text[at + name.len()..].chars().next());
        !before.is_some_and(|c| part(c) || matches!(c, '.' | '{')) && !behind.is_some_and(part)
    })
}

/// Whether a word stands in a sentence.
fn is_prose(text: &str, at: usize, length: usize) -> bool {
    let (before, behind) = (&text[..at], &text[at + length..]);
    let begins = before.is_empty() || before.ends_with([' ', '(', '/', '>', '\n']);
    let goes_on = behind.is_empty()
        || behind.starts_with([' ', '.', ',', ';', ':', '!', '?', ')', '\'', '/', '\n', '\\']);
    begins && goes_on && text.trim().contains(' ')
}

/// All texts of the kernel that are not tests: literals of Rust, help in documentation comments of the command line, and the lines of all
/// that is built in, such as templates.
fn texts() -> Vec<Text> {
    let mut texts = Vec::new();
    for file in files(&repository().join("kernel")) {
        let path = file.strip_prefix(repository()).unwrap().display().to_string();
        let Ok(source) = std::fs::read_to_string(&file) else { continue };
        let ending = file.extension().unwrap_or_default();
        let is_test = file.file_stem().is_some_and(|stem| stem == "tests")
            || path.contains("/tests/")
            || is_module_of_tests(&file);
        if ending == "toml" || is_test {
            continue;
        }
        let mut add = |line, text: String| texts.push(Text { file: path.clone(), line, text });
        if ending == "rs" {
            // A module of tests stands at the end of its file.
            let source = source.split("#[cfg(test)]\nmod tests {").next().unwrap();
            literals(source).into_iter().for_each(|(line, text)| add(line, text));
            if path.starts_with("kernel/tool/cli/") {
                let help = source
                    .lines()
                    .enumerate()
                    .filter_map(|(at, line)| Some((at + 1, line.trim().strip_prefix("///")?)));
                help.for_each(|(line, text)| add(line, text.to_owned()));
            }
        } else {
            source.lines().enumerate().for_each(|(at, line)| add(at + 1, line.to_owned()));
        }
    }
    texts
}

/// Whether a file is declared as `#[cfg(test)] mod NAME;` beside it or above it.
fn is_module_of_tests(file: &Path) -> bool {
    let (Some(stem), Some(folder)) = (file.file_stem(), file.parent()) else { return false };
    let declared = format!("#[cfg(test)]\nmod {};", stem.to_string_lossy());
    let above = [folder.join("lib.rs"), folder.join("mod.rs"), folder.with_extension("rs")];
    above.iter().any(|file| std::fs::read_to_string(file).is_ok_and(|text| text.contains(&declared)))
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut entries: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for entry in entries {
        if entry.is_dir() { files.extend(self::files(&entry)) } else { files.push(entry) }
    }
    files
}

/// The literals of texts in a source of Rust, each with its line. Comments are none.
fn literals(source: &str) -> Vec<(usize, String)> {
    let bytes = source.as_bytes();
    let line = |at: usize| bytes[..at].iter().filter(|byte| **byte == b'\n').count() + 1;
    let (mut found, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        let rest = &source[at..];
        let hashes = rest.strip_prefix('r').map(|rest| rest.len() - rest.trim_start_matches('#').len());
        let in_word = at > 0
            && (bytes[at - 1].is_ascii_alphanumeric() && bytes[at - 1] != b'b' || bytes[at - 1] == b'_');
        if rest.starts_with("//") {
            at += rest.find('\n').unwrap_or(rest.len());
        } else if let Some(hashes) = hashes.filter(|hashes| !in_word && rest[1 + hashes..].starts_with('"')) {
            let start = at + hashes + 2;
            let end = format!("\"{}", "#".repeat(hashes));
            let length = source[start..].find(&end).unwrap();
            found.push((line(at), source[start..start + length].to_owned()));
            at = start + length + end.len();
        } else if rest.starts_with('"') {
            let mut end = at + 1;
            while bytes[end] != b'"' {
                end += if bytes[end] == b'\\' { 2 } else { 1 };
            }
            found.push((line(at), source[at + 1..end].to_owned()));
            at = end + 1;
        } else if let Some(character) = rest.strip_prefix('\'') {
            // A character, or else the name of a lifetime.
            let mut inside = character.char_indices();
            let escaped = character.starts_with('\\');
            let end = inside.nth(if escaped { 2 } else { 1 }).filter(|(_, c)| escaped || *c == '\'');
            at += 1 + end
                .map_or(0, |(place, _)| place + character[place..].find('\'').map_or(0, |more| more + 1));
        } else {
            at += rest.chars().next().map_or(1, char::len_utf8);
        }
    }
    found
}

#[test]
fn texts_are_found_and_comments_are_not() {
    let source = "// \"no\"\nlet a = \"one \\\" two\"; let c = '\"'; let l: &'a str = r#\"raw \"text\"\"#; let e = '\\''; f(b\"bytes\")";
    let texts: Vec<_> = literals(source).into_iter().map(|(_, text)| text).collect();
    assert_eq!(texts, ["one \\\" two", "raw \"text\"", "bytes"]);
    let places = |text: &'static str, name: &'static str| words(text, name).collect::<Vec<_>>();
    assert_eq!(places("lane lane_keeper a.lane `lane`", "lane"), [0, 25]);
    assert!(is_prose("left the lane.", 9, 4) && !is_prose("`lane`", 1, 4) && !is_prose("lane", 0, 4));
}
