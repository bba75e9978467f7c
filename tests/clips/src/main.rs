//! Draws the clips in `scripts/overlays`. They are the same every time.
//!
//! `cargo run --release --example pdk-clips -- FOLDER` writes all of them to a folder; with `--pictures` it writes some frames of
//! each as PNG instead, over a grey road, to look at.

mod birds;
mod canvas;
mod drive;
mod effect;
mod lightning;
mod noise;
mod rain;
mod smoke;
mod snow;
mod sun;
mod video;

use std::io::{Error, Result};
use std::path::{Path, PathBuf};

use canvas::{Canvas, SIZE};
use effect::{CLIPS, Clip};

fn main() -> Result<()> {
    let mut pictures = false;
    let mut folder = None;
    let mut wanted = Vec::new();
    for argument in std::env::args().skip(1) {
        match argument.as_str() {
            "--pictures" => pictures = true,
            name if CLIPS.iter().any(|clip| clip.name == name) => wanted.push(argument),
            _ => folder = Some(PathBuf::from(argument)),
        }
    }
    let folder = folder.ok_or_else(|| Error::other("usage: pdk-clips [--pictures] FOLDER [CLIP]..."))?;
    std::fs::create_dir_all(&folder)?;
    for clip in CLIPS.iter().filter(|clip| wanted.is_empty() || wanted.iter().any(|name| name == clip.name)) {
        if pictures {
            write_pictures(clip, &folder)?;
            continue;
        }
        let effect = clip.effect();
        let frames = (0..clip.frames).map(|number| clip.frame(effect.as_ref(), number));
        let bytes = video::encode(frames, clip.rate, clip.quantiser)?;
        let path = folder.join(format!("{}.mp4", clip.name));
        std::fs::write(&path, &bytes)?;
        println!("{}: {} frames, {} bytes", path.display(), clip.frames, bytes.len());
    }
    Ok(())
}

fn write_pictures(clip: &Clip, folder: &Path) -> Result<()> {
    let effect = clip.effect();
    for number in [0, 20, 61, 63] {
        let canvas = clip.frame(effect.as_ref(), number);
        let path = folder.join(format!("{}_{number}.png", clip.name));
        over_grey(&canvas).save(path).map_err(Error::other)?;
    }
    Ok(())
}

/// A canvas over a grey that gets lighter towards the top.
fn over_grey(canvas: &Canvas) -> image::RgbImage {
    let (width, height) = (SIZE.0 as u32, SIZE.1 as u32);
    image::RgbImage::from_fn(width, height, |x, y| {
        let pixel = canvas.pixels()[(y * width + x) as usize];
        let grey = if (y as f32) < height as f32 * drive::HORIZON { 0.62 } else { 0.34 };
        image::Rgb([0, 1, 2].map(|c| ((pixel[c] + grey * (1.0 - pixel[3])) * 255.0 + 0.5) as u8))
    })
}
