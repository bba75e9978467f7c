//! The house stays as ARCHITECTURE describes it: the kernel proper is small, no two files of a crate import each other, and crates depend
//! one way. `cargo test --release --test product structure:: -- --nocapture` prints the lines of code of each crate.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use pdk_tests::repository;

/// The crates of the kernel proper, and the most lines of code that they may have together.
const KERNEL_PROPER: [&str; 7] = [
    "kernel/chain",
    "kernel/components",
    "kernel/loop",
    "kernel/notice",
    "kernel/record",
    "kernel/session",
    "kernel/supervise",
];
const MOST_LINES: usize = 9000;

/// The layers of crates, from top to bottom: a crate depends on none of a layer above its own.
const LAYERS: [&[&str]; 5] =
    [&["kernel/tool/"], &["product"], &["kernel/script/"], &KERNEL_PROPER, &["plugins/", "sdk/pdk-"]];

/// A source file of a crate without its tests.
struct Source {
    /// The path of its module, such as `["trace", "reading"]`; that of `lib.rs` is empty.
    module: Vec<String>,
    code: String,
}

#[test]
fn the_kernel_proper_is_small() {
    let mut total = 0;
    for folder in crates() {
        let lines: usize = sources(&folder).iter().map(|source| lines_of_code(&source.code)).sum();
        println!("{lines:6} {folder}");
        if KERNEL_PROPER.contains(&folder.as_str()) {
            total += lines;
        }
    }
    println!("{total:6} the kernel proper");
    assert!(total > 5000, "only {total} lines of the kernel proper were found");
    assert!(total <= MOST_LINES, "the kernel proper has {total} lines of code, more than {MOST_LINES}");
}

#[test]
fn no_two_files_of_a_crate_import_each_other() {
    let mut rings = Vec::new();
    for folder in crates() {
        let sources = sources(&folder);
        let modules: BTreeSet<_> = sources.iter().map(|source| source.module.clone()).collect();
        let passed_on = passed_on(&sources, &modules);
        let imports: BTreeMap<_, _> = sources
            .iter()
            .map(|source| (source.module.clone(), imports(source, &modules, &passed_on)))
            .collect();
        rings.extend(rings_of(&imports).into_iter().map(|ring| format!("{folder}: {}", ring.join(", "))));
    }
    assert!(rings.is_empty(), "these files import each other:\n{}", rings.join("\n"));
}

#[test]
fn crates_depend_on_none_of_a_layer_above() {
    let layer = |folder: &str| {
        LAYERS.iter().position(|layer| {
            layer
                .iter()
                .any(|start| folder == *start || start.ends_with(['/', '-']) && folder.starts_with(start))
        })
    };
    let folders: BTreeMap<_, _> = crates().into_iter().map(|folder| (name_of(&folder), folder)).collect();
    let mut checked = 0;
    for folder in folders.values() {
        let Some(own) = layer(folder) else { continue };
        for dependency in dependencies(folder) {
            let Some(below) = folders.get(&dependency) else { continue };
            let of_dependency = layer(below).unwrap_or_else(|| panic!("{below} is in no layer"));
            assert!(own <= of_dependency, "{folder} depends on {below}, which is in a layer above");
            let plugin = folder.starts_with("plugins/");
            assert!(
                !plugin || below.starts_with("sdk/"),
                "the plugin {folder} depends on {below}, which is not the SDK's"
            );
            checked += 1;
        }
    }
    assert!(checked > 100, "only {checked} dependencies were found");
}

/// Cargo compiles a crate a second time for its tests and runs its examples one by one, also if it has none. So those without say so.
#[test]
fn no_test_and_no_example_is_left_out() {
    let of_tests = ["altered", "frozen/plugin", "later", "misbehave", "planted", "stranger", "."];
    let mut left_out = Vec::new();
    for folder in crates().into_iter().chain(of_tests.map(|name| format!("tests/{name}"))) {
        let manifest = manifest(&folder);
        let library = manifest.split("\n[lib]\n").nth(1).unwrap_or_default();
        let library: Vec<_> = library.lines().take_while(|line| !line.starts_with('[')).collect();
        let mut files = Vec::new();
        collect(&repository().join(&folder).join("src"), &mut files);
        let code: Vec<_> = files.iter().map(|file| fs::read_to_string(file).unwrap()).collect();
        let has = |found: fn(&str) -> bool| code.iter().any(|code| found(code));
        let says = |line: &str| library.contains(&line);
        if has(|code| code.contains("#[test]")) && says("test = false") {
            left_out.push(format!("{folder} has tests"));
        }
        if has(has_example) && says("doctest = false") {
            left_out.push(format!("{folder} has examples"));
        }
    }
    assert!(left_out.is_empty(), "correct `[lib]` in their Cargo.toml:\n{}", left_out.join("\n"));
}

/// Whether comments for documentation have an example in Rust, or take one in.
fn has_example(code: &str) -> bool {
    let comments = code.lines().filter_map(|line| {
        let line = line.trim();
        line.strip_prefix("///").or_else(|| line.strip_prefix("//!"))
    });
    let fences = comments.filter_map(|line| line.trim().strip_prefix("```"));
    fences.step_by(2).any(|language| ["", "rust", "no_run", "should_panic"].contains(&language))
        || code.contains("doc = include_str!(\"../README.md\")")
}

/// The folders of the crates that are built for users.
fn crates() -> Vec<String> {
    let mut folders = vec!["product".to_owned()];
    for above in ["kernel", "kernel/script", "kernel/tool", "plugins", "sdk"] {
        for entry in fs::read_dir(repository().join(above)).unwrap() {
            let folder = entry.unwrap().path();
            if folder.join("Cargo.toml").is_file() {
                folders.push(folder.strip_prefix(repository()).unwrap().display().to_string());
            }
        }
    }
    folders.sort();
    folders
}

fn manifest(folder: &str) -> String {
    fs::read_to_string(repository().join(folder).join("Cargo.toml")).unwrap()
}

fn name_of(folder: &str) -> String {
    let manifest = manifest(folder);
    let line = manifest.lines().find_map(|line| line.strip_prefix("name = \"")).unwrap();
    line.trim_end_matches('"').to_owned()
}

/// The names in the section `[dependencies]`.
fn dependencies(folder: &str) -> Vec<String> {
    let manifest = manifest(folder);
    let section = manifest.split("\n[dependencies]\n").nth(1).unwrap_or_default();
    let lines = section.lines().take_while(|line| !line.starts_with('['));
    lines.filter_map(|line| Some(line.split_once([' ', '.'])?.0.to_owned())).collect()
}

fn sources(folder: &str) -> Vec<Source> {
    let root = repository().join(folder).join("src");
    let mut files = Vec::new();
    collect(&root, &mut files);
    let all: BTreeMap<_, _> =
        files.iter().map(|file| (module_of(&root, file), fs::read_to_string(file).unwrap())).collect();
    // A file that is declared as `#[cfg(test)] mod NAME;` is of tests, and so is what lies below it.
    let of_tests: Vec<Vec<String>> = all
        .iter()
        .flat_map(|(module, text)| {
            let declared = text.split("#[cfg(test)]\n").skip(1).filter_map(|rest| {
                let name =
                    rest.lines().next()?.trim().trim_start_matches("pub(crate) ").strip_prefix("mod ")?;
                name.strip_suffix(';')
            });
            declared.map(|name| [module.clone(), vec![name.to_owned()]].concat()).collect::<Vec<_>>()
        })
        .collect();
    all.into_iter()
        .filter(|(module, _)| !of_tests.iter().any(|tests| module.starts_with(tests)))
        .map(|(module, text)| Source { module, code: without_tests(&text).to_owned() })
        .collect()
}

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            files.push(path);
        }
    }
}

fn module_of(root: &Path, file: &Path) -> Vec<String> {
    let path = file.strip_prefix(root).unwrap().with_extension("");
    let mut module: Vec<_> = path.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    if module.last().is_some_and(|last| ["lib", "main", "mod"].contains(&last.as_str())) {
        module.pop();
    }
    module
}

/// A module of tests inside a file stands at its end.
fn without_tests(text: &str) -> &str {
    text.split("#[cfg(test)]\nmod tests {").next().unwrap()
}

/// Lines that are neither blank nor a comment.
fn lines_of_code(code: &str) -> usize {
    code.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("//")).count()
}

/// The names that files pass on from others with `pub use`, with the files that they come from.
type PassedOn = BTreeMap<(Vec<String>, String), Vec<String>>;

fn passed_on(sources: &[Source], modules: &BTreeSet<Vec<String>>) -> PassedOn {
    let mut found = PassedOn::new();
    for source in sources {
        let code = without_comments(&source.code);
        let statements = code.split(';').filter_map(|statement| {
            let (before, path) = statement.rsplit_once("use ")?;
            // Between the previous statement and the keyword there is only the visibility.
            before
                .trim()
                .rsplit(['}', '\n'])
                .next()
                .is_some_and(|word| word.starts_with("pub"))
                .then_some(path)
        });
        for path in statements.flat_map(paths) {
            if let Some((file, rest)) = place(&source.module, &path, modules)
                && let Some(name) = rest.first()
                && file != source.module
            {
                found.insert((source.module.clone(), name.clone()), file);
            }
        }
    }
    found
}

/// The modules from whose files a file takes something, without those that it declares itself. The root of a crate is not counted.
fn imports(source: &Source, modules: &BTreeSet<Vec<String>>, passed_on: &PassedOn) -> BTreeSet<Vec<String>> {
    let mut found = BTreeSet::new();
    for path in paths(&without_comments(&source.code)) {
        let Some((mut file, rest)) = place(&source.module, &path, modules) else { continue };
        while let Some(origin) = rest.first().and_then(|name| passed_on.get(&(file.clone(), name.clone()))) {
            file = origin.clone();
        }
        found.insert(file);
    }
    // A module consists of those that it declares, so it knows them.
    found.retain(|module| !module.starts_with(&source.module) && !module.is_empty());
    found
}

fn without_comments(code: &str) -> String {
    code.lines().filter(|line| !line.trim().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// The file that a path in a module leads to, and what it names in there. A module on the way may be written inside of another file, as a list
/// of its files.
fn place(
    module: &[String],
    path: &[String],
    modules: &BTreeSet<Vec<String>>,
) -> Option<(Vec<String>, Vec<String>)> {
    let mut rest = &path[1..];
    let mut at = match path.first()?.as_str() {
        "crate" => Vec::new(),
        "self" => module.to_vec(),
        "super" => module[..module.len().saturating_sub(1)].to_vec(),
        // A module that this file declares.
        name => {
            let child = [module, &[name.to_owned()]].concat();
            if !modules.contains(&child) {
                return None;
            }
            child
        }
    };
    while rest.first().is_some_and(|part| part == "super") {
        at.pop();
        rest = &rest[1..];
    }
    let mut found = modules.contains(&at).then(|| (at.clone(), rest));
    while let Some((part, behind)) = rest.split_first() {
        (at, rest) = ([at, vec![part.clone()]].concat(), behind);
        if modules.contains(&at) {
            found = Some((at.clone(), rest));
        } else if !modules.iter().any(|module| module.starts_with(&at)) {
            break;
        }
    }
    found.map(|(file, rest)| (file, rest.to_vec()))
}

/// All paths of a source, with the braces of imports written out.
fn paths(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let word = |c: char| c.is_alphanumeric() || c == '_';
    let mut rest = code;
    while let Some(start) = rest.find("::") {
        let head = rest[..start]
            .rfind(|c| !word(c))
            .map_or(0, |before| before + rest[before..].chars().next().map_or(1, char::len_utf8));
        let before = rest[head..start].to_owned();
        rest = &rest[start..];
        let (branches, used) = tail(rest);
        found.extend(branches.into_iter().map(|branch| [vec![before.clone()], branch].concat()));
        rest = &rest[used.max(2)..];
    }
    found
}

/// What follows a path's first word, from `::` on: its branches, and how many bytes they take.
fn tail(text: &str) -> (Vec<Vec<String>>, usize) {
    let Some(behind) = text.strip_prefix("::") else { return (vec![Vec::new()], 0) };
    if let Some(inside) = behind.strip_prefix('{') {
        let (mut branches, mut used) = (Vec::new(), 0);
        while let Some(left) = inside.get(used..).filter(|left| !left.is_empty() && !left.starts_with('}')) {
            let skip = left.len() - left.trim_start_matches([' ', '\n', '\t', ',']).len();
            if skip > 0 {
                used += skip;
                continue;
            }
            let length = left.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(left.len());
            let (of_word, more) = tail(&left[length..]);
            branches
                .extend(of_word.into_iter().map(|branch| [vec![left[..length].to_owned()], branch].concat()));
            used += (length + more).max(1);
        }
        return (branches, used + 4);
    }
    let length = behind.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(behind.len());
    if length == 0 {
        return (vec![Vec::new()], 2);
    }
    let (of_word, more) = tail(&behind[length..]);
    let branches =
        of_word.into_iter().map(|branch| [vec![behind[..length].to_owned()], branch].concat()).collect();
    (branches, 2 + length + more)
}

/// The sets of files each of which leads to all others of its set.
fn rings_of(imports: &BTreeMap<Vec<String>, BTreeSet<Vec<String>>>) -> BTreeSet<Vec<String>> {
    let reached = |from: &Vec<String>| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(module) = open.pop() {
            for next in imports.get(&module).into_iter().flatten() {
                if seen.insert(next.clone()) {
                    open.push(next.clone());
                }
            }
        }
        seen
    };
    let all: BTreeMap<_, _> = imports.keys().map(|module| (module, reached(module))).collect();
    let in_rings = all.iter().filter(|(module, seen)| seen.contains(**module));
    in_rings
        .map(|(module, seen)| {
            let back = seen.iter().filter(|other| all.get(other).is_some_and(|seen| seen.contains(*module)));
            back.map(|module| module.join("::")).collect()
        })
        .collect()
}

#[test]
fn paths_are_written_out_and_rings_are_found() {
    let code = "use crate::{a::X, b::{self, c::Y}};\nuse super::d;\nlet z = e::make();";
    let paths: Vec<_> = paths(code).into_iter().map(|path| path.join("::")).collect();
    assert_eq!(paths, ["crate::a::X", "crate::b::self", "crate::b::c::Y", "super::d", "e::make"]);
    let module = |name: &str| vec![name.to_owned()];
    let graph = |arrows: &[(&str, &str)]| {
        let mut imports: BTreeMap<_, BTreeSet<_>> = BTreeMap::new();
        for (from, to) in arrows {
            imports.entry(module(from)).or_default().insert(module(to));
        }
        rings_of(&imports)
    };
    assert!(graph(&[("a", "b"), ("b", "c"), ("a", "c")]).is_empty());
    assert_eq!(
        graph(&[("a", "b"), ("b", "c"), ("c", "a"), ("d", "a")]),
        BTreeSet::from([vec!["a".to_owned(), "b".to_owned(), "c".to_owned()]])
    );
}

#[test]
fn a_name_that_is_passed_on_comes_from_the_file_that_has_it() {
    let source = |module: &[&str], code: &str| Source {
        module: module.iter().map(|&part| part.to_owned()).collect(),
        code: code.to_owned(),
    };
    let sources = [
        source(&["a"], "mod b;\nmod c;\n\npub use b::B;\npub(crate) use self::c::{C, D};"),
        source(&["a", "b"], "use super::C;\npub struct B;"),
        source(&["a", "c"], "use super::B;\npub struct C;"),
        // Its module is written inside of the root.
        source(&["list", "d"], "use crate::a::D;\nuse super::e::E;"),
        source(&["list", "e"], "use crate::list::d;"),
    ];
    let modules: BTreeSet<_> = sources.iter().map(|source| source.module.clone()).collect();
    let passed_on = passed_on(&sources, &modules);
    let imports: BTreeMap<_, _> =
        sources.iter().map(|source| (source.module.clone(), imports(source, &modules, &passed_on))).collect();
    let ring = |files: [&str; 2]| files.map(str::to_owned).to_vec();
    assert_eq!(rings_of(&imports), BTreeSet::from([ring(["a::b", "a::c"]), ring(["list::d", "list::e"])]));
}
