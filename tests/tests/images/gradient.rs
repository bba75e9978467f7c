//! Gradients of networks as networks, on the command line.

use pdk_onnx::{Graph, Tensor, model};
use pdk_tests::{Pdk, repository, temp};

#[test]
fn the_gradient_of_a_network_is_a_network_that_computes_its_slope() {
    let folder = temp();
    let (network, out) =
        (repository().join("scripts/models/dave2.onnx"), folder.path().join("gradient.onnx"));
    let said = Pdk::new(["gradient"])
        .arg(&network)
        .arg("-o")
        .arg(&out)
        .args(["--of", "control[0] - 0.5 * mean(control)", "--by", "image"])
        .succeed();
    assert!(said.stdout.contains("gradient/image  (1, 3, 66, 200)"), "{}", said.stdout);
    let [before, after] = [&network, &out].map(|path| Graph::new(model::read(path).unwrap()).unwrap());
    let image = Tensor::from_fn(pdk_onnx::Element::FLOAT, &[1, 3, 66, 200], |at| {
        (at[1] * 50 + at[2] * 3 + at[3] * 7 % 31) as f64
    });
    let (mut image, speed) = (image.unwrap(), Tensor::floats(&[1, 1], vec![8.0]));
    let computed =
        after.evaluate(&[("image", &image), ("speed", &speed)], &["objective", "gradient/image"]).unwrap();
    let objective = |image: &Tensor| {
        let control = before.evaluate(&[("image", image), ("speed", &speed)], &["control"]).unwrap();
        let control = &control[0].values;
        control[0] - 0.25 * (control[0] + control[1])
    };
    assert!((computed[0].values[0] - objective(&image)).abs() < 1e-12);
    let slopes = &computed[1].values;
    let steepest = (0..slopes.len()).max_by(|a, b| slopes[*a].abs().total_cmp(&slopes[*b].abs())).unwrap();
    let mut moved = |step: f64| {
        image.values[steepest] += step;
        let value = objective(&image);
        image.values[steepest] -= step;
        value
    };
    let difference = (moved(1e-3) - moved(-1e-3)) / 2e-3;
    assert!((slopes[steepest] - difference).abs() < 1e-6 * difference.abs().max(1e-6), "{difference:e}");
    // The same command writes the same bytes.
    let again = folder.path().join("again.onnx");
    Pdk::new(["gradient"])
        .arg(&network)
        .arg("-o")
        .arg(&again)
        .args(["--of", "control[0] - 0.5 * mean(control)", "--by", "image"])
        .succeed();
    assert_eq!(std::fs::read(&out).unwrap(), std::fs::read(&again).unwrap());
}

#[test]
fn what_has_no_gradient_is_one_sentence_and_nothing_is_written() {
    let folder = temp();
    let (network, out) =
        (repository().join("scripts/models/dave2.onnx"), folder.path().join("gradient.onnx"));
    let gradient = || Pdk::new(["gradient"]).arg(&network).arg("-o").arg(&out);
    gradient().fail(1, &["--of is missing", "`control` (1, 2)", "VALUE[0]"]);
    gradient()
        .args(["--of", "steering"])
        .fail(1, &["there is no value `steering`", "the outputs are `control`"]);
    gradient().args(["--of", "control[2]"]).fail(1, &["from control[0] to control[1]"]);
    gradient().args(["--of", "control[0]", "--by", "nothing"]).fail(1, &["no value or node `nothing`"]);
    Pdk::new(["gradient", "nowhere.onnx", "-o"]).arg(&out).fail(1, &["nowhere.onnx"]);
    Pdk::new(["gradient"])
        .arg(&network)
        .arg("-o")
        .arg(&network)
        .fail(1, &["the result would replace", "name another file with -o"]);
    assert!(!out.exists());
}
