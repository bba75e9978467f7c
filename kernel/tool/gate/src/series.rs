//! Where the scenarios of a gate come from, and what each of them is drawn from.

use std::fmt;
use std::str::FromStr;

use blake3::Hasher;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::seed::Key;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Where a scenario comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Series {
    /// It is one of the fixed scenarios, driven by both drivers.
    Fixed,
    /// It was drawn, and is driven by both drivers.
    Drawn,
    /// It was drawn for the requirement with this number, from 0, and is driven by the new driver alone.
    Requirement(usize),
}

impl fmt::Display for Series {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed => f.write_str("fixed"),
            Self::Drawn => f.write_str("drawn"),
            Self::Requirement(number) => write!(f, "requirement {}", number + 1),
        }
    }
}

impl FromStr for Series {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let number = || text.strip_prefix("requirement ")?.parse::<usize>().ok()?.checked_sub(1);
        match text {
            "fixed" => Ok(Self::Fixed),
            "drawn" => Ok(Self::Drawn),
            _ => number().map(Self::Requirement).ok_or_else(|| {
                Error::new(format!("`{text}` is not a series; it has to be fixed, drawn or requirement N"))
            }),
        }
    }
}

impl Serialize for Series {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Series {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

/// The key of the order in which the blocks of recordings are looked at.
pub fn order(hash: &str, series: Series) -> Key {
    Key(*named("pdk suite order of blocks, version 1", hash, series).finalize().as_bytes())
}

/// The stream of draws of a scenario.
pub fn key(hash: &str, series: Series, number: usize) -> Key {
    let mut hasher = named("pdk suite scenario, version 1", hash, series);
    hasher.update(&(number as u64).to_le_bytes());
    Key(*hasher.finalize().as_bytes())
}

/// A hasher for this purpose that has taken the suite's hash and a series.
fn named(purpose: &str, hash: &str, series: Series) -> Hasher {
    let mut hasher = Hasher::new_derive_key(purpose);
    for part in [hash, &series.to_string()] {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part.as_bytes());
    }
    hasher
}
