//! Expected gradients: what each pixel contributes to the difference between the output for the frame and for other pictures.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;

use super::along;
use super::derived::Derived;
use super::gradient::open;
use super::grid::{Grid, sign_parameter};
use super::method::{Map, Method, empty};
use super::viewer::{Viewer, parameters};

/// The most pictures that are kept; of a larger folder they are spread evenly over it.
const MOST: usize = 256;

/// Gradients along lines from other pictures to the frame.
pub type ExpectedGradients = Map<Expected>;

/// The mean over drawn pictures and places on the line.
pub struct Expected {
    derived: Derived,
    samples: usize,
    /// What the network gets for each of the other pictures.
    others: Vec<Vec<f32>>,
}

impl Method for Expected {
    /// The pictures in the folder may be others the next time.
    const KEPT: bool = false;

    fn description() -> Description {
        let description = Description::saliency(
            "expected-gradients",
            "What each pixel contributes to the difference between the output for the frame and for other pictures",
        )
        .family("gradient")
        .source("Erion et al., \"Improving performance of deep learning models with axiomatic attribution priors and expected gradients\" (2021)")
        .mathematics(
            "`map = E[Σ_c (x_c - b_c) g_c(b + s (x - b))]` over the colours, with a picture `b` and an `s` from 0 to 1 that are drawn for each sample",
        )
        .drawn_per_frame("the pictures and the places on the lines");
        parameters(description)
            .parameter(sign_parameter())
            .parameter(Parameter::path("pictures", "a folder with pictures that the frame is compared with, such as frames of a recording; at most 256 of them are used, spread evenly over their names"))
            .parameter(
                Parameter::integer("samples", 64, "how many pairs of a picture and a place on its line are averaged")
                    .range(1.0, 10_000.0),
            )
    }

    fn new(viewer: &mut Viewer, config: &Config) -> Result<Self> {
        let folder = PathBuf::from(config.text("pictures"));
        let names = names(&folder)?;
        let count = names.len().min(MOST);
        let mut others = Vec::with_capacity(count);
        for at in 0..count {
            let path = folder.join(&names[at * names.len() / count]);
            let mut read = || viewer.fit(pdk_image::read(&path)?.as_ref());
            let picture = read().map_err(|error| error.at(path.display()))?;
            let mut values = vec![0.0; viewer.image_len()];
            viewer.numbers(picture.as_ref(), &mut values);
            others.push(values);
        }
        Ok(Self { derived: open(viewer)?, samples: config.integer("samples") as usize, others })
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let folder = PathBuf::from(config.text("pictures"));
        Ok(vec![InputFiles { what: "pictures".into(), names: names(&folder)?, folder }])
    }

    fn cells(&self, viewer: &Viewer) -> [usize; 2] {
        let (width, height) = viewer.size();
        [height, width]
    }

    fn grid(&mut self, viewer: &mut Viewer, frame: Frame<'_>, cx: &MapContext<'_>) -> Result<Grid> {
        let mut end = vec![0.0; viewer.image_len()];
        viewer.numbers(frame, &mut end);
        let mut random = cx.frame_random();
        let mut grid = empty(&self.derived.layer);
        for _ in 0..self.samples {
            let start = &self.others[random.below(self.others.len() as u32) as usize];
            let share = random.unit();
            let weight = 1.0 / self.samples as f64;
            along::add(&mut self.derived, viewer, [start, &end], [share, weight], &mut grid)?;
        }
        Ok(grid)
    }
}

/// The names of the pictures in a folder, in order.
fn names(folder: &Path) -> Result<Vec<PathBuf>> {
    let place = format!("cannot read the folder {}; name one with pictures as `pictures`", folder.display());
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).place(&place)? {
        let name = PathBuf::from(entry.place(&place)?.file_name());
        let is_picture = name.extension().is_some_and(|ending| {
            ["png", "jpg", "jpeg", "bmp", "webp"].iter().any(|known| ending.eq_ignore_ascii_case(known))
        });
        if is_picture {
            names.push(name);
        }
    }
    names.sort();
    match names.is_empty() {
        false => Ok(names),
        true => Err(Error::new(format!(
            "{} has no pictures; name a folder with some as `pictures`",
            folder.display()
        ))),
    }
}
