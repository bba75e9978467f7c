//! Rain on the lens: drops that refract the scene, dry up, join, run down and leave tracks.

use pdk_sdk::prelude::*;

use crate::births::{Births, COLUMN, sequence_key};
use crate::focus::Focus;
use crate::lens::{Backdrop, Density, Lens, smooth, time_of, with_common};
use crate::rain::{LIFETIME, MEAN_LIFE, Sitting};
use crate::sliders::{self, AFTERMATH, DRIFT, Slider};
use crate::sweep::{Sweeper, Sweepers};
use crate::water::{Drop, Water};

/// Drops and sliders born in each cell, that is in a column of the lens in a second.
const DROPS: usize = 63;
const SLIDERS: usize = 2;
/// The most drops that sit on a square of the lens.
const MOST_DROPS: f64 = DROPS as f64 / COLUMN as f64 * MEAN_LIFE;
/// The wet track of a slider lasts this many seconds.
const TRACK: f32 = 1.6;

/// Drops of water on the lens.
pub struct RaindropsOnLens {
    drops: Births<Sitting>,
    sliders: Births<Slider>,
    /// The sliders that exist in the frame at hand.
    sweepers: Sweepers,
    water: Water,
    backdrop: Backdrop,
    focus: Focus,
}

impl Component for RaindropsOnLens {
    fn description() -> Description {
        let description = Description::perturbation(
            "raindrops_on_lens",
            "Drops of water sit on the lens out of focus, refract the scene, veil it, join and run down",
        )
        .family("lens")
        .keeps_geometry()
        .version(4)
        .dynamic()
        .source("Particles with bounded lives; caps joined by a smooth maximum, refracted by their slope")
        .mathematics(
            "h = max of R / 2 (1 - |p - c|² / R²); w(p) = blurred(p + 0.26 H grad h (1 + 0.55 |grad h|²)); \
             out = (1 - veil A) (v (1 - D * a) + D * (a w)) + veil A mean(v), a the water's opacity, A its mean, D a disc",
        )
        .divergence(
            "The published particles are half transparent and move at random with every frame; these refract or hide the \
             scene, and where they are follows from the key and the time alone.",
        )
        .drawn_per_sequence("where and when drops hit the lens, their shapes, paths and speeds")
        .parameter(
            Parameter::by_level(
                "number",
                [50.0, 110.0, 220.0, 400.0, 640.0],
                "drops, small ones included, on a square of the lens as high as the frame",
            )
            .range(0.0, MOST_DROPS),
        )
        .parameter(
            Parameter::by_level("size", [0.026, 0.033, 0.041, 0.05, 0.06], "radius of the largest drops")
                .range(0.0, 0.2)
                .unit("frame heights"),
        )
        .parameter(
            Parameter::number("defocus", 0.02, "radius of the disc that a point of a drop becomes, 128 pixels at most: drops are nearer than the focus")
                .range(0.0, 0.1)
                .unit("frame heights"),
        )
        .parameter(
            Parameter::number("veil", 0.35, "how much of the scene's mean brightness the drops scatter over the frame where they cover it")
                .range(0.0, 1.0),
        );
        with_common(description, "drops that run down", 0.23, "raining")
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self {
            drops: Births::new(1),
            sliders: Births::new(2),
            sweepers: Sweepers::default(),
            water: Water::default(),
            backdrop: Backdrop::default(),
            focus: Focus::default(),
        })
    }
}

impl Perturbation for RaindropsOnLens {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let lens = Lens::of(src);
        let time = time_of(cx)?;
        let density = Density::new((cx.number("number") / MOST_DROPS) as f32, lens, cx);
        let (size, speed) = (cx.number("size") as f32, cx.number("speed") as f32);
        let dry_before = -cx.number("since");
        let key = sequence_key(cx);
        self.drops.advance(&key, &lens, 0.1, (time, LIFETIME), |cell, random, into| {
            into.extend((0..DROPS).map(|_| Sitting::born(cell, random)));
        });
        self.sliders.advance(&key, &lens, DRIFT, (time, sliders::LIFETIME), |cell, random, into| {
            into.extend((0..SLIDERS).map(|_| Slider::born(cell, random)));
        });

        self.water.clear(&lens);
        self.sweepers.find(&self.sliders, &lens, (time, dry_before), (size, speed), &density);
        self.add_drops(&lens, time, dry_before, size, &density);
        self.add_tracks(&lens);
        self.add_sliders(&lens);
        self.backdrop.update(src, &lens);
        let Self { water, backdrop, focus, .. } = self;
        if water.is_dry() {
            dst.copy_from(src);
            return Ok(());
        }
        // Over black, so that it comes out times its opacity.
        let add = |seen: &mut FrameBuf, opacity: &mut FrameBuf| {
            water.refract(seen.as_mut(), backdrop);
            water.opacity(opacity.as_mut());
        };
        let radius = cx.number("defocus") * f64::from(lens.unit);
        focus.draw(src, dst, add, radius, (backdrop.brightness(), cx.number("veil") as f32));
        Ok(())
    }
}

impl RaindropsOnLens {
    /// Adds the drops that stay; sliders swallow those in their way.
    fn add_drops(&mut self, lens: &Lens, time: f64, dry_before: f64, size: f32, density: &Density<'_>) {
        let edge = lens.half_width() + 2.0 * size;
        for (_, drop) in self.drops.iter().filter(|(_, drop)| drop.born >= dry_before) {
            let presence = density.presence(drop.rank, drop.x, drop.y, drop.born);
            if presence <= 0.0 || drop.x.abs() > edge {
                continue;
            }
            let scale = drop.scale_at(time);
            if scale <= 0.0 {
                continue;
            }
            let radius = drop.radius * size * presence * scale;
            let age = (time - drop.born) as f32;
            let left = self.sweepers.swallow(&self.sliders, (drop.x, drop.y), radius, age);
            if left > 0.0 {
                drop.caps(radius * left, |cap| self.water.add(lens, cap));
            }
        }
    }

    /// Adds what sliders leave behind: small drops and a wet track.
    fn add_tracks(&mut self, lens: &Lens) {
        let edge = lens.half_width();
        for i in 0..self.sweepers.all.len() {
            let Sweeper { place, radius, reach, over, state, .. } = self.sweepers.all[i];
            if state.slid <= 0.0 || over > AFTERMATH as f32 || reach[0] > edge || reach[1] < -edge {
                continue;
            }
            let slider = self.sliders.at(place);
            for bead in &slider.beads {
                let shown = state.since(bead.progress).filter(|&(since, _)| since < bead.life);
                let Some((since, scale)) = shown.filter(|_| bead.y < 1.05 && bead.x.abs() < edge + 0.05)
                else {
                    continue;
                };
                let radius = bead.radius * radius * scale * smooth((bead.life - since) / 1.5);
                let left = self.sweepers.swallow(&self.sliders, (bead.x, bead.y), radius, since);
                let wobble = [bead.wobble, 0.1, 0.0, 0.0];
                self.water
                    .add(lens, &Drop { x: bead.x, y: bead.y, radius: radius * left, tail: 0.1, wobble });
            }
            let bottom = lens.to_pixels(0.0, state.y).1;
            if bottom < 0.0 {
                continue;
            }
            for row in (0..=(bottom as usize).min(lens.height - 1)).rev() {
                let y = (row as f32 + 0.5) / lens.unit;
                let Some((x, progress)) = slider.at_height(y) else { break };
                // Below the place where it dried up there is no track.
                let Some((since, scale)) = state.since(progress) else { continue };
                if since > TRACK {
                    break;
                }
                let fading = 1.0 - since / TRACK;
                // It ends in a tip, where it has dried and where it starts.
                let tip = smooth(fading * 2.0) * smooth((y - slider.y) / (3.0 * radius));
                let width = radius * scale * (0.25 + 0.3 * fading) * tip;
                self.water.add_film_row(lens, row, x, width);
            }
        }
    }

    /// Adds the sliders themselves.
    fn add_sliders(&mut self, lens: &Lens) {
        for Sweeper { place, radius, swallowed, state, .. } in &self.sweepers.all {
            let own = radius * state.scale;
            if own <= 0.0 {
                continue;
            }
            // What it swallowed makes it larger, up to a point: the rest stays behind as its track.
            let gained = (swallowed / (radius * radius * radius)).min(1.2);
            let radius = own * libm::cbrtf(1.0 + gained);
            let tail = (state.speed * 3.0).min(1.3);
            let wobble = self.sliders.at(*place).wobble;
            self.water.add(lens, &Drop { x: state.x, y: state.y, radius, tail, wobble });
            if state.joining > 0.0 {
                // A second drop runs into it, and then it is too heavy to stay.
                let away = radius * 1.55 * state.joining;
                let (x, y) = (state.x + state.side * away, state.y - 0.6 * away);
                self.water.add(lens, &Drop { x, y, radius: radius * 0.62, tail: 0.0, wobble: [0.0; 4] });
            }
        }
    }
}
