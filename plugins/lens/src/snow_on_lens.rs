//! Snow on the lens: flakes land, stick, creep down in wide curves, pile up at the lower edge and melt to water.

use pdk_sdk::prelude::*;

use crate::births::{Births, COLUMN, sequence_key};
use crate::flakes::{DRIFT, Flake, LIFETIME, MEAN_LIFE};
use crate::focus::Focus;
use crate::lens::{Backdrop, Density, Lens, smooth, time_of, with_common};
use crate::snow_cover::{Bank, SnowCover};
use crate::water::{Drop, Water};

/// Flakes born in each cell, that is in a column of the lens in a second.
const FLAKES: usize = 10;
/// The most flakes on a square of the lens.
const MOST_FLAKES: f64 = FLAKES as f64 / COLUMN as f64 * MEAN_LIFE;

/// Flakes of snow on the lens.
pub struct SnowOnLens {
    flakes: Births<Flake>,
    cover: SnowCover,
    bank: Bank,
    water: Water,
    backdrop: Backdrop,
    focus: Focus,
}

impl Component for SnowOnLens {
    fn description() -> Description {
        let description = Description::perturbation(
            "snow_on_lens",
            "Flakes of snow land on the lens out of focus, veil the scene, creep down, pile up at the lower edge and melt",
        )
        .family("lens")
        .keeps_geometry()
        .version(4)
        .dynamic()
        .source("Particles with bounded lives; stamps of clumps over water refracted by its slope")
        .mathematics(
            "a = 0.96 (1 - 1 / (1 + t + t²)), t = 1.35 times the sum of the flakes' densities; \
             out = (1 - veil A) (v (1 - D * a) + D * (a snow)) + veil A mean(v), A the mean of a, D a disc",
        )
        .divergence(
            "The published particles are half transparent and move at random with every frame; these refract or hide the \
             scene, and where they are follows from the key and the time alone.",
        )
        .drawn_per_sequence("where and when flakes land, their shapes, paths and speeds")
        .parameter(
            Parameter::by_level(
                "number",
                [16.0, 36.0, 64.0, 100.0, 145.0],
                "flakes on a square of the lens as high as the frame",
            )
            .range(0.0, MOST_FLAKES),
        )
        .parameter(
            Parameter::by_level("size", [0.03, 0.036, 0.043, 0.051, 0.06], "radius of the largest flakes")
                .range(0.0, 0.2)
                .unit("frame heights"),
        )
        .parameter(
            Parameter::number("defocus", 0.02, "radius of the disc that a point of a flake becomes, 128 pixels at most: flakes are nearer than the focus")
                .range(0.0, 0.1)
                .unit("frame heights"),
        )
        .parameter(
            Parameter::number("veil", 0.2, "how much of the scene's mean brightness the flakes scatter over the frame where they cover it")
                .range(0.0, 1.0),
        );
        with_common(description, "flakes that came loose", 0.04, "snowing")
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self {
            flakes: Births::new(3),
            cover: SnowCover::new(),
            bank: Bank::default(),
            water: Water::default(),
            backdrop: Backdrop::default(),
            focus: Focus::default(),
        })
    }
}

impl Perturbation for SnowOnLens {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let lens = Lens::of(src);
        let time = time_of(cx)?;
        let density = Density::new((cx.number("number") / MOST_FLAKES) as f32, lens, cx);
        let (size, speed) = (cx.number("size") as f32, cx.number("speed") as f32);
        let clear_before = -cx.number("since");
        self.flakes.advance(&sequence_key(cx), &lens, DRIFT, (time, LIFETIME), |cell, random, into| {
            into.extend((0..FLAKES).map(|_| Flake::born(cell, random)));
        });

        self.water.clear(&lens);
        self.cover.clear(&lens);
        self.bank.clear(&lens);
        for (_, flake) in self.flakes.iter().filter(|(_, flake)| flake.born >= clear_before) {
            let presence = density.presence(flake.rank, flake.x, flake.y, flake.born);
            if presence <= 0.0 {
                continue;
            }
            let Some(now) = flake.at_time(time, speed) else { continue };
            let radius = flake.radius * size * presence * now.scale;
            if now.lying > 0.0 {
                self.bank.add(now.x, flake.radius * size * presence, now.lying);
            }
            if now.frozen > 0.0 {
                let density = flake.density * now.frozen.min(1.0);
                self.cover.add(&lens, (now.x, now.y), radius, flake.stamp, flake.turn, density);
                // Water gathers below the middle of a flake that melts, and dries up with it.
                let wet = smooth((0.6 - now.frozen) * 2.0) * smooth(now.frozen * 3.0);
                let drop = Drop {
                    x: now.x,
                    y: now.y + 0.35 * radius,
                    radius: 0.5 * radius * wet,
                    tail: 0.0,
                    wobble: [0.0; 4],
                };
                self.water.add(&lens, &drop);
            }
        }
        self.bank.settle();
        self.cover.add_bank(&lens, &self.bank);
        self.backdrop.update(src, &lens);
        let Self { cover, water, backdrop, focus, .. } = self;
        // Over black, so that it comes out times its opacity.
        let add = |seen: &mut FrameBuf, opacity: &mut FrameBuf| {
            water.refract(seen.as_mut(), backdrop);
            water.opacity(opacity.as_mut());
            cover.draw(seen.as_mut(), &lens, backdrop);
            cover.opacity(opacity.as_mut());
        };
        let radius = cx.number("defocus") * f64::from(lens.unit);
        focus.draw(src, dst, add, radius, (backdrop.brightness(), cx.number("veil") as f32));
        Ok(())
    }
}
