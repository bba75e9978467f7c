//! Writes frames of a video as pictures: `cargo run --release -p pdk-video --example frames -- VIDEO FOLDER NUMBER...`

use std::path::Path;
use std::time::Instant;

use pdk_sdk::prelude::*;
use pdk_video::{Reader, Yuv420};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [video, folder, numbers @ ..] = &arguments[..] else {
        return Err(Error::new("usage: frames VIDEO FOLDER NUMBER..."));
    };
    let mut reader = Reader::open_file(Path::new(video)).map_err(|error| error.at(video))?;
    println!("{} frames, {} a second", reader.count(), reader.rate());
    let (mut planes, mut rgb) = (Yuv420::default(), FrameBuf::default());
    let begin = Instant::now();
    let mut count = 0;
    while reader.next(&mut planes).map_err(|error| error.at(video))? {
        if numbers.contains(&count.to_string()) {
            rgb = FrameBuf::new(planes.width, planes.height);
            planes.to_rgb(rgb.as_mut());
            pdk_image::write(&Path::new(folder).join(format!("{count}.png")), rgb.as_ref())?;
        }
        count += 1;
    }
    let milliseconds = begin.elapsed().as_secs_f64() * 1e3 / f64::from(count.max(1));
    println!(
        "{count} frames decoded, {milliseconds:.2} ms each; the last of {} x {}",
        rgb.width(),
        rgb.height()
    );
    Ok(())
}
