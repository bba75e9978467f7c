//! Hue, saturation and value, as scikit-image computes them.

use pdk_sdk::prelude::*;

/// Changes hue, saturation and value of every pixel, each from 0 to 1. Fractions of grey levels are dropped, so a result that is whole
/// but for rounding counts as what rounding makes of it: the steps are those of scikit-image.
pub fn each_color(src: Frame<'_>, mut dst: FrameMut<'_>, change: impl Fn([f64; 3]) -> [f64; 3]) {
    // Pixels often repeat their neighbour.
    let (mut last, mut changed) = ([0; 3], to_bytes(change([0.0; 3])));
    for (from, to) in src.rows().zip(dst.rows_mut()) {
        for (from, to) in from.chunks_exact(3).zip(to.chunks_exact_mut(3)) {
            let pixel = [from[0], from[1], from[2]];
            if pixel != last {
                (last, changed) = (pixel, to_bytes(change(to_hsv(pixel))));
            }
            to.copy_from_slice(&changed);
        }
    }
}

/// Hue, saturation and value of a pixel.
fn to_hsv(pixel: [u8; 3]) -> [f64; 3] {
    let [r, g, b] = pixel.map(|value| f64::from(value) / 255.0);
    let (most, least) = (r.max(g).max(b), r.min(g).min(b));
    let delta = most - least;
    if delta == 0.0 {
        return [0.0, 0.0, most];
    }
    let sixth = if b == most {
        4.0 + (r - g) / delta
    } else if g == most {
        2.0 + (b - r) / delta
    } else {
        (g - b) / delta
    };
    let hue = sixth / 6.0;
    [if hue < 0.0 { hue + 1.0 } else { hue }, delta / most, most]
}

/// The pixel of a hue, a saturation and a value, its fractions dropped.
fn to_bytes([hue, saturation, value]: [f64; 3]) -> [u8; 3] {
    let sector = (hue * 6.0).floor();
    let place = hue * 6.0 - sector;
    let p = value * (1.0 - saturation);
    let q = value * (1.0 - place * saturation);
    let t = value * (1.0 - (1.0 - place) * saturation);
    let rgb = match sector as u32 % 6 {
        0 => [value, t, p],
        1 => [q, value, p],
        2 => [p, value, t],
        3 => [p, q, value],
        4 => [t, p, value],
        _ => [value, p, q],
    };
    rgb.map(|channel| (channel.clamp(0.0, 1.0) * 255.0) as u8)
}
