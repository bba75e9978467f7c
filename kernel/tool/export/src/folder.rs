//! A record as a folder of files: what goes where.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, BufWriter};
use std::path::{Path, PathBuf};

use pdk_record::directory::{REPORT, RESULTS, RunDirectory, SCENARIOS};
use pdk_record::ledger::{self, Line};
use pdk_report::record::{self, Read};
use pdk_report::tables::Table;
use pdk_report::{Run, Scenario, figures};
use pdk_sdk::error::{Error, Place, Result};
use serde_json::Value;

use crate::domain::Domain;
use crate::flat::{self, Fields};
use crate::{junit, odd, tables, telemetry};

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Scenarios, telemetry, offline results and the tables of the report as CSV.
    Csv,
    /// The tables of the report as Markdown.
    Markdown,
    /// The tables of the report for LaTeX.
    Latex,
    /// The pictures of the report as SVG.
    Svg,
    /// Scenarios as test cases of JUnit XML.
    Junit,
    /// What was driven of an operational design domain, as JSON and as a page.
    Odd,
}

/// What was written.
#[derive(Debug, Default)]
pub struct Written {
    /// The files, in order.
    pub files: Vec<PathBuf>,
    /// What could not be read, one sentence each.
    pub warnings: Vec<String>,
}

/// Where files go.
struct Folder<'a> {
    path: &'a Path,
    files: Vec<PathBuf>,
}

impl Folder<'_> {
    /// The path of a file, in a folder that exists.
    fn place(&mut self, name: &str) -> Result<PathBuf> {
        let path = self.path.join(name);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent)
                .place(format_args!("cannot make the folder {}; name another with -o", parent.display()))?;
        }
        self.files.push(path.clone());
        Ok(path)
    }

    fn write(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.place(name)?;
        pdk_sdk::file::write(&path, bytes).place(format_args!("cannot write {}", path.display()))
    }
}

/// Writes a record to a folder.
///
/// # Errors
/// If the folder holds no record, the record is damaged, or a file cannot be written.
pub fn write(from: &Path, kind: Kind, to: &Path) -> Result<Written> {
    let directory = RunDirectory::open(from)?;
    let (lines, _) = match from.join(SCENARIOS).is_file() {
        true => ledger::read(&directory)?,
        false => (Vec::new(), false),
    };
    let Read { run, warnings } = record::read(from, &from.join(REPORT))?;
    let mut folder = Folder { path: to, files: Vec::new() };
    match kind {
        Kind::Csv => {
            if !lines.is_empty() {
                folder.write("scenarios.csv", &flat::csv(&scenarios(&lines, &run)?)?)?;
                let path = folder.place("telemetry.csv")?;
                let file = File::create(&path).place(format_args!("cannot write {}", path.display()))?;
                telemetry::write(&directory, &lines, BufWriter::new(file)).place(path.display())?;
            }
            let results = results(&from.join(RESULTS))?;
            if !results.is_empty() {
                folder.write("results.csv", &flat::csv(&results)?)?;
            }
            // The scenarios have a file of their own, with all their fields.
            for table in tables_of(&run)?.iter().filter(|table| !table.name.starts_with("scenarios")) {
                folder.write(&format!("tables/{}.csv", table.name), &tables::csv(table)?)?;
            }
        }
        Kind::Markdown => {
            for table in &tables_of(&run)? {
                folder.write(&format!("tables/{}.md", table.name), tables::markdown(table).as_bytes())?;
            }
        }
        Kind::Latex => {
            let tables = tables_of(&run)?;
            for table in &tables {
                folder.write(&format!("tables/{}.tex", table.name), tables::latex(table).as_bytes())?;
            }
            // A long table does not fit on a page.
            let short = tables.iter().filter(|table| table.rows.len() <= LONGEST);
            folder.write("tables/all.tex", tables::document(short).as_bytes())?;
        }
        Kind::Svg => {
            for figure in figures::figures(&run)? {
                folder.write(&format!("figures/{}.svg", figure.name), figure.svg.as_bytes())?;
            }
        }
        Kind::Odd => {
            let odd = odd::odd(&Domain::of_product()?, &run.folder, &lines, &run.evaluations);
            folder.write("odd.json", format!("{}\n", serde_json::to_string_pretty(&odd)?).as_bytes())?;
            folder.write("odd.html", odd::html(&odd)?.as_bytes())?;
        }
        Kind::Junit => {
            if lines.is_empty() {
                return Err(Error::new(format!(
                    "the record in {} holds no scenario that could be a test case; export it to csv",
                    from.display()
                )));
            }
            let replays = by_number(&run);
            let replay = |number: usize| {
                replays.get(&(number as u64)).map(|scenario| scenario.replay.clone()).unwrap_or_default()
            };
            folder.write("junit.xml", junit::scenarios(&run.title, &lines, &replay)?.as_bytes())?;
        }
    }
    Ok(Written { files: folder.files, warnings })
}

/// Rows of the longest table in the document of all tables.
const LONGEST: usize = 60;

fn tables_of(run: &Run) -> Result<Vec<Table>> {
    pdk_report::tables::tables(run)
}

fn by_number(run: &Run) -> HashMap<u64, &Scenario> {
    let scenarios = run.drives.iter().flat_map(|drive| &drive.scenarios);
    scenarios.map(|scenario| (scenario.index, scenario)).collect()
}

/// A line for each scenario: its number, what the report sorts it by, and all fields of the record.
fn scenarios(lines: &[Line], run: &Run) -> Result<Vec<Fields>> {
    let known = by_number(run);
    let mut rows = Vec::new();
    for (number, line) in lines.iter().enumerate() {
        let scenario = known.get(&(number as u64));
        let text = |of: fn(&Scenario) -> Option<String>| scenario.and_then(|s| of(s)).unwrap_or_default();
        let mut row: Fields = vec![
            ("number".to_owned(), number.to_string()),
            ("perturbation".to_owned(), text(|scenario| scenario.perturbation.clone())),
            ("level".to_owned(), text(|scenario| scenario.level.map(|level| level.to_string()))),
            ("road".to_owned(), text(|scenario| scenario.road.map(|road| (road + 1).to_string()))),
            (
                "verdict".to_owned(),
                text(|s| serde_json::to_value(s.verdict).ok()?.as_str().map(str::to_owned)),
            ),
        ];
        row.extend(flat::fields(&serde_json::to_value(line)?));
        rows.push(row);
    }
    Ok(rows)
}

/// The lines of an offline run; none if there are none. A last line that was cut off is left out.
fn results(path: &Path) -> Result<Vec<Fields>> {
    let Some((file, _)) = pdk_sdk::file::open_if_there(path).place(path.display())? else {
        return Ok(Vec::new());
    };
    let (mut reader, mut text, mut rows) = (BufReader::new(file), Vec::new(), Vec::new());
    loop {
        text.clear();
        reader.read_until(b'\n', &mut text).place(path.display())?;
        if text.last() != Some(&b'\n') {
            return Ok(rows);
        }
        let line: Value = serde_json::from_slice(&text).map_err(|error| {
            Error::new(format!(
                "{}:{} is not a result as pdk writes it ({error})",
                path.display(),
                rows.len() + 1
            ))
        })?;
        rows.push(flat::fields(&line));
    }
}
