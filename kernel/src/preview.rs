//! What perturbations look like: on one frame at each level, and over time.

use std::sync::atomic::{AtomicUsize, Ordering};

use image::RgbImage;
use indicatif::ProgressBar;
use pdk_sdk::describe::{Description, Kind, LEVELS, Temporal};
use pdk_sdk::error::Result;
use pdk_sdk::prelude::FrameBuf;

use crate::chain::{Chain, Spec};
use crate::picture::{self, Block};
use crate::registry::Registry;

/// The moment at which a perturbation is shown in seconds: those that move have begun to.
const MOMENT: f64 = 2.0;

/// Frames of a simulator per second, which say which frame belongs to a moment.
const RATE: f64 = 30.0;

/// How pictures are made.
#[derive(Debug, Clone)]
pub struct Options {
    /// The seed that all random numbers come from.
    pub seed: u64,
    /// Width of the frame that is perturbed, in pixels: perturbations have sizes in pixels, and a simulator's frames are
    /// small.
    pub frame_width: u32,
    /// Width of a picture, in pixels.
    pub picture_width: u32,
}

/// The perturbations to show, by family and name: those that are named, or the default set.
///
/// # Errors
/// Where one of the names is no perturbation.
pub fn chosen(registry: &Registry, names: &[String], all: bool) -> Result<Vec<Description>> {
    let mut chosen: Vec<Description> = match names.is_empty() {
        true => {
            let wanted = |description: &&Description| all || description.default;
            let usable = |description: &&Description| needs_nothing(description);
            let all = registry.of_kind(Kind::Perturbation).map(|component| &component.description);
            all.filter(wanted).filter(usable).cloned().collect()
        }
        false => names
            .iter()
            .map(|name| Ok(registry.get(Kind::Perturbation, name)?.description.clone()))
            .collect::<Result<_>>()?,
    };
    if names.is_empty() {
        chosen.sort_by(|a, b| (&a.family, &a.name).cmp(&(&b.family, &b.name)));
    }
    Ok(chosen)
}

/// Whether a component can be made without setting anything.
fn needs_nothing(description: &Description) -> bool {
    pdk_sdk::config::Config::check(description, &serde_json::Map::new()).is_ok()
}

/// A frame under a perturbation at a moment.
///
/// # Errors
/// Where it cannot be perturbed.
pub fn perturbed(
    registry: &Registry,
    spec: &Spec,
    source: &FrameBuf,
    seed: u64,
    time: f64,
) -> Result<FrameBuf> {
    let mut chain = Chain::new(registry, std::slice::from_ref(spec), seed, 0)?;
    let mut target = FrameBuf::new(source.width(), source.height());
    chain.apply(source.as_ref(), target.as_mut(), (time * RATE).round() as u64, time)?;
    Ok(target)
}

/// One row for each perturbation: the frame at every level.
///
/// # Errors
/// Where a perturbation fails.
pub fn rows(
    registry: &Registry,
    chosen: &[Description],
    source: &FrameBuf,
    options: &Options,
    progress: &ProgressBar,
) -> Result<Vec<Block>> {
    progress.set_length(chosen.len() as u64);
    let next = AtomicUsize::new(0);
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(chosen.len().max(1));
    let mut rows: Vec<(usize, Block)> = std::thread::scope(|scope| {
        let work = || {
            let mut rows = Vec::new();
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(description) = chosen.get(index) else { return Ok(rows) };
                let levels = (0..LEVELS).map(|level| {
                    let spec = Spec::new(&description.name, level as f64);
                    let frame = perturbed(registry, &spec, source, options.seed, MOMENT)?;
                    Ok(picture::scaled(&frame, options.picture_width))
                });
                let row = picture::row(&levels.collect::<Result<Vec<_>>>()?)?;
                rows.push((index, Block { label: label(description), row }));
                progress.inc(1);
            }
        };
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let join = |thread: std::thread::ScopedJoinHandle<'_, Result<Vec<_>>>| {
            thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        threads
            .into_iter()
            .map(join)
            .collect::<Result<Vec<_>>>()
            .map(|rows| rows.into_iter().flatten().collect())
    })?;
    rows.sort_by_key(|(index, _)| *index);
    progress.finish_and_clear();
    Ok(rows.into_iter().map(|(_, block)| block).collect())
}

/// Frames over time under a perturbation: `count` of them, `interval` seconds apart.
///
/// # Errors
/// Where the perturbation fails.
pub fn over_time(
    registry: &Registry,
    spec: &Spec,
    source: &FrameBuf,
    options: &Options,
    count: usize,
    interval: f64,
) -> Result<Vec<RgbImage>> {
    let mut chain = Chain::new(registry, std::slice::from_ref(spec), options.seed, 0)?;
    let mut target = FrameBuf::new(source.width(), source.height());
    (0..count)
        .map(|number| {
            let time = number as f64 * interval;
            chain.apply(source.as_ref(), target.as_mut(), (time * RATE).round() as u64, time)?;
            Ok(picture::scaled(&target, options.picture_width))
        })
        .collect()
}

fn label(description: &Description) -> String {
    let temporal = if description.temporal == Temporal::Dynamic { ", dynamic" } else { "" };
    let set = if description.default { "" } else { ", by name only" };
    format!("{}  ({}{temporal}{set})", description.name, description.family)
}
