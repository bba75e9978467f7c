//! Things with hard edges before screens: nothing of the screen may be left at their edges.

use crate::edges::Edges;
use crate::key::{Keyer, Matte};
use crate::picture::{Layout, Picture, Samples, luma_and_chroma};

const SCREENS: [([f32; 3], usize); 4] =
    [([5.0, 193.0, 66.0], 1), ([0.0, 255.0, 0.0], 1), ([20.0, 40.0, 230.0], 2), ([0.0, 71.0, 187.0], 2)];
const SIZE: (usize, usize) = (128, 96);

/// How much of each pixel a disc and a leaning bar cover, with edges as sharp as pixels allow.
fn covered(x: usize, y: usize) -> f32 {
    share_of(x, y, |x, y| {
        let disc = (x - 38.3).powi(2) + (y - 46.7).powi(2) < 22.0 * 22.0;
        let bar = (x + 0.3 * y - 100.0).abs() < 11.0 && (14.0..80.5).contains(&y);
        disc || bar
    })
}

/// How much of a pixel what `is_inside` describes covers.
fn share_of(x: usize, y: usize, is_inside: impl Fn(f32, f32) -> bool) -> f32 {
    let parts = (0..16).filter(|part| {
        let (x, y) = (x as f32 + (part % 4) as f32 / 4.0 + 0.125, y as f32 + (part / 4) as f32 / 4.0 + 0.125);
        is_inside(x, y)
    });
    parts.count() as f32 / 16.0
}

/// Things of one colour before a screen, as a picture or as video has it.
fn picture(screen: [f32; 3], thing: [f32; 3], layout: Layout) -> Picture {
    let mut picture = Picture::default();
    picture.reset(SIZE.0, SIZE.1, layout);
    let at = |x: usize, y: usize| {
        let share = covered(x, y);
        std::array::from_fn(|i| thing[i] * share + screen[i] * (1.0 - share))
    };
    if layout == Layout::Rgba {
        for (place, pixel) in picture.data.chunks_exact_mut(4).enumerate() {
            let colour: [f32; 3] = at(place % SIZE.0, place / SIZE.0);
            pixel.copy_from_slice(&[colour[0] as u8, colour[1] as u8, colour[2] as u8, 255]);
        }
        return picture;
    }
    let [luma, blue, red] = picture.planes_mut();
    for (place, out) in luma.iter_mut().enumerate() {
        *out = (luma_and_chroma(at(place % SIZE.0, place / SIZE.0))[0] + 16.5) as u8;
    }
    for (place, (blue, red)) in blue.iter_mut().zip(red).enumerate() {
        let (x, y) = (place % (SIZE.0 / 2) * 2, place / (SIZE.0 / 2) * 2);
        let four = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| luma_and_chroma(at(x, y)));
        let mean = |i: usize| (four.iter().map(|colour| colour[i]).sum::<f32>() / 4.0 + 128.5) as u8;
        (*blue, *red) = (mean(1), mean(2));
    }
    picture
}

/// By how much each pixel has too much of the screen's colour, and how far the sum of alpha is from the truth, as a share.
fn fringe(screen: ([f32; 3], usize), thing: [f32; 3], layout: Layout) -> (Vec<f32>, f32) {
    let picture = picture(screen.0, thing, layout);
    let Matte::Screen(found) = Matte::find(std::slice::from_ref(&picture), None).unwrap() else { panic!() };
    let (mut samples, mut rgba) = (Samples::default(), Vec::new());
    let width = found.samples(&picture, false, &mut samples);
    let keyer = Keyer::new(found);
    keyer.key(&samples, &mut rgba);
    keyer.clean(&samples, width, &mut Edges::default(), &mut rgba);
    let excess = rgba
        .chunks_exact(4)
        .map(|pixel| f32::from(pixel[screen.1]) - thing[screen.1] * f32::from(pixel[3]) / 255.0);
    let alpha: f32 = rgba.chunks_exact(4).map(|pixel| f32::from(pixel[3]) / 255.0).sum();
    let truth: f32 = (0..SIZE.0 * SIZE.1).map(|place| covered(place % SIZE.0, place / SIZE.0)).sum();
    (excess.filter(|excess| *excess > 10.0).collect(), (alpha / truth - 1.0).abs())
}

#[test]
fn hard_edges_have_no_fringe() {
    for screen in SCREENS {
        for thing in [
            [255.0; 3],
            [128.0; 3],
            [10.0; 3],
            [220.0, 40.0, 30.0],
            [240.0, 220.0, 60.0],
            [200.0, 150.0, 120.0],
            [160.0, 40.0, 160.0],
            [60.0, 90.0, 220.0],
            [40.0, 160.0, 60.0],
        ] {
            let of = |colour: [f32; 3]| luma_and_chroma(colour);
            let (a, b) = (of(screen.0), of(thing));
            // What has the hue of the screen cannot be told from it.
            if a[1] * b[1] + a[2] * b[2] > 0.3 * (libm::hypotf(a[1], a[2]) * libm::hypotf(b[1], b[2]))
                && libm::hypotf(b[1], b[2]) > 20.0
            {
                continue;
            }
            for layout in [Layout::Rgba, Layout::Yuv420] {
                let (fringe, error) = fringe(screen, thing, layout);
                let most = fringe.iter().copied().fold(0.0, f32::max);
                assert!(
                    fringe.is_empty() && error < 0.03,
                    "{screen:?} {thing:?} {layout:?}: {} pixels with up to {most} too much, alpha off by {error}",
                    fringe.len()
                );
            }
        }
    }
}
