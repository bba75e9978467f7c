//! From a clip to a store: decode, take the screen out, bring to the size of the frame.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;

use crate::cache;
use crate::clip::{Clip, some_pictures};
use crate::key::{Keyer, Matte, premultiply};
use crate::picture::{Layout, Picture, Samples};
use crate::scale::{Fit, Scaler};
use crate::store::{Layer, Store, Writer};

/// Raised by every change of what a store holds.
const VERSION: u32 = 1;
/// Pictures in which the screen is searched for.
const PICTURES: usize = 5;
/// Seconds over which the end of a clip is faded into its beginning, at most a quarter of the clip.
const FADE: f64 = 0.5;

/// How a clip is prepared.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The screen's colour; found where there is none.
    pub key: Option<[u8; 3]>,
    /// How the clip is fitted to the frame.
    pub fit: Fit,
    /// What lies behind this many seconds of the clip is left out.
    pub seconds: f64,
}

/// What the pixels of a clip are made transparent by.
///
/// # Errors
/// Where the clip cannot be decoded, or has no screen.
pub fn matte(clip: &Clip, settings: &Settings) -> Result<Matte> {
    let pictures = some_pictures(clip, PICTURES)?;
    Matte::find(&pictures, settings.key).place(clip)
}

/// Makes sure that a clip can be decoded and has a screen, once for each clip: what was found good is noted in the cache.
///
/// # Errors
/// Where the clip cannot be decoded or has no screen, or the cache cannot be written.
pub fn check(clip: &Clip, settings: &Settings, folder: &Path) -> Result<()> {
    // No frame has this size.
    let note = cache::file(folder, &identity(&clip.hash().place(clip)?, settings, (0, 0)));
    if note.exists() {
        return Ok(());
    }
    matte(clip, settings)?;
    cache::create(&note, |_| Ok(()))
}

/// Opens the store of a clip at one size, and makes it first where there is none or it is damaged. `hash` is the clip's.
///
/// # Errors
/// Where the clip cannot be decoded or has no screen, or the cache cannot be written.
pub fn open(
    clip: &Clip,
    hash: &blake3::Hash,
    settings: &Settings,
    size: (usize, usize),
    folder: &Path,
) -> Result<Store> {
    // One thread prepares, the others wait: they are likely to want the same clip.
    static PREPARING: Mutex<()> = Mutex::new(());
    let path = cache::file(folder, &identity(hash, settings, size));
    let usable = |store: &Store| (store.index().width, store.index().height) == size;
    if let Some(store) = Store::open(&path).ok().filter(usable) {
        cache::touch(&path);
        return Ok(store);
    }
    let _one = PREPARING.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(store) = Store::open(&path).ok().filter(usable) {
        return Ok(store);
    }
    cache::create(&path, |file| {
        let mut writer = Writer::new(file, size.0, size.1)?;
        let (rate, frames) = write(clip, settings, size, &mut writer)?;
        writer.finish(rate, frames)
    })?;
    Store::open(&path).place(format!("the prepared {clip} in {}", path.display()))
}

/// Removes the store of a clip, so that it is made anew.
pub fn discard(hash: &blake3::Hash, settings: &Settings, size: (usize, usize), folder: &Path) {
    // Where it is gone already, so much the better.
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

/// Writes all frames, and those that lead from the end to the beginning. Returns the rate and the number of the clip's own.
fn write(
    clip: &Clip,
    settings: &Settings,
    size: (usize, usize),
    writer: &mut Writer,
) -> Result<(f64, usize)> {
    let keyer = match matte(clip, settings)? {
        Matte::Alpha => None,
        Matte::Screen(screen) => Some(Keyer::new(screen)),
    };
    let mut frames = clip.open(false).place(clip)?;
    let mut picture = Picture::default();
    let (mut samples, mut scaler) = (Samples::default(), Scaler::default());
    let (mut rgba, mut colours, mut alphas) = (Vec::new(), Vec::new(), Vec::new());
    while frames.next(&mut picture).place(clip)? {
        let from = match &keyer {
            None => {
                premultiply(&picture, &mut rgba);
                (picture.width, picture.height)
            }
            Some(keyer) => {
                // Video that shrinks by half or more is keyed at the size of its chroma.
                let halve = picture.layout == Layout::Yuv420
                    && picture.width >= 2 * size.0
                    && picture.height >= 2 * size.1;
                samples.fill(&picture, halve);
                keyer.key(&samples, &mut rgba);
                (samples.width, samples.height)
            }
        };
        scaler.scale(&rgba, from, size, settings.fit, &mut colours, &mut alphas);
        writer.push(&colours, &alphas)?;
        if writer.len() as f64 >= frames.rate() * settings.seconds {
            break;
        }
    }
    let (rate, count) = (frames.rate(), writer.len());
    if count == 0 {
        return Err(Error::new("it has no frames")).place(clip);
    }
    if !(rate.is_finite() && rate > 0.0) {
        return Err(Error::new("its frame rate is not given")).place(clip);
    }
    fade(writer, count, fade_length(count, rate))?;
    Ok((rate, count))
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
