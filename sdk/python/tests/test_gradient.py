"""Gradients of networks, beside central differences of the networks themselves."""

from pathlib import Path

import numpy
import pytest

import pdk_perturb as pdk

onnxruntime = pytest.importorskip("onnxruntime", reason="onnxruntime is missing; `pip install onnxruntime`")

MODEL = Path(__file__).parents[3] / "scripts" / "models" / "dave2.onnx"


@pytest.fixture(scope="module")
def inputs():
    draws = numpy.random.default_rng(0)
    return (draws.random((1, 3, 66, 200)) * 255).astype(numpy.float32), numpy.array([[8.0]], numpy.float32)


@pytest.fixture(scope="module")
def controls():
    network = onnxruntime.InferenceSession(MODEL.read_bytes(), providers=["CPUExecutionProvider"])
    return lambda image, speed: network.run(None, {"image": image, "speed": speed})[0]


def test_the_gradient_of_the_steering_is_the_slope_of_the_network(inputs, controls):
    gradient = pdk.Gradient(MODEL, of="control[0]", by="image")
    assert gradient.objective == "control[0]" and gradient.by == ["image"]
    value, slope = gradient.with_value(*inputs)
    assert value == pytest.approx(float(controls(*inputs)[0, 0]), abs=1e-6)
    assert slope.shape == (1, 3, 66, 200)
    image, speed = inputs
    # Along the gradient itself, where the slope is steepest.
    direction = slope / numpy.abs(slope).max()
    step = numpy.float32(0.02)
    beyond, before = controls(image + step * direction, speed), controls(image - step * direction, speed)
    difference = float(beyond[0, 0] - before[0, 0]) / (2 * float(step))
    assert difference == pytest.approx(float((slope * direction).sum()), rel=0.02)


def test_a_loss_has_the_gradients_of_the_weights_that_the_chain_rule_gives(inputs, controls):
    loss = pdk.Gradient(MODEL, of="squared_error(control)", by=["connected.6.weight", "connected.6.bias"])
    target = [[0.3, 0.1]]
    value, slopes = loss.with_value(*inputs, target=target)
    assert {name: slope.shape for name, slope in slopes.items()} == {
        "connected.6.weight": (2, 10),
        "connected.6.bias": (2,),
    }
    # The bias is added before the hyperbolic tangent that ends the network, and the loss is the mean of two squares.
    control = controls(*inputs)[0]
    assert value == pytest.approx(float(((control - target) ** 2).mean()), abs=1e-6)
    bias = (control - target[0]) * (1 - control**2)
    assert slopes["connected.6.bias"] == pytest.approx(bias, abs=1e-5)
    # Each weight is multiplied by a value of the layer before.
    hidden = "/connected/connected.5/Relu_output_0"
    layer = [pdk.Gradient(MODEL, of=f"{hidden}[{place}]").with_value(*inputs)[0] for place in range(10)]
    assert max(layer) > 0.1
    assert slopes["connected.6.weight"] == pytest.approx(numpy.outer(bias, layer), abs=1e-5)


def test_what_does_not_fit_is_an_error_that_names_it(inputs):
    with pytest.raises(pdk.Error, match="there is no value `steering`"):
        pdk.Gradient(MODEL, of="steering")
    with pytest.raises(pdk.Error, match="no value or node `nothing`"):
        pdk.Gradient(MODEL, of="control[0]", by="nothing")
    with pytest.raises(pdk.Error, match="nowhere.onnx"):
        pdk.Gradient("nowhere.onnx")
    with pytest.raises(TypeError, match="model is bytes"):
        pdk.Gradient(b"")
    gradient = pdk.Gradient(MODEL, of="control[0]")
    with pytest.raises(TypeError, match="`speed` is missing; the inputs are image, speed"):
        gradient(inputs[0])
    with pytest.raises(TypeError, match="`image` is given twice"):
        gradient(*inputs, image=inputs[0])
    with pytest.raises(ValueError, match=r"`image` has the shape \(3, 66, 200\)"):
        gradient(inputs[0][0], inputs[1])
