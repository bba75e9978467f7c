//! From a clip to a store: decode, take the screen out, bring to the size of the frame.

use std::fs::File;
use std::path::Path;

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;

use crate::cache;
use crate::clip::{Clip, some_pictures};
use crate::edges::Edges;
use crate::key::{Keyer, Matte, Screen, premultiply};
use crate::picture::{Layout, Picture, Samples};
use crate::scale::{Fit, Scaler};
use crate::store::{Layer, Store, Writer};

/// Raised by every change of what a store holds.
const VERSION: u32 = 6;
/// The screen of the clips that come with pdk.
const SCREEN: [u8; 3] = [0, 219, 26];
/// Pictures in which the screen is searched for.
const PICTURES: usize = 5;
/// Seconds over which the end of a clip is faded into its beginning, at most a quarter of the clip.
const FADE: f64 = 0.5;

/// Frames that are never further than this many seconds from where a fixed rate has them come at that rate: files round their times.
const ROUNDING: f64 = 0.001;

/// How a clip is prepared.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The screen's colour; found if there is none, and known of clips of pdk's own.
    pub key: Option<[u8; 3]>,
    /// How the clip is fitted to the frame.
    pub fit: Fit,
    /// What lies behind this many seconds of the clip is left out.
    pub seconds: f64,
}

/// What the pixels of a clip are made transparent by.
///
/// # Errors
/// If the clip cannot be decoded, or has no screen.
pub fn matte(clip: &Clip, settings: &Settings) -> Result<Matte> {
    if let (Clip::BuiltIn(..), None) = (clip, settings.key) {
        return Ok(Matte::Screen(Screen::known(SCREEN)));
    }
    Matte::find(&some_pictures(clip, PICTURES)?, settings.key)
}

/// Makes sure that a clip can be decoded and has a screen, once for each clip: what was found good is noted in the cache.
///
/// # Errors
/// If the clip cannot be decoded or has no screen, or the cache cannot be written.
pub fn check(clip: &Clip, settings: &Settings, folder: &Path) -> Result<()> {
    let hash = clip.hash().place(clip)?;
    // No frame has this size.
    let note = cache::file(folder, &identity(&hash, settings, (0, 0)));
    let noted = || Ok(std::fs::metadata(&note).map(drop)?);
    cache::find_or_create(&note, noted, |_| matte(clip, settings).map(drop)).place(clip)
}

/// Opens the store of a clip at one size, and makes it first if there is none or it is damaged. `hash` is the clip's.
/// Other clips and sizes can be made at the same time; who wants the same one waits for it.
///
/// # Errors
/// If the clip cannot be decoded or has no screen, or the cache cannot be written.
pub fn open(
    clip: &Clip,
    hash: &blake3::Hash,
    settings: &Settings,
    size: (usize, usize),
    folder: &Path,
) -> Result<Store> {
    let path = cache::file(folder, &identity(hash, settings, size));
    let find = || {
        let store = Store::open(&path).place(format!("what was prepared of it in {}", path.display()))?;
        if (store.index().width, store.index().height) != size {
            return Err(Error::new(format!(
                "what was prepared of it in {} has another size",
                path.display()
            )));
        }
        cache::touch(&path);
        Ok(store)
    };
    let make = |file: File| {
        let mut writer = Writer::new(file, size.0, size.1)?;
        let ends = write(clip, settings, size, &mut writer)?;
        writer.finish(rate(&ends), durations(&ends), ends.len())
    };
    cache::find_or_create(&path, find, make).place(clip)
}

/// Removes the store of a clip, so that it is made anew.
pub fn discard(hash: &blake3::Hash, settings: &Settings, size: (usize, usize), folder: &Path) {
    // If it is gone already, so much the better.
    let _ = std::fs::remove_file(cache::file(folder, &identity(hash, settings, size)));
}

fn identity(hash: &blake3::Hash, settings: &Settings, (width, height): (usize, usize)) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new_derive_key("pdk prepared overlay clip");
    hasher.update(&VERSION.to_le_bytes());
    hasher.update(hash.as_bytes());
    hasher.update(&(width as u64).to_le_bytes());
    hasher.update(&(height as u64).to_le_bytes());
    hasher.update(format!("{settings:?}").as_bytes());
    hasher.finalize()
}

/// Frames a second of a clip, on average, by the times at which its frames end.
fn rate(ends: &[f64]) -> f64 {
    ends.len() as f64 / ends.last().copied().unwrap_or_default()
}

/// How long each frame is shown, in nanoseconds; nothing if that is the same for all but for rounding.
fn durations(ends: &[f64]) -> Vec<u64> {
    let rate = rate(ends);
    if ends.iter().zip(1..).all(|(end, number)| (end - f64::from(number) / rate).abs() <= ROUNDING) {
        return Vec::new();
    }
    let ends = ends.iter().map(|end| (end * 1e9).round() as u64);
    ends.scan(0, |begin, end| Some(end.saturating_sub(std::mem::replace(begin, end)))).collect()
}

/// Writes all frames, and those that lead from the end to the beginning. Returns when each of the clip's own ends, in seconds.
fn write(clip: &Clip, settings: &Settings, size: (usize, usize), writer: &mut Writer) -> Result<Vec<f64>> {
    let keyer = match matte(clip, settings)? {
        Matte::Alpha => None,
        Matte::Screen(screen) => Some((screen, Keyer::new(screen))),
    };
    let mut edges = Edges::default();
    let mut frames = clip.open(false)?;
    let (mut picture, mut ends) = (Picture::default(), Vec::new());
    let (mut samples, mut scaler) = (Samples::default(), Scaler::default());
    let (mut rgba, mut colours, mut alphas) = (Vec::new(), Vec::new(), Vec::new());
    while frames.next(&mut picture)? {
        let from = match &keyer {
            None => {
                premultiply(&picture, &mut rgba);
                (picture.width, picture.height)
            }
            Some((screen, keyer)) => {
                // Video that shrinks by half or more is keyed at the size of its chroma.
                let halve = picture.layout == Layout::Yuv420
                    && picture.width >= 2 * size.0
                    && picture.height >= 2 * size.1;
                let width = screen.samples(&picture, halve, &mut samples);
                keyer.key(&samples, &mut rgba);
                keyer.clean(&samples, width, &mut edges, &mut rgba);
                (samples.width, samples.height)
            }
        };
        scaler.scale(&rgba, from, size, settings.fit, &mut colours, &mut alphas);
        writer.push(&colours, &alphas)?;
        ends.push(frames.end());
        if frames.end() >= settings.seconds {
            break;
        }
    }
    if ends.is_empty() {
        return Err(Error::new("it has no frames"));
    }
    if !(rate(&ends).is_finite() && rate(&ends) > 0.0) {
        return Err(Error::new("its frames are shown for no time at all"));
    }
    fade(writer, ends.len(), fade_length(ends.len(), rate(&ends)))?;
    Ok(ends)
}

/// The number of frames over which a clip's end is faded into its beginning.
fn fade_length(frames: usize, rate: f64) -> usize {
    ((FADE * rate) as usize).min(frames / 4)
}

/// Appends mixtures of the last `length` frames with the first ones.
fn fade(writer: &mut Writer, frames: usize, length: usize) -> Result<()> {
    let (mut last, mut first) = (Layer::default(), Layer::default());
    let mut mixed = Vec::new();
    for i in 0..length {
        writer.read(frames - length + i, &mut last)?;
        writer.read(i, &mut first)?;
        let (whole, share) = (length as u32 + 1, i as u32 + 1);
        mixed.clear();
        let (last, first) = (last.planes(), first.planes());
        let values = last.0.iter().chain(last.1).zip(first.0.iter().chain(first.1));
        mixed.extend(values.map(|(&last, &first)| {
            ((u32::from(last) * (whole - share) + u32::from(first) * share + whole / 2) / whole) as u8
        }));
        let (colours, alphas) = mixed.split_at(mixed.len() / 4 * 3);
        writer.push(colours, alphas)?;
    }
    Ok(())
}
