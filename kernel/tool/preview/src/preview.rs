//! What perturbations look like: on one frame at each level, and over time.

use image::RgbImage;
use indicatif::ProgressBar;
use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_chain::view::View;
use pdk_components::catalog::{Catalog, Entry};
use pdk_components::registry::Registry;
use pdk_model::component::ComponentSpec;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::config::Config;
use pdk_sdk::describe::{Description, Kind, LEVELS, Temporal};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::ops::warp::{Affine, Workspace, warp_affine};
use pdk_sdk::prelude::FrameBuf;
use serde_json::{Map, Value};

use crate::picture::{self, Block};

/// The time at which a preview shows a perturbation, in seconds. Moving ones are already moving then.
const MOMENT: f64 = 2.0;

/// How much larger things become from one frame to the next where a perturbation needs earlier frames.
const STEP: f64 = 0.012;

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
    /// The saliency method whose maps stand below the pictures, if they are wanted.
    pub maps: Option<ComponentSpec>,
}

/// A perturbation that is shown, as the user names it.
pub struct Shown {
    /// What the perturbation says of itself.
    pub description: Description,
    applied: AppliedPerturbation,
    /// Whether the user names a level, at which alone it is shown then.
    one_level: bool,
}

impl Shown {
    /// It at its own level, or at this one where the user names none.
    pub fn at(&self, level: f64) -> AppliedPerturbation {
        match self.one_level {
            true => self.applied.clone(),
            false => self.applied.clone().at_level(level),
        }
    }

    /// What a row of pictures shows.
    fn levels(&self) -> Vec<AppliedPerturbation> {
        let count = if self.one_level { 1 } else { LEVELS };
        (0..count).map(|level| self.at(level as f64)).collect()
    }

    fn label(&self) -> String {
        let Description { family, temporal, default, .. } = &self.description;
        let name = if self.one_level { self.applied.to_string() } else { self.applied.label() };
        let temporal = if *temporal == Temporal::Dynamic { ", dynamic" } else { "" };
        let set = if *default { "" } else { ", by name only" };
        format!("{name}  ({family}{temporal}{set})")
    }
}

/// The perturbations that can be shown without setting anything, or with an example of their own, by family and name: the
/// default set with the files of the user's that are perturbations, or all.
pub fn usable(catalog: &Catalog, all: bool) -> Vec<Description> {
    let wanted = |entry: &&Entry| all || entry.description.default || entry.base.is_some();
    let found = catalog.of_kind(Kind::Perturbation).filter(wanted).map(|entry| &entry.description);
    let mut usable: Vec<Description> = found.filter(|found| settings(found).is_some()).cloned().collect();
    usable.sort_by(|a, b| (&a.family, &a.name).cmp(&(&b.family, &b.name)));
    usable
}

/// The perturbations to show: those that are named as for [`AppliedPerturbation::parse`], or those that are [`usable`].
///
/// # Errors
/// If one of the names is not a perturbation, or what stands behind it cannot be read.
pub fn chosen(catalog: &Catalog, named: &[String], all: bool) -> Result<Vec<Shown>> {
    if named.is_empty() {
        let shown = |description: Description| {
            let parameters = settings(&description).unwrap_or_default();
            let applied =
                AppliedPerturbation { parameters, ..AppliedPerturbation::new(&description.name, 0.0) };
            Shown { description, applied, one_level: false }
        };
        let usable = usable(catalog, all).into_iter().filter(|description| description.acts_on.is_frame());
        return Ok(usable.map(shown).collect());
    }
    let shown = |text: &String| {
        let applied = AppliedPerturbation::parse(text)?;
        // What can be read as it is, but not as one whose levels come from elsewhere, has a level of its own.
        let one_level = AppliedPerturbation::from_json_without_level(&text.as_str().into()).is_err();
        let description = catalog.get(Kind::Perturbation, &applied.name)?.description.clone();
        Ok(Shown { description, applied, one_level })
    };
    named.iter().map(shown).collect()
}

/// What has to be set to show a component: nothing, or the parameters of its first example; none if it needs
/// something of the user's.
fn settings(description: &Description) -> Option<Map<String, Value>> {
    let nothing = Map::new();
    let mut all = std::iter::once(&nothing).chain(&description.examples);
    all.find(|settings| Config::check(description, settings).is_ok()).cloned()
}

/// A frame under a perturbation at a moment.
///
/// # Errors
/// If it cannot be perturbed.
pub fn perturbed(
    registry: &Registry,
    applied: &AppliedPerturbation,
    source: &FrameBuf,
    seed: u64,
    time: f64,
) -> Result<FrameBuf> {
    let mut chain = Chain::new(registry, std::slice::from_ref(applied), seed)?;
    let mut target = FrameBuf::new(source.width(), source.height());
    let frame_index = (time * RATE).round() as u64;
    approach(&mut chain, source, frame_index)?;
    chain.apply(source.as_ref(), target.as_mut(), &Moment::new(frame_index, time))?;
    Ok(target)
}

/// Gives a chain as many frames before a frame as it needs: the same picture, seen from further away the longer ago, as if the camera had come
/// nearer. Of a still picture, an earlier frame would show nothing.
///
/// # Errors
/// If a perturbation fails.
pub fn approach(chain: &mut Chain, source: &FrameBuf, frame_index: u64) -> Result<()> {
    let frames = (chain.history() as u64).min(frame_index);
    if frames == 0 {
        return Ok(());
    }
    let (width, height) = (source.width(), source.height());
    let (mut earlier, mut unused) = (FrameBuf::new(width, height), FrameBuf::new(width, height));
    let mut workspace = Workspace::default();
    // Things come nearer along lines from the point to which the road leads, in the middle and a little above.
    let [x, y] = [width as f64 / 2.0, height as f64 * 0.4];
    for back in (1..=frames).rev() {
        let scale = 1.0 / (1.0 + back as f64 * STEP);
        let shrunk = Affine([scale, 0.0, x * (1.0 - scale), 0.0, scale, y * (1.0 - scale)]);
        // What lies beyond the edges is not black, but the picture at its own size.
        earlier.as_mut().copy_from(source.as_ref());
        warp_affine(source.as_ref(), unused.as_mut(), &shrunk, &mut workspace);
        paste(&unused, &mut earlier, scale, [x, y]);
        let moment = Moment::new(frame_index - back, (frame_index - back) as f64 / RATE);
        chain.apply(earlier.as_ref(), unused.as_mut(), &moment)?;
    }
    Ok(())
}

/// Copies what a picture shows within the borders of the frame when it is shrunk towards a point.
fn paste(from: &FrameBuf, to: &mut FrameBuf, scale: f64, [x, y]: [f64; 2]) {
    let inside = |centre: f64, size: usize| {
        let low = (centre * (1.0 - scale)).ceil() as usize;
        let high = (centre + (size as f64 - 1.0 - centre) * scale).floor() as usize + 1;
        low..high.min(size)
    };
    let (columns, rows) = (inside(x, from.width()), inside(y, from.height()));
    let width = 3 * from.width();
    for row in rows {
        let span = row * width + 3 * columns.start..row * width + 3 * columns.end;
        to.as_mut().data_mut()[span.clone()].copy_from_slice(&from.data()[span]);
    }
}

/// One row for each perturbation: the frame at every level, or at the one that the user names. If a perturbation fails,
/// its row is the error.
pub fn rows(
    registry: &Registry,
    chosen: &[Shown],
    source: &FrameBuf,
    options: &Options,
    progress: &ProgressBar,
) -> Vec<Result<Block>> {
    progress.set_length(chosen.len() as u64);
    let view = || options.maps.as_ref().map(|by| View::new(registry, by, options.seed));
    let rows: Vec<Result<Vec<Option<RgbImage>>>> = pdk_parallel::map_with(chosen, view, |view, shown| {
        let pictures = shown.levels().into_iter().map(|applied| {
            let measured = registry.catalog().measured_scale(&applied)?;
            // A level that the user names is an error, but in a row its place stays empty.
            if !shown.one_level && measured.is_some_and(|scale| scale.check(&applied.level).is_err()) {
                return Ok(None);
            }
            let frame = perturbed(registry, &applied, source, options.seed, MOMENT)?;
            let picture = picture::scaled(&frame, options.picture_width);
            match view {
                None => Ok(Some(picture)),
                Some(Ok(view)) => {
                    let heat = view.picture(frame.as_ref(), &Moment::new(0, MOMENT).alone())?;
                    Ok(Some(picture::stacked(&picture, &picture::scaled(&heat, picture.width()))))
                }
                Some(Err(error)) => Err(Error::of(error.kind(), error.to_string())),
            }
        });
        let pictures = pictures.collect();
        progress.inc(1);
        pictures
    });
    progress.finish_and_clear();
    // All rows are as long as the longest, the others with paper at their ends.
    let longest = rows.iter().flatten().map(Vec::len).max().unwrap_or(0);
    let of_all = rows.iter().flatten().flatten().flatten().next();
    let paper = of_all.map(|any| RgbImage::from_pixel(any.width(), any.height(), picture::PAPER));
    let block = |(shown, pictures): (&Shown, Result<Vec<Option<RgbImage>>>)| {
        let mut pictures = pictures?;
        pictures.resize(longest, None);
        let pictures = pictures.into_iter().filter_map(|picture| picture.or_else(|| paper.clone()));
        Ok(Block { label: shown.label(), row: picture::row(&pictures.collect::<Vec<_>>())? })
    };
    chosen.iter().zip(rows).map(block).collect()
}

/// Frames over time under a perturbation: `count` of them, `interval` seconds apart.
///
/// # Errors
/// If the perturbation fails.
pub fn over_time(
    registry: &Registry,
    applied: &AppliedPerturbation,
    source: &FrameBuf,
    options: &Options,
    count: usize,
    interval: f64,
) -> Result<Vec<RgbImage>> {
    let mut chain = Chain::new(registry, std::slice::from_ref(applied), options.seed)?;
    let mut target = FrameBuf::new(source.width(), source.height());
    (0..count)
        .map(|number| {
            let time = number as f64 * interval;
            chain.apply(
                source.as_ref(),
                target.as_mut(),
                &Moment::new((time * RATE).round() as u64, time),
            )?;
            Ok(picture::scaled(&target, options.picture_width))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use pdk_sdk::describe::{ActsOn, Parameter};
    use serde_json::json;

    use super::*;

    /// A catalog with fog, which everybody has, and frost, which has to be named.
    fn catalog() -> Catalog {
        let mut catalog = Catalog::default();
        for (name, default) in [("fog", true), ("frost", false)] {
            let description =
                Description { default, ..Description::perturbation(name, "x").family("weather") };
            catalog.add(Entry::new(description, "plugin".into()));
        }
        catalog
    }

    #[test]
    fn a_level_that_is_named_is_the_only_one_shown() {
        let levels = |text: &str| {
            let shown = chosen(&catalog(), &[text.to_owned()], false).unwrap();
            shown[0].levels().iter().map(|applied| applied.level.constant()).collect::<Vec<_>>()
        };
        let all: Vec<_> = (0..LEVELS).map(|level| Some(level as f64)).collect();
        assert_eq!(levels("fog"), all);
        assert_eq!(levels("fog,probability=0.5"), all);
        assert_eq!(levels("fog@2"), [Some(2.0)]);
        // Also if it is the one that would be taken without a name.
        assert_eq!(levels(&format!("frost@{}", pdk_model::level::DEFAULT_LEVEL)).len(), 1);
        assert_eq!(levels("fog,level=3,probability=0.5"), [Some(3.0)]);
        let error = chosen(&catalog(), &["fok".to_owned()], false).err().unwrap();
        assert!(error.message().contains("`fog`"), "{error}");
    }

    #[test]
    fn the_default_set_and_files_of_the_users_are_shown_unless_all_are_wanted() {
        let mut catalog = catalog();
        let description = Description { default: false, ..Description::perturbation("sticker", "x") };
        let base = Some("overlay".into());
        catalog.add(Entry { base, ..Entry::new(description, "sticker.png".into()) });
        let names = |catalog: &Catalog, all: bool| {
            chosen(catalog, &[], all).unwrap().into_iter().map(|s| s.description.name).collect::<Vec<_>>()
        };
        assert_eq!(names(&catalog, false), ["sticker", "fog"]);
        assert_eq!(names(&catalog, true), ["sticker", "fog", "frost"]);
        // What leaves frames as they are is usable, and has nothing to show.
        let late = Description { default: false, ..Description::perturbation("late", "x") };
        catalog.add(Entry::new(late.acts_on(ActsOn::Control), "plugin".into()));
        assert_eq!(names(&catalog, true), ["sticker", "fog", "frost"]);
        assert_eq!(usable(&catalog, true).len(), 4);
    }

    #[test]
    fn what_needs_a_file_is_shown_with_its_example() {
        let fog = Description::perturbation("fog", "Fog");
        assert_eq!(settings(&fog), Some(Map::new()));
        let clip = fog.parameter(Parameter::path("clip", "the clip"));
        assert_eq!(settings(&clip), None);
        let example = json!({"clip": "built-in:fog"});
        assert_eq!(settings(&clip.example(example.clone())).map(Value::Object), Some(example));
    }
}
