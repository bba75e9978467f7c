//! A universal perturbation: the same change of every frame.

use pdk_sdk::ops::change;
use pdk_sdk::ops::point::lookup;
use pdk_sdk::ops::resize::resize_linear;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::attack::{artwork, ball};

/// Adds a picture.
pub struct UniversalPerturbation {
    picture: FrameBuf,
    /// The picture in the size of the frame.
    resized: FrameBuf,
    /// What to add to each value and what to subtract from it, of which one is always 0; for this size and `epsilon`. Together they do what
    /// `change::added` does, without numbers of 16 bits.
    changes: [FrameBuf; 2],
    epsilon: Option<f32>,
}

impl Component for UniversalPerturbation {
    fn description() -> Description {
        let description = Description::perturbation(
            "universal_perturbation",
            "Adds the same small change to every frame, such as one that was trained so that a network steers elsewhere at all of them",
        )
        .family("attack")
        .not_default()
        .keeps_geometry()
        .example(json!({"picture": "dave2_universal"}))
        .mathematics("v + epsilon (p - 128) / 127, p the picture in the size of the frame")
        .source("Moosavi-Dezfooli et al., Universal Adversarial Perturbations, 2017")
        .parameter(artwork::parameter(
            "the change as a picture, as `pdk attack universal` writes one, in which 128 stands for none; or `dave2_universal`, which is part of \
             pdk",
        ));
        ball::epsilon(description, "no value changes by more than this, rounded down")
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self {
            picture: artwork::read(config)?,
            resized: FrameBuf::default(),
            changes: Default::default(),
            epsilon: None,
        })
    }
}

impl Perturbation for UniversalPerturbation {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = (src.width(), src.height());
        if (self.resized.width(), self.resized.height()) != (width, height) {
            self.resized.resize(width, height);
            resize_linear(self.picture.as_ref(), self.resized.as_mut());
            self.epsilon = None;
        }
        let epsilon = cx.number("epsilon") as f32;
        if self.epsilon != Some(epsilon) {
            for (changes, sign) in self.changes.iter_mut().zip([1, -1]) {
                let steps = |byte| sign * change::step(change::of_byte(byte as u8), epsilon);
                changes.resize(width, height);
                lookup(
                    self.resized.as_ref(),
                    changes.as_mut(),
                    &std::array::from_fn(|byte| steps(byte).clamp(0, 255) as u8),
                );
            }
            self.epsilon = Some(epsilon);
        }
        let [more, less] = self.changes.each_ref().map(FrameBuf::as_ref);
        for ((to, from), (more, less)) in dst.rows_mut().zip(src.rows()).zip(more.rows().zip(less.rows())) {
            for ((to, &from), (&more, &less)) in to.iter_mut().zip(from).zip(more.iter().zip(less)) {
                *to = from.saturating_add(more).saturating_sub(less);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::testing::Trial;
    use tempfile::NamedTempFile;

    use super::*;

    #[test]
    fn a_change_is_added_in_the_size_of_the_frame_and_limited() {
        let file = NamedTempFile::with_suffix(".png").unwrap();
        let picture = FrameBuf::from_vec(vec![255, 128, 1, 255, 128, 1], 2, 1).unwrap();
        pdk_image::write(file.path(), picture.as_ref()).unwrap();
        let frame = FrameBuf::from_vec(vec![100, 100, 100, 250, 2, 1, 7, 8, 9, 0, 0, 0], 4, 1).unwrap();
        let given = json!({"picture": file.path().to_str().unwrap()});
        let found = |level| {
            Trial::<UniversalPerturbation>::new(&given, level, Key([1; 32]))
                .unwrap()
                .frame(&frame, 0, 0.0)
                .unwrap()
        };
        assert_eq!(found(4.0).data(), [116, 100, 84, 255, 2, 0, 23, 8, 0, 16, 0, 0]);
        // An epsilon of 1.5 changes nothing by more than 1.
        assert_eq!(found(0.5).data(), [101, 100, 99, 251, 2, 0, 8, 8, 8, 1, 0, 0]);
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<UniversalPerturbation>();
    }
}
