//! Water and snow so near to the camera that they are out of focus, and the light that they scatter over the frame.

use pdk_sdk::ops::average::{MAX_RADIUS, Workspace, disc_blur};
use pdk_sdk::prelude::*;

use crate::lens::to_byte;

/// Below this radius in pixels everything is in focus.
const SHARP: f64 = 0.5;

/// Lays what is on the lens over a frame.
#[derive(Default)]
pub struct Focus {
    /// What is seen in place of the frame, times its opacity, and the opacity in all channels.
    seen: FrameBuf,
    opacity: FrameBuf,
    soft_seen: FrameBuf,
    soft_opacity: FrameBuf,
    workspace: Workspace,
}

impl Focus {
    /// Lays over `src` what `add` adds to a black frame, times its opacity, and to a frame of opacities. A point of it becomes a disc
    /// with this radius in pixels, and the whole frame gets a share of stray light of this brightness: `veil` times the share of the
    /// frame that is covered.
    pub fn draw(
        &mut self,
        src: Frame<'_>,
        mut dst: FrameMut<'_>,
        add: impl FnOnce(&mut FrameBuf, &mut FrameBuf),
        radius: f64,
        (light, veil): (f32, f32),
    ) {
        let (width, height) = (src.width(), src.height());
        for frame in [&mut self.seen, &mut self.opacity] {
            frame.resize(width, height);
            frame.as_mut().data_mut().fill(0);
        }
        add(&mut self.seen, &mut self.opacity);
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
        let share = (veil * covered).min(1.0);
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
    use crate::lens::{Backdrop, Lens};
    use crate::water::{Drop, Water};

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
        let add = |seen: &mut FrameBuf, opacity: &mut FrameBuf| {
            water.refract(seen.as_mut(), &backdrop);
            water.opacity(opacity.as_mut());
        };
        Focus::default().draw(src.as_ref(), dst.as_mut(), add, radius, (backdrop.brightness(), veil));
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
