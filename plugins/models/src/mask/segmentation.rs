//! The mask `segmentation`: what a network says that pixels show.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Value, json};

use crate::model_file;
use crate::picture::{PictureNetwork, parameters};

/// The pixels of some classes.
pub struct Segmentation {
    network: PictureNetwork,
    classes: Vec<usize>,
    channels: usize,
}

impl Component for Segmentation {
    fn description() -> Description {
        let description = Description::mask(
            "segmentation",
            "The pixels that a segmentation network counts among some classes",
        )
        .family("network")
        .source("Any network with a number for each class and pixel, such as those trained on Cityscapes");
        parameters(description).parameter(Parameter::json(
            "classes",
            json!(0),
            "the number of a class, from 0, or a list of several: 0 is the road of networks trained on Cityscapes, 13 its cars, \
             10 its sky",
        ))
    }

    fn new(config: &Config) -> Result<Self> {
        let network = PictureNetwork::open(config)?;
        let channels = network.channels()?;
        let given = config.value("classes");
        let most = if channels == 1 { 255 } else { channels - 1 };
        let class = |class: &Value| Some(class.as_u64()? as usize).filter(|class| *class <= most);
        let classes: Option<Vec<usize>> = match given {
            Value::Array(several) => several.iter().map(class).collect(),
            one => class(one).map(|class| vec![class]),
        };
        match classes.filter(|classes| !classes.is_empty()) {
            Some(classes) => Ok(Self { network, classes, channels }),
            None => Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "`classes` is {given}, but has to be a number from 0 to {most}, or a list of such numbers"
                ),
            )
            .at(&network.place)),
        }
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        Ok(model_file::weights(config.text("model")))
    }
}

impl Mask for Segmentation {
    fn weights(&mut self, frame: Frame<'_>, _: &MapContext<'_>, mut out: HeatmapMut<'_>) -> Result<()> {
        let Self { network, classes, channels } = self;
        let [width, height] = network.size;
        let values = network.run(frame)?.to_vec();
        let is_wanted = |pixel: usize| {
            let class = match *channels {
                // The class itself.
                1 => values[pixel].round() as usize,
                // The one with the largest number; of equal ones the first.
                count => {
                    let value = |class: usize| values[network.at(class, pixel, count)];
                    (1..count).fold(0, |best, class| if value(class) > value(best) { class } else { best })
                }
            };
            classes.contains(&class)
        };
        let wanted: Vec<bool> = (0..width * height).map(is_wanted).collect();
        let (columns, rows) = (out.width(), out.height());
        for y in 0..rows {
            let row = &wanted[(2 * y + 1) * height / (2 * rows) * width..][..width];
            for (x, value) in out.row_mut(y).iter_mut().enumerate() {
                *value = if row[(2 * x + 1) * width / (2 * columns)] { 1.0 } else { 0.0 };
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_onnx::testing::{Setting, Sketch};
    use pdk_onnx::{Tensor, model};
    use pdk_sdk::mask;

    /// A network of three classes: dark, red and bright, for images of 8 x 6.
    fn network() -> tempfile::NamedTempFile {
        let mut s = Sketch::new(13);
        s.input("image", &[1, 3, 6, 8]);
        // Class 0: 100. Class 1: red less green. Class 2: green.
        let weights = vec![0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 1.0, 0.0];
        let filter = s.weights("filter", Tensor::floats(&[3, 3, 1, 1], weights));
        let bias = s.weights("bias", Tensor::floats(&[3], vec![100.0, 0.0, 0.0]));
        s.node("Conv", &["image", &filter, &bias], "classes", &[("strides", Setting::Ints(&[1, 1]))]);
        let file = tempfile::NamedTempFile::with_suffix(".onnx").unwrap();
        std::fs::write(file.path(), model::encode(&s.model(&["classes"]))).unwrap();
        file
    }

    fn config(file: &tempfile::NamedTempFile, classes: &Value) -> Config {
        let given = json!({"model": file.path().to_str().unwrap(), "classes": classes, "engine": "pdk"});
        Config::check(&Segmentation::description(), given.as_object().unwrap()).unwrap()
    }

    #[test]
    fn a_network_that_remembers_is_refused() {
        let pilot = crate::fixture::Pilot::new(&["1", "3", "4", "6"]);
        let remembers =
            crate::fixture::Pilot { second_input: Some("sum_in"), copy: Some("sum_out"), ..pilot };
        let error = Segmentation::new(&config(&remembers.file(), &json!([0]))).err().unwrap().to_string();
        assert!(error.contains("it remembers frames, which only a driver can"), "{error}");
    }

    #[test]
    fn the_classes_are_those_that_the_network_sees() {
        let file = network();
        // Three columns: dark, red, bright; twice as large as the network's image.
        let mut frame = FrameBuf::new(24, 12);
        for (x, y) in (0..24 * 12).map(|at| (at % 24, at / 24)) {
            let color = [[10, 10, 10], [220, 20, 20], [200, 200, 200]][x / 8];
            frame.as_mut().set_pixel(x, y, color);
        }
        let key = Key([1; 32]);
        for (classes, expected) in
            [(json!(0), [1.0, 0.0, 0.0]), (json!(1), [0.0, 1.0, 0.0]), (json!([0, 2]), [1.0, 0.0, 1.0])]
        {
            let mut mask = Segmentation::new(&config(&file, &classes)).unwrap();
            let mut weights = vec![f32::NAN; 24 * 12];
            let out = HeatmapMut::new(&mut weights, 24, 12).unwrap();
            mask.weights(frame.as_ref(), &MapContext::new(0, 0.0, &key), out).unwrap();
            // In the middle of each column, since the edges are blended by the resizing.
            assert_eq!([4, 12, 20].map(|x| weights[6 * 24 + x]), expected, "{classes}");
            let config = config(&file, &classes);
            mask::check(&Segmentation::description(), &config, &mut |config| {
                Ok(Box::new(Segmentation::new(config)?))
            })
            .unwrap();
        }
        for wrong in [json!([]), json!(3), json!("road"), json!(-1), json!([0, 3])] {
            let error = Segmentation::new(&config(&file, &wrong)).err().unwrap().to_string();
            assert!(error.contains("from 0 to 2"), "{error}");
        }
    }
}
