//! The site: the README and the pages of `docs` as mdBook lays them out, with search and without anything from the network.
//!
//! `docs/SUMMARY.md` names the pages in their order. Files that they link to are copied, a folder becomes a page that lists it, and a page
//! that the summary does not name comes at the end.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::process::Command;

use pdk_model::error::{Error, Place, Result};

use crate::links;
use crate::project::{Project, install, succeed};

/// The version of mdBook.
const VERSION: &str = "0.5.4";
/// The order of the pages, in the workspace.
const SUMMARY: &str = "docs/SUMMARY.md";
/// What mdBook calls the page of a folder.
const INDEX: &str = "index.md";

/// Builds the site, and returns the folder with its pages.
///
/// # Errors
/// If mdBook cannot be installed or fails, a page cannot be read or written, or a link of the site leads nowhere.
pub fn build(project: &Project) -> Result<PathBuf> {
    let tool = install(project, "mdbook", VERSION, &["--no-default-features", "--features", "search"])?;
    let folder = project.out().join("site");
    if folder.exists() {
        fs::remove_dir_all(&folder).place(folder.display())?;
    }
    let mut pages = Pages { root: project.root(), into: folder.join("src"), found: BTreeMap::new() };
    let file = project.root().join(SUMMARY);
    let listed = fs::read_to_string(&file).place(file.display())?;
    let summary = pages.lay_out(&listed)?;
    write(&pages.into.join("SUMMARY.md"), &summary)?;
    write(&folder.join("book.toml"), BOOK)?;
    succeed(Command::new(tool).arg("build").arg(&folder))?;
    let book = folder.join("book");
    let dead = links::dead(&book)?;
    if dead.is_empty() {
        Ok(book)
    } else {
        Err(Error::new(format!("links lead nowhere:\n{}", dead.join("\n"))))
    }
}

/// Pages get wide tables and transcripts, so they get more of the window than a book of prose.
const BOOK: &str = r#"[book]
title = "pdk"
language = "en"

[output.html]
additional-css = ["wide.css"]
no-section-label = true

[output.html.print]
enable = false

[output.html.search]
limit-results = 20
"#;
const WIDE: &str = ":root { --content-max-width: 100rem; }\n.table-wrapper table { font-size: 1.4rem; }\n";

/// The pages that have been laid out.
struct Pages<'a> {
    root: &'a Path,
    into: PathBuf,
    /// Places in the workspace, and their titles.
    found: BTreeMap<PathBuf, String>,
}

impl Pages<'_> {
    /// Lays out all pages, and returns the summary as mdBook reads it.
    fn lay_out(&mut self, listed: &str) -> Result<String> {
        let mut summary = String::from("# Summary\n");
        let mut next = Vec::new();
        let mut named = BTreeSet::new();
        for line in listed.lines() {
            if let Some(part) = line.strip_prefix("## ") {
                // Writing to a text cannot fail.
                let _ = writeln!(summary, "\n# {part}\n");
            } else if let Some((title, link)) =
                line.strip_prefix("- [").and_then(|line| line.split_once("]("))
            {
                let place = normal(&Path::new("docs").join(link.trim_end_matches(')')));
                let _ = writeln!(summary, "- [{title}]({})", page_of(&place).display());
                named.insert(place.clone());
                next.push(place);
            }
        }
        while let Some(place) = next.pop() {
            if !self.found.contains_key(&place) {
                next.extend(self.put(&place)?);
            }
        }
        let further: Vec<_> = self.found.iter().filter(|(place, _)| !named.contains(*place)).collect();
        if !further.is_empty() {
            summary += "\n# Further pages\n\n";
        }
        for (place, title) in further {
            let _ = writeln!(summary, "- [{title}]({})", page_of(place).display());
        }
        write(&self.into.join("../wide.css"), WIDE)?;
        Ok(summary)
    }

    /// Puts a page among the others, copies the files that it links to, and returns the pages that it links to.
    fn put(&mut self, place: &Path) -> Result<Vec<PathBuf>> {
        let file = self.root.join(place);
        let text = match file.is_dir() {
            true => listing(&file, place)?,
            false => fs::read_to_string(&file).place(file.display())?,
        };
        let title = text.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or("pdk").to_owned();
        self.found.insert(place.to_owned(), title);
        let folder = if file.is_dir() { place } else { place.parent().unwrap_or(Path::new("")) };
        let mut pages = Vec::new();
        let mut wrong = Ok(());
        let text = links::map(&text, |link| {
            let target = normal(&folder.join(link));
            let file = self.root.join(&target);
            if file.is_dir() && file.join("README.md").is_file() {
                pages.push(target.join("README.md"));
                return Some(format!("{}/{INDEX}", link.trim_end_matches('/')));
            }
            if file.is_dir() {
                pages.push(target);
                return Some(format!("{}/{INDEX}", link.trim_end_matches('/')));
            }
            if file.extension().is_some_and(|ending| ending == "md") {
                pages.push(target);
                return link.strip_suffix("README.md").map(|folder| format!("{folder}{INDEX}"));
            }
            let to = self.into.join(&target);
            let copied = to.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::copy(&file, &to));
            if let (Err(error), Ok(())) = (copied.place(file.display()), &wrong) {
                wrong = Err(error);
            }
            None
        });
        wrong?;
        write(&self.into.join(page_of(place)), &text)?;
        Ok(pages)
    }
}

/// Where a page of the workspace lies among mdBook's.
fn page_of(place: &Path) -> PathBuf {
    match place.extension().is_some_and(|ending| ending == "md") {
        true if place.ends_with("README.md") => place.with_file_name(INDEX),
        true => place.to_owned(),
        false => place.join(INDEX),
    }
}

/// A page that lists a folder.
fn listing(folder: &Path, place: &Path) -> Result<String> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).place(folder.display())? {
        let entry = entry.place(folder.display())?;
        names.push(entry.file_name().to_string_lossy().into_owned());
    }
    names.sort();
    let links: Vec<String> = names.iter().map(|name| format!("- [{name}]({name})")).collect();
    Ok(format!("# {}\n\n{}\n", place.display(), links.join("\n")))
}

/// A path without `.` and `..`.
fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => drop(normal.pop()),
            Component::CurDir => {}
            other => normal.push(other),
        }
    }
    normal
}

fn write(file: &Path, text: &str) -> Result<()> {
    file.parent().map_or(Ok(()), fs::create_dir_all).place(file.display())?;
    fs::write(file, text).place(file.display())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::project::Target;

    #[test]
    fn every_link_of_a_page_is_laid_out() {
        let project = Project::for_target(Target::HERE).unwrap();
        let folder = std::env::temp_dir().join(format!("pdk-site-{}", std::process::id()));
        let mut pages = Pages { root: project.root(), into: folder.join("src"), found: BTreeMap::new() };
        pages.lay_out(&fs::read_to_string(project.root().join(SUMMARY)).unwrap()).unwrap();
        // A page that another one links to, a picture, and a folder of scripts with a page of its own.
        for file in
            ["index.md", "docs/reference/index.md", "docs/perturbations.jpg", "scripts/examples/index.md"]
        {
            assert!(folder.join("src").join(file).is_file(), "{file}");
        }
        let first = fs::read_to_string(folder.join("src/index.md")).unwrap();
        assert!(
            first.contains("(docs/reference/index.md)") && first.contains("(scripts/examples/index.md)"),
            "{first}"
        );
        fs::remove_dir_all(folder).unwrap();
    }
}
