//! Strips of frames over time, to look at: `PDK_PICTURES=FOLDER cargo test --release -p pdk-particles -- --ignored pictures`

use std::path::PathBuf;

use pdk_sdk::prelude::*;

use crate::raindrops_on_lens::RaindropsOnLens;
use crate::snow_on_lens::SnowOnLens;
use crate::tests::Film;

/// Frames in a strip, over [`SECONDS`].
const FRAMES: usize = 8;
const SECONDS: f64 = 5.0;

fn road() -> Option<FrameBuf> {
    let data = std::env::var_os("PDK_TEST_DATA")
        .map(PathBuf::from)
        .unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"));
    let path = data.join("road/solidYellowLeft.jpg");
    let path = if path.is_file() { path } else { data.join("data/road/solidYellowLeft.jpg") };
    pdk_image::read(&path).ok()
}

/// The road, smaller: means over blocks.
fn shrunk(src: &FrameBuf, by: usize) -> FrameBuf {
    let mut dst = FrameBuf::new(src.width() / by, src.height() / by);
    for y in 0..dst.height() {
        for x in 0..dst.width() {
            let mut sums = [0; 3];
            for (i, j) in (0..by * by).map(|k| (k % by, k / by)) {
                let pixel = src.as_ref().pixel(x * by + i, y * by + j);
                (0..3).for_each(|c| sums[c] += usize::from(pixel[c]));
            }
            dst.as_mut().set_pixel(x, y, sums.map(|sum| (sum / (by * by)) as u8));
        }
    }
    dst
}

fn save(frame: &FrameBuf, path: PathBuf) {
    pdk_image::write(&path, frame.as_ref()).unwrap();
    println!("{}", path.display());
}

fn strips<P: Component + Perturbation>(folder: &std::path::Path, road: &FrameBuf) {
    let name = P::description().name;
    let small = shrunk(road, 2);
    let (width, height) = (small.width(), small.height());
    for level in [0.0, 1.0, 2.0, 4.0] {
        let mut film = Film::<P>::new("{}", level);
        let mut sheet = FrameBuf::new(width * 2, height * FRAMES / 2);
        for i in 0..FRAMES {
            let frame = film.at(&small, i as f64 * SECONDS / (FRAMES - 1) as f64);
            let (left, top) = (i % 2 * width, i / 2 * height);
            for (y, row) in frame.as_ref().rows().enumerate() {
                sheet.as_mut().row_mut(top + y)[left * 3..][..width * 3].copy_from_slice(row);
            }
        }
        save(&sheet, folder.join(format!("{name}_{level}.png")));
    }
    save(&Film::<P>::new("{}", 3.0).at(road, 2.0), folder.join(format!("{name}_large.png")));
}

#[test]
#[ignore = "writes pictures to the folder that PDK_PICTURES names"]
fn pictures() {
    let folder = PathBuf::from(std::env::var_os("PDK_PICTURES").expect("PDK_PICTURES names a folder"));
    let road = road().expect("the recording of a road lies under PDK_TEST_DATA");
    strips::<RaindropsOnLens>(&folder, &road);
    strips::<SnowOnLens>(&folder, &road);
}
