//! Links: those of a page in Markdown, and those of a site.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use pdk_model::error::{Place, Result};
use walkdir::WalkDir;

/// Writes the relative links of a page anew: `change` is called with the file that a link names, and returns another one if it changes.
pub fn map(text: &str, mut change: impl FnMut(&str) -> Option<String>) -> String {
    let mut written = String::new();
    let mut in_code = false;
    for line in text.split_inclusive('\n') {
        in_code ^= line.starts_with("```");
        let mut parts = line.split("](");
        written += parts.next().unwrap_or_default();
        for part in parts {
            written += "](";
            let link = part.split(')').next().unwrap_or_default();
            let (file, heading) = link.split_at(link.find('#').unwrap_or(link.len()));
            let is_relative =
                !file.is_empty() && !file.contains("://") && !file.contains(' ') && part.contains(')');
            let changed = if in_code || !is_relative { None } else { change(file) };
            match changed {
                Some(file) => written += &format!("{file}{heading}{}", &part[link.len()..]),
                None => written += part,
            }
        }
    }
    written
}

/// The links of a site that lead nowhere, each with its page: to a file that is missing, or to a heading that its page lacks.
///
/// # Errors
/// If a page cannot be read.
pub fn dead(site: &Path) -> Result<Vec<String>> {
    let mut pages = BTreeMap::new();
    for entry in WalkDir::new(site).sort_by_file_name() {
        let path = entry.place(site.display())?.into_path();
        if path.extension().is_some_and(|ending| ending == "html") {
            let text = fs::read_to_string(&path).place(path.display())?;
            pages.insert(path, text);
        }
    }
    let names = |text: &str| attributes(text, "id").map(str::to_owned).collect::<BTreeSet<_>>();
    let names: BTreeMap<&PathBuf, _> = pages.iter().map(|(path, text)| (path, names(text))).collect();
    let mut dead = Vec::new();
    for (path, text) in &pages {
        // It says itself where it lies, for whatever address was not found.
        if path.ends_with("404.html") {
            continue;
        }
        for link in attributes(text, "href").chain(attributes(text, "src")) {
            let is_elsewhere = ["http:", "https:", "mailto:", "data:", "javascript:"]
                .iter()
                .any(|start| link.starts_with(start));
            if is_elsewhere || link.is_empty() {
                continue;
            }
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let file = file.split('?').next().unwrap_or_default();
            let target = match file {
                "" => path.clone(),
                _ => path.with_file_name("").join(file),
            };
            let target = target.canonicalize().unwrap_or(target);
            let has_heading = |names: &BTreeSet<String>| heading.is_empty() || names.contains(heading);
            let known = names.iter().find(|(page, _)| page.canonicalize().is_ok_and(|page| page == target));
            if !target.is_file() || known.is_some_and(|(_, names)| !has_heading(names)) {
                dead.push(format!("{}: {link}", path.strip_prefix(site).unwrap_or(path).display()));
            }
        }
    }
    dead.dedup();
    Ok(dead)
}

/// The values of an attribute in a page of HTML.
fn attributes<'a>(text: &'a str, name: &str) -> impl Iterator<Item = &'a str> {
    let start = format!(" {name}=\"");
    let starts: Vec<usize> = text.match_indices(&start).map(|(at, found)| at + found.len()).collect();
    starts.into_iter().filter_map(move |at| text[at..].split('"').next())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relative_links_are_written_anew_outside_of_code() {
        let text = "A [b](c/README.md#d) and ![e](f.png) and [g](https://h/README.md) and [i](#j).\n```\n[k](l)\n```\n[m](n)\n";
        let mut seen = Vec::new();
        let written = map(text, |file| {
            seen.push(file.to_owned());
            file.strip_suffix("README.md").map(|folder| format!("{folder}index.md"))
        });
        assert_eq!(seen, ["c/README.md", "f.png", "n"]);
        assert_eq!(written, text.replace("c/README.md", "c/index.md"));
    }

    #[test]
    fn dead_links_of_a_site_are_found() {
        let folder = std::env::temp_dir().join(format!("pdk-links-{}", std::process::id()));
        fs::create_dir_all(folder.join("a")).unwrap();
        fs::write(
            folder.join("index.html"),
            r##"<a href="a/b.html#there"> <a href="a/b.html#gone"> <a href="no.html"> <a href="#x">"##,
        )
        .unwrap();
        fs::write(
            folder.join("a/b.html"),
            r##"<h1 id="there"> <img src="../index.html"> <a href="https://example.org/x">"##,
        )
        .unwrap();
        assert_eq!(
            dead(&folder).unwrap(),
            ["index.html: a/b.html#gone", "index.html: no.html", "index.html: #x"]
        );
        fs::remove_dir_all(folder).unwrap();
    }
}
