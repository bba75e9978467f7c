//! Suites by their names or files, with the hashes of their contents.

use std::path::{Path, PathBuf};

use pdk_components::catalog::Catalog;
use pdk_components::product;
use pdk_model::canonical::canonical;
use pdk_pipeline::program::Text;
use pdk_record::files::recorded;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::file;
use pdk_sdk::suggest;
use serde_json::Value;

use crate::check::check;
use crate::recording::{Open, Opened};
use crate::series::{Series, order};
use crate::suite::{ENDING, Suite};

/// Bytes of a file that may be a suite.
const LARGEST: u64 = 64 << 20;

/// A suite with where it comes from.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// What it says.
    pub suite: Suite,
    /// Its text, as the record has it.
    pub text: Text,
    /// BLAKE3 of its contents, in hexadecimal: comments, order and spelling make no difference, everything else does.
    pub hash: String,
    /// Its recordings, once they were opened.
    pub opened: Opened,
}

impl Loaded {
    /// A suite that is part of pdk by its name, or a file.
    ///
    /// # Errors
    /// If there is none, or it is not right.
    pub fn find(named: &str) -> Result<Self> {
        let path = Path::new(named);
        if path.components().count() == 1 && !named.contains('.') {
            let suites = product::get().suites;
            let known = suites.iter().map(|suite| suite.name);
            let suite = suites.iter().find(|suite| suite.name == named).ok_or_else(|| {
                Error::new(format!(
                    "there is no built-in suite `{named}`; to use a file, write its ending, as in {named}.{ENDING}; {}",
                    suggest::hint(named, known)
                ))
            })?;
            let path = PathBuf::from(format!("{}.{ENDING}", suite.name));
            return Self::new(Text { path, source: suite.source.to_owned(), folder: None });
        }
        let source = file::read_text(path, LARGEST).map_err(|error| {
            Error::new(format!("cannot read the suite {named} ({error}); check the path"))
        })?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Self::new(Text { path: path.to_owned(), source, folder: Some(folder.to_owned()) })
    }

    /// The suite in a text.
    ///
    /// # Errors
    /// If it is not right.
    pub fn new(text: Text) -> Result<Self> {
        let shown = text.path.display().to_string();
        let wrong = |error: toml::de::Error| {
            Error::new(format!("the suite {shown} is not right: {}", one_line(&error, &text.source)))
        };
        let suite: Suite = toml::from_str(&text.source).map_err(wrong)?;
        let contents: Value = toml::from_str(&text.source).map_err(wrong)?;
        check(&suite).map_err(|error| error.at(format_args!("the suite {shown}")))?;
        let hash = blake3::derive_key("pdk suite, version 1", canonical(&contents).as_bytes());
        Ok(Self {
            suite,
            hash: blake3::Hash::from_bytes(hash).to_hex().to_string(),
            text,
            opened: Opened::default(),
        })
    }

    /// Opens the recordings of the suite. Does nothing if it has none.
    ///
    /// # Errors
    /// If one cannot be opened.
    pub fn open(&mut self, catalog: &Catalog, open: &mut Open<'_>) -> Result<()> {
        if self.suite.is_recorded() {
            let mut random = order(&self.hash, Series::Drawn).sequence();
            self.opened = Opened::of(&self.suite, catalog, &mut random, open)?;
        }
        Ok(())
    }

    /// How many scenarios can be drawn for both drivers.
    pub fn pairs(&self) -> usize {
        let Suite { places, recordings, test, .. } = &self.suite;
        match (places.is_empty(), recordings.is_empty()) {
            (true, true) => 0,
            (false, _) => test.pairs,
            (true, false) => test.pairs.min(self.opened.blocks.len()),
        }
    }

    /// How the command line names it.
    pub fn named(&self) -> String {
        match self.text.folder {
            Some(_) => recorded(&self.text.path).display().to_string(),
            None => self.text.path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        }
    }
}

/// An error of TOML in one line, with the line of the file that it means.
fn one_line(error: &toml::de::Error, source: &str) -> String {
    let message = error.message().replace('\n', " ");
    match error.span() {
        Some(span) => {
            let line = source.get(..span.start).unwrap_or_default().matches('\n').count() + 1;
            format!("line {line}: {message}")
        }
        None => message,
    }
}

#[cfg(test)]
mod tests {
    use crate::fixture::{SMALL, suite};
    use crate::requirement::Kind;
    use crate::suite::Roads;

    #[test]
    fn a_suite_is_read_and_its_hash_is_of_what_it_says() {
        let one = suite(SMALL).unwrap();
        assert_eq!(one.suite.places[0].road, Roads { segments: 4, segment: 25.0, limit: 20 });
        assert_eq!((one.suite.test.alpha, one.suite.test.pairs), (0.05, 50));
        assert_eq!(one.suite.levels_of("rain@3").unwrap().len(), 1);
        assert_eq!(one.suite.levels_of("fog").unwrap().len(), 2);
        let spelled = SMALL.replace("levels = [1, 2]", "levels = [ 1.0, 2 ] # two").replace("0.25", "2.5e-1");
        assert_eq!(suite(&spelled).unwrap().hash, one.hash);
        assert_ne!(suite(&SMALL.replace("version = 1", "version = 2")).unwrap().hash, one.hash);
    }

    #[test]
    fn mistakes_are_named_with_their_place() {
        for (what, with, said) in [
            ("version = 1", "versoin = 1", "the suite a.toml is not right: line 3: unknown field `versoin`"),
            ("levels = [1, 2]", "levels = []", "`levels` is empty, but `fog` has no level"),
            ("levels = [1, 2]", "levels = [9]", "the level in `levels` is 9"),
            ("nominal = 0.25", "nominal = 2", "`nominal` is 2, but has to be from 0 to 1"),
            ("tolerated = 0.2", "tolerated = 0", "have to lie between 0 and 1"),
            ("segments = 4", "segments = 1", "a road has 1 segments"),
            ("duration = 12", "duration = 0", "[[place]] 1: `duration` is 0 s"),
            (
                "duration = 12",
                "durration = 12",
                "[[place]] 1: there is no field `durration`; did you mean `duration`?",
            ),
            (
                "duration = 12",
                "seed = 12",
                "[[place]] 1: there is no field `seed`; there are simulator, duration, failure, mode, road",
            ),
            ("duration = 12", "mode = \"slow\"", "[[place]] 1: unknown variant `slow`"),
            (
                "simulator =",
                "simulato =",
                "[[place]] 1: there is no field `simulato`; did you mean `simulator`?",
            ),
            ("name = \"small\"", "name = \"a b\"", "`name` is `a b`"),
            ("pairs = 50", "pairs = 0", "have to be from 1 to 1000000"),
        ] {
            let error = suite(&SMALL.replace(what, with)).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
        let error = suite("name = \"x\"\nversion = 1").unwrap_err().to_string();
        assert!(error.contains("neither a [[place]]"), "{error}");
    }

    #[test]
    fn fixed_scenarios_are_those_of_records() {
        let fixed = r#"
            name = "never_again"
            version = 1
            [[scenario]]
            simulator = { name = "flat" }
            road = { angles = [0, 1.5], segment = 25 }
            duration = 9
            seed = 9007199254740991
        "#;
        let loaded = suite(fixed).unwrap();
        let scenario = loaded.suite.fixed(0).unwrap();
        assert_eq!((scenario.seed, scenario.duration), ((1 << 53) - 1, 9.0));
        assert_eq!(loaded.suite.required()[0].kind, Kind::Passes { allowed: 0 });
        let error = suite(&fixed.replace("seed", "sed")).unwrap_err().to_string();
        assert!(error.contains("[[scenario]] 1 has a field `sed`"), "{error}");
        assert!(suite(&fixed.replace("duration = 9", "")).unwrap_err().to_string().contains("duration"));
    }
}
