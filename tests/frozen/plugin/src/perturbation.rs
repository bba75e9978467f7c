//! A perturbation that writes what it is told into the picture.

use pdk_sdk::prelude::*;

/// The first pixels tell what it was given, the others are those of the source, darker by `amount`.
pub struct Frozen {
    text: String,
}

impl Component for Frozen {
    fn description() -> Description {
        Description::perturbation("frozen", "Tells what it was given")
            .family("test")
            .version(3)
            .drawn_per_frame("a number")
            .parameter(
                Parameter::by_level("amount", [1.0, 2.0, 3.0, 4.0, 5.0], "how much darker").range(0.0, 9.0),
            )
            .parameter(Parameter::choice("mode", &["soft", "hard"], "the second number"))
            .parameter(Parameter::text("text", "its length is the third number"))
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { text: config.text("text").to_owned() })
    }
}

impl Perturbation for Frozen {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        if self.text == "fail" {
            return Err(Error::of(ErrorKind::Nonsense, "as asked to"));
        }
        assert!(self.text != "panic", "as asked to");
        let amount = cx.number("amount") as u8;
        for y in 0..src.height() {
            for (to, from) in dst.row_mut(y).iter_mut().zip(src.row(y)) {
                *to = from.saturating_sub(amount);
            }
        }
        if src.width() > 2 {
            dst.set_pixel(0, 0, [cx.intensity as u8, cx.integer("mode") as u8, self.text.len() as u8]);
            let (frame, sequence) = (cx.frame_random().next_u32(), cx.sequence_random().next_u32());
            dst.set_pixel(1, 0, [cx.frame_index as u8, frame as u8, sequence as u8]);
        }
        Ok(())
    }
}
