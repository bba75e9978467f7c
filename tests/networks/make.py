#!/usr/bin/env python3
"""Makes the small networks in this folder, with weights drawn once and for all.

They are not trained: their outputs only have to depend on every step before them. `pip install onnx numpy`, then

    python3 tests/networks/make.py

writes them anew, and plain.py their outputs.
"""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

FOLDER = Path(__file__).parent
FLOAT = TensorProto.FLOAT


class Sketch:
    """Nodes and weights of a graph."""

    def __init__(self, seed):
        self.random = np.random.RandomState(seed)
        self.nodes, self.weights = [], []

    def weight(self, name, *shape, size=1.0, kind=np.float32):
        values = (self.random.standard_normal(shape) * size).astype(kind)
        self.weights.append(numpy_helper.from_array(values, name))
        return name

    def constant(self, name, values):
        self.weights.append(numpy_helper.from_array(np.array(values), name))
        return name

    def node(self, operator, inputs, output, **attributes):
        self.nodes.append(helper.make_node(operator, inputs, [output], **attributes))
        return output

    def features(self, image, channels, kind=np.float32, size=1.0):
        """Six features of an image in channels, rows and columns."""
        filters = self.weight("filters", 6, channels, 5, 5, size=size / np.sqrt(25 * channels), kind=kind)
        conv = self.node("Conv", [image, filters], "conv", strides=[8, 8])
        seen = self.node("Relu", [conv], "seen")
        return self.node("Flatten", [self.node("GlobalAveragePool", [seen], "pooled")], "features")

    def dense(self, features, inputs, outputs, name, size=1.0, kind=np.float32, end="Tanh"):
        weights = self.weight(f"{name}_weights", inputs, outputs, size=size, kind=kind)
        product = self.node("MatMul", [features, weights], f"{name}_product")
        return self.node(end, [product], name)

    def save(self, name, inputs, outputs):
        def value(name, kind, shape):
            return helper.make_tensor_value_info(name, kind, shape)

        graph = helper.make_graph(
            self.nodes, name, [value(*i) for i in inputs], [value(*o) for o in outputs], self.weights
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], producer_name="pdk")
        model.ir_version = 8
        onnx.checker.check_model(model)
        (FOLDER / f"{name}.onnx").write_bytes(model.SerializeToString(deterministic=True))


def mean_crop():
    s = Sketch(1)
    s.dense(s.features("image", 3), 6, 2, "control", size=1.5)
    s.save("mean_crop", [("image", FLOAT, [1, 3, 48, 96])], [("control", FLOAT, [1, 2])])


def yuv():
    s = Sketch(2)
    nchw = s.node("Transpose", ["input_1"], "nchw", perm=[0, 3, 1, 2])
    s.dense(s.features(nchw, 3), 6, 1, "angle", size=1.5)
    s.save("yuv", [("input_1", FLOAT, ["batch", 66, 200, 3])], [("angle", FLOAT, ["batch", 1])])


def categorical():
    s = Sketch(3)
    nchw = s.node("Transpose", ["img_in"], "nchw", perm=[0, 3, 1, 2])
    # Small changes of the picture choose another bin.
    features = s.node("Sin", [s.features(nchw, 3, size=60.0)], "waves")
    s.dense(features, 6, 15, "angle_out", size=4.0, end="Softmax")
    s.dense(features, 6, 20, "throttle_out", size=4.0, end="Softmax")
    s.save(
        "categorical",
        [("img_in", FLOAT, [1, 60, 80, 3])],
        [("angle_out", FLOAT, [1, 15]), ("throttle_out", FLOAT, [1, 20])],
    )


def stack():
    s = Sketch(4)
    s.dense(s.features("frames", 9), 6, 1, "steering", size=3.0)
    s.save("stack", [("frames", FLOAT, [1, 9, 32, 64])], [("steering", FLOAT, [1, 1])])


def recurrent():
    s = Sketch(5)
    features = s.features("image", 1)
    before = s.node("MatMul", ["hidden", s.weight("again", 4, 4, size=0.6)], "before")
    now = s.node("MatMul", [features, s.weight("take", 6, 4, size=1.5)], "now")
    hidden = s.node("Tanh", [s.node("Add", [now, before], "both")], "hidden_next")
    s.dense(hidden, 4, 1, "steering", size=0.7)
    s.dense(hidden, 4, 1, "throttle", size=0.7)
    s.save(
        "recurrent",
        [("image", FLOAT, [1, 1, 40, 60]), ("hidden", FLOAT, [1, 4])],
        [("throttle", FLOAT, [1, 1]), ("steering", FLOAT, [1, 1]), ("hidden_next", FLOAT, [1, 4])],
    )


def speed():
    s = Sketch(6)
    features = s.features("image", 3)
    all_of_it = s.node("Concat", [features, "v", "command"], "all", axis=1)
    s.dense(all_of_it, 10, 2, "control", size=0.6)
    s.save(
        "speed",
        [("image", FLOAT, [1, 3, 40, 60]), ("v", FLOAT, [1, 1]), ("command", FLOAT, [1, 3])],
        [("control", FLOAT, [1, 2])],
    )


def memory():
    s = Sketch(7)
    nchw = s.node("Transpose", ["img_in"], "nchw", perm=[0, 3, 1, 2])
    all_of_it = s.node("Concat", [s.features(nchw, 3), "mem_in"], "all", axis=1)
    s.dense(all_of_it, 12, 1, "n_outputs0", size=0.8)
    s.dense(all_of_it, 12, 1, "n_outputs1", size=0.8, end="Sigmoid")
    s.save(
        "memory",
        [("img_in", FLOAT, [1, 60, 80, 3]), ("mem_in", FLOAT, [1, 6])],
        [("n_outputs0", FLOAT, [1, 1]), ("n_outputs1", FLOAT, [1, 1])],
    )


def time():
    """Three frames in an axis of their own, which are read as channels."""
    s = Sketch(8)
    nchw = s.node("Transpose", ["img_in"], "planes", perm=[0, 1, 4, 2, 3])
    nchw = s.node("Reshape", [nchw, s.constant("joined", np.int64([1, 9, 32, 64]))], "nchw")
    s.dense(s.features(nchw, 9), 6, 2, "model_outputs", size=3.0)
    s.save("time", [("img_in", FLOAT, [1, 3, 32, 64, 3])], [("model_outputs", FLOAT, [1, 2])])


def differences():
    s = Sketch(9)
    s.dense(s.features("image", 3, size=2.0), 6, 1, "steering", size=1.5)
    s.save("differences", [("image", FLOAT, [1, 3, 32, 64])], [("steering", FLOAT, [1, 1])])


def half():
    s = Sketch(10)
    half = TensorProto.FLOAT16
    floats = s.node("Cast", ["image"], "floats", to=FLOAT)
    s.dense(s.features(floats, 3), 6, 2, "control_32", size=1.5)
    s.node("Cast", ["control_32"], "control", to=half)
    s.save("half", [("image", half, [1, 3, 32, 64])], [("control", half, [1, 2])])


def whole():
    s = Sketch(11)
    floats = s.node("Cast", ["image"], "floats", to=FLOAT)
    scaled = s.node("Mul", [floats, s.constant("scale", np.float32(1 / 255))], "scaled")
    nchw = s.node("Transpose", [scaled], "nchw", perm=[0, 3, 1, 2])
    s.dense(s.features(nchw, 3), 6, 2, "control", size=1.5)
    s.save("bytes", [("image", TensorProto.UINT8, [1, 32, 64, 3])], [("control", FLOAT, [1, 2])])


if __name__ == "__main__":
    for make in [mean_crop, yuv, categorical, stack, recurrent, speed, memory, time, differences, half, whole]:
        make()
