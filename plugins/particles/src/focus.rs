//! Water so near to the camera that it is out of focus, and the light that it scatters over the frame.

use pdk_sdk::ops::average::{MAX_RADIUS, Workspace, disc_blur};
use pdk_sdk::prelude::*;

use crate::lens::{Backdrop, to_byte};
use crate::water::Water;

/// Below this radius in pixels everything is in focus.
const SHARP: f64 = 0.5;

/// Lays water over a frame.
#[derive(Default)]
pub struct Focus {
    /// What is seen through the water, times its opacity, and the opacity in all channels.
    seen: FrameBuf,
    opacity: FrameBuf,
    soft_seen: FrameBuf,
    soft_opacity: FrameBuf,
    workspace: Workspace,
}

impl Focus {
    /// Lays the water over `src`. A point of it becomes a disc with this radius in pixels, and the whole frame gets a share of stray
    /// light: `veil` times the share of the frame that the water covers.
    pub fn draw(
        &mut self,
        src: Frame<'_>,
        mut dst: FrameMut<'_>,
        (water, backdrop): (&Water, &Backdrop),
        radius: f64,
        veil: f32,
    ) {
        let (width, height) = (src.width(), src.height());
        if water.is_dry() {
            return dst.copy_from(src);
        }
        for frame in [&mut self.seen, &mut self.opacity] {
            frame.resize(width, height);
            frame.as_mut().data_mut().fill(0);
        }
        // Over black, so that it comes out times its opacity.
        water.refract(self.seen.as_mut(), backdrop);
        water.opacity(self.opacity.as_mut());
        let (seen, opacity) = match radius < SHARP {
            true => (&self.seen, &self.opacity),
            false => {
                let radius = radius.min(MAX_RADIUS);
                for (sharp, soft) in
                    [(&self.seen, &mut self.soft_seen), (&self.opacity, &mut self.soft_opacity)]
                {
                    soft.resize(width, height);
                    disc_blur(sharp.as_ref(), soft.as_mut(), radius, &mut self.workspace);
                }
                (&self.soft_seen, &self.soft_opacity)
            }
        };
        let covered: u64 = opacity.data().iter().map(|&value| u64::from(value)).sum();
        let covered = (covered as f64 / (255 * opacity.data().len()) as f64) as f32;
        let (light, share) = (backdrop.brightness(), (veil * covered).min(1.0));
        let (seen, opacity) = (seen.as_ref(), opacity.as_ref());
        for y in 0..height {
            let (seen, opacity) = (seen.row(y), opacity.row(y));
            let row = dst.row_mut(y).iter_mut().zip(src.row(y)).zip(seen.iter().zip(opacity));
            for ((out, &behind), (&seen, &opacity)) in row {
                let through =
                    f32::from(behind) * (1.0 - f32::from(opacity) * (1.0 / 255.0)) + f32::from(seen);
                *out = to_byte(through + (light - through) * share);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::Lens;
    use crate::water::Drop;

    fn drawn(radius: f64, veil: f32) -> FrameBuf {
        let mut src = FrameBuf::new(240, 240);
        for (x, y) in (0..240 * 240).map(|i| (i % 240, i / 240)) {
            src.as_mut().set_pixel(x, y, [if y < 120 { 230 } else { 40 }; 3]);
        }
        let lens = Lens::of(src.as_ref());
        let (mut water, mut backdrop) = (Water::default(), Backdrop::default());
        water.clear(&lens);
        water.add(&lens, &Drop { x: 0.0, y: 0.5, radius: 0.1, tail: 0.0, wobble: [0.0; 4] });
        backdrop.update(src.as_ref(), &lens);
        let mut dst = FrameBuf::new(240, 240);
        Focus::default().draw(src.as_ref(), dst.as_mut(), (&water, &backdrop), radius, veil);
        dst
    }

    /// The steepest step from pixel to pixel along a row through the drop.
    fn steepest(frame: &FrameBuf, y: usize) -> u8 {
        let row: Vec<u8> = (0..240).map(|x| frame.as_ref().pixel(x, y)[0]).collect();
        row.windows(2).map(|pair| pair[0].abs_diff(pair[1])).max().unwrap()
    }

    #[test]
    fn a_drop_out_of_focus_has_no_edge() {
        let (sharp, soft) = (drawn(0.0, 0.0), drawn(5.0, 0.0));
        assert!(steepest(&sharp, 140) > 60 && steepest(&soft, 140) < 30, "{}", steepest(&soft, 140));
        // It still shows the sky where the ground is.
        assert!(soft.as_ref().pixel(120, 135)[0] > 120);
        // Far from it, nothing has changed.
        assert_eq!(soft.as_ref().pixel(10, 10), [230; 3]);
    }

    #[test]
    fn stray_light_takes_contrast_from_the_whole_frame() {
        let veiled = drawn(5.0, 2.0);
        let (sky, ground) = (veiled.as_ref().pixel(10, 10)[0], veiled.as_ref().pixel(10, 230)[0]);
        assert!(sky < 228 && ground > 42, "{sky} {ground}");
    }
}
