//! Bit errors: some bits of a compressed stream arrive wrong.

use pdk_sdk::ops::jpeg::Quantisation;
use pdk_sdk::prelude::*;

use crate::codec::{Codec, MACROBLOCK};

/// Lets bits of the compressed frame arrive wrong.
pub struct BitErrors {
    codec: Codec,
}

impl Component for BitErrors {
    fn description() -> Description {
        Description::perturbation(
            "bit_errors",
            "Compresses the frame and lets some bits of the stream arrive wrong: colours and blocks go wrong up to the end of a slice, and what \
             cannot be decoded is that of the frame before",
        )
        .version(2)
        .family("stream")
        .dynamic()
        .not_default()
        .alters_geometry()
        .history(1)
        .mathematics("decode(encode(frame) xor e), each bit of e is 1 with the probability of an error")
        .drawn_per_frame("which bits are wrong")
        .source("Binary symmetric channel of Shannon (1948); an intra codec of the kind of ITU-T T.81 with codes of Golomb (1966), slices, and concealment by the frame before, as decoders of H.264 do")
        .parameter(
            Parameter::by_level("errors", [0.000_005, 0.000_02, 0.000_08, 0.0003, 0.001], "probability that a bit is wrong").range(0.0, 0.1),
        )
        .parameter(
            Parameter::number("coarseness", 0.5, "multiple of the quantisation steps of the standard's annex, to 0.01; steps end at 255; 0.5 is a quality of 75 as JPEG has it")
                .range(0.02, 25.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { codec: Codec::new() })
    }
}

impl Perturbation for BitErrors {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let quantisation = Quantisation::of_percent((100.0 * cx.number("coarseness")).round() as u32);
        self.codec.encode(src, &quantisation);
        let errors = cx.number("errors");
        if errors > 0.0 {
            let (mut random, length) = (cx.frame_random(), self.codec.length() as f64);
            // How many bits are right before the next one that is wrong.
            let mut right = || (libm::log1p(-random.unit()) / libm::log1p(-errors)).floor();
            let mut place = right();
            while place < length {
                self.codec.flip(place as usize);
                place += 1.0 + right();
            }
        }
        self.codec.decode(&quantisation);
        self.codec.write(dst.reborrow(), &quantisation);
        let before = cx.history.back(1).map(|earlier| earlier.frame);
        for (row, decoded) in self.codec.broken() {
            let hidden = 3 * decoded * MACROBLOCK;
            for y in row * MACROBLOCK..((row + 1) * MACROBLOCK).min(src.height()) {
                let to = &mut dst.row_mut(y)[hidden..];
                match before {
                    Some(before) => to.copy_from_slice(&before.row(y)[hidden..]),
                    // A decoder that has nothing yet shows grey.
                    None => to.fill(128),
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::BitErrors;
    use crate::test_sequence::{any_frame_can_be_computed_alone, mark, pixels};

    #[test]
    fn without_errors_even_frames_come_through() {
        for (index, frame) in pixels::<BitErrors>(&json!({"errors": 0}), 0.0, 40).iter().enumerate() {
            assert!(frame.data().iter().all(|value| value.abs_diff(mark(index)) <= 4), "frame {index}");
        }
    }

    #[test]
    fn more_errors_change_more_frames() {
        let changed = |errors: f64| {
            let frames = pixels::<BitErrors>(&json!({"errors": errors}), 0.0, 200);
            frames
                .iter()
                .enumerate()
                .filter(|(index, frame)| frame.data().iter().any(|value| value.abs_diff(mark(*index)) > 8))
                .count()
        };
        // An even frame has few bits, so it takes many errors.
        let all = [0.0, 0.001, 0.01, 0.05].map(changed);
        assert!(all[0] == 0 && all.windows(2).all(|pair| pair[0] < pair[1]), "{all:?}");
    }

    #[test]
    fn any_frame_needs_its_predecessors_alone() {
        any_frame_can_be_computed_alone::<BitErrors>();
        crate::allocations::on_the_first_frames_alone::<BitErrors>();
    }
}
