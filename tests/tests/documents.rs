//! The documents are true: what is generated is up to date, and what they point to is there.

use std::path::Path;

use pdk_core::modifiers;
use pdk_tests::{Pdk, repository};

#[test]
fn the_reference_is_up_to_date() {
    let folder = repository().join("docs/reference");
    Pdk::new(["reference", "--check"]).arg(&folder).succeed();
}

/// `PDK_BLESS=1` writes the table anew.
#[test]
fn the_readme_tells_of_the_modifiers() {
    const MARKS: [&str; 2] = ["<!-- modifiers -->\n", "<!-- end of modifiers -->"];
    let file = repository().join("README.md");
    let text = std::fs::read_to_string(&file).unwrap();
    let [start, end] = MARKS.map(|mark| text.find(mark).unwrap_or_else(|| panic!("README.md: no {mark}")));
    let (found, expected) = (&text[start + MARKS[0].len()..end], modifiers::markdown());
    if std::env::var_os("PDK_BLESS").is_some() {
        let before = &text[..start + MARKS[0].len()];
        std::fs::write(&file, format!("{before}{expected}{}", &text[end..])).unwrap();
    } else {
        assert_eq!(
            found, expected,
            "the table of modifiers in README.md is stale; run this with PDK_BLESS=1"
        );
    }
}

#[test]
fn every_perturbation_has_its_picture() {
    let folder = repository().join("docs/reference");
    for page in std::fs::read_dir(&folder).unwrap() {
        check_links(&page.unwrap().path());
    }
}

#[test]
fn what_the_documents_point_to_is_there() {
    for name in [
        "README.md",
        "ARCHITECTURE.md",
        "CONTRIBUTING.md",
        "CHANGELOG.md",
        "docs/speed.md",
        "docs/adapter.md",
        "docs/external-drivers.md",
        "docs/external-simulators.md",
        "docs/session-protocol.md",
        "docs/worker-protocol.md",
        "docs/python.md",
        "docs/generative.md",
        "docs/simulators/donkey.md",
        "docs/simulators/udacity.md",
    ] {
        check_links(&repository().join(name));
    }
}

/// Checks the relative links of a page of Markdown.
fn check_links(page: &Path) {
    let (Some(folder), true) = (page.parent(), page.extension().is_some_and(|ending| ending == "md")) else {
        return;
    };
    let text = std::fs::read_to_string(page).unwrap_or_else(|e| panic!("{}: {e}", page.display()));
    for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
        let target = target.split('#').next().unwrap_or_default();
        if target.is_empty() || target.starts_with("http") {
            continue;
        }
        let file = folder.join(target);
        assert!(file.exists(), "{} points to {target}, which is not there", page.display());
    }
}
