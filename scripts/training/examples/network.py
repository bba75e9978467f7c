"""Small convolutional networks in plain numpy: as much as the examples need, without a library for training.

A network is a few convolutions with a stride of 2 and two fully connected layers, all with ReLU but the last.
"""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

STRIDE = 2


def patches(images, size):
    """The patches that a convolution sees, one a row."""
    windows = np.lib.stride_tricks.sliding_window_view(images, (size, size), axis=(2, 3))[:, :, ::STRIDE, ::STRIDE]
    count, _, height, width = windows.shape[:4]
    return windows.transpose(0, 2, 3, 1, 4, 5).reshape(count * height * width, -1), (count, height, width)


class Convolution:
    def __init__(self, random, inputs, outputs, size):
        self.size, self.inputs = size, inputs
        scale = np.sqrt(2 / (inputs * size * size))
        self.weights = [random.normal(0, scale, (inputs * size * size, outputs)).astype(np.float32), np.zeros(outputs, np.float32)]

    def forward(self, images):
        self.shape = images.shape
        self.seen, (count, height, width) = patches(images, self.size)
        out = self.seen @ self.weights[0] + self.weights[1]
        self.positive = out > 0
        return np.maximum(out, 0).reshape(count, height, width, -1).transpose(0, 3, 1, 2)

    def backward(self, gradient):
        count, outputs, height, width = gradient.shape
        gradient = gradient.transpose(0, 2, 3, 1).reshape(-1, outputs) * self.positive
        self.gradients = [self.seen.T @ gradient, gradient.sum(0)]
        spread = (gradient @ self.weights[0].T).reshape(count, height, width, self.inputs, self.size, self.size)
        back = np.zeros(self.shape, np.float32)
        for y in range(self.size):
            for x in range(self.size):
                rows, columns = slice(y, y + STRIDE * height, STRIDE), slice(x, x + STRIDE * width, STRIDE)
                back[:, :, rows, columns] += spread[:, :, :, :, y, x].transpose(0, 3, 1, 2)
        return back


class Dense:
    def __init__(self, random, inputs, outputs, last):
        self.last = last
        self.weights = [random.normal(0, np.sqrt(2 / inputs), (inputs, outputs)).astype(np.float32), np.zeros(outputs, np.float32)]

    def forward(self, values):
        self.seen = values
        out = values @ self.weights[0] + self.weights[1]
        self.positive = out > 0
        return out if self.last else np.maximum(out, 0)

    def backward(self, gradient):
        gradient = gradient if self.last else gradient * self.positive
        self.gradients = [self.seen.T @ gradient, gradient.sum(0)]
        return gradient @ self.weights[0].T


class Network:
    """Images of `shape`, channels first, to `outputs` numbers. `convolutions` are channels and sizes of filters."""

    def __init__(self, shape, convolutions, hidden, outputs, seed=1):
        random = np.random.default_rng(seed)
        self.shape, self.convolutions = shape, []
        channels, height, width = shape
        for count, size in convolutions:
            self.convolutions.append(Convolution(random, channels, count, size))
            channels, height, width = count, (height - size) // STRIDE + 1, (width - size) // STRIDE + 1
        self.dense = [Dense(random, channels * height * width, hidden, False), Dense(random, hidden, outputs, True)]
        self.layers = self.convolutions + self.dense

    def forward(self, images):
        for layer in self.convolutions:
            images = layer.forward(images)
        self.middle = images.shape
        return self.dense[1].forward(self.dense[0].forward(images.reshape(len(images), -1)))

    def backward(self, gradient):
        for layer in reversed(self.dense):
            gradient = layer.backward(gradient)
        gradient = gradient.reshape(self.middle)
        for layer in reversed(self.convolutions):
            gradient = layer.backward(gradient)

    def train(self, images, loss, steps, batch=64, rate=1e-3, seed=1):
        """Adam. `loss` returns the loss and the gradient of outputs for the samples with these numbers."""
        random = np.random.default_rng(seed)
        moments = [[np.zeros_like(weights) for weights in layer.weights] for layer in self.layers for _ in (0, 1)]
        for step in range(1, steps + 1):
            chosen = random.integers(0, len(images), batch)
            value, gradient = loss(self.forward(images[chosen]), chosen)
            self.backward(gradient / batch)
            pace = rate * (0.5 + 0.5 * np.cos(np.pi * step / steps)) * np.sqrt(1 - 0.999**step) / (1 - 0.9**step)
            for place, layer in enumerate(self.layers):
                first, second = moments[2 * place], moments[2 * place + 1]
                for number, gradient in enumerate(layer.gradients):
                    first[number] += 0.1 * (gradient - first[number])
                    second[number] += 0.001 * (gradient**2 - second[number])
                    layer.weights[number] -= (pace * first[number] / (np.sqrt(second[number]) + 1e-8)).astype(np.float32)
            if step % 200 == 0:
                print(f"step {step}: loss {value:.4f}", flush=True)

    def save(self, path, output, notes):
        """Writes the network as an ONNX file with `image` in, of values from 0 to 255, and one output."""
        nodes, weights, before = [], [], "image"

        def keep(name, value):
            weights.append(numpy_helper.from_array(np.ascontiguousarray(value), name))
            return name

        for number, layer in enumerate(self.convolutions):
            kernel = layer.weights[0].T.reshape(-1, layer.inputs, layer.size, layer.size)
            # Training has values from 0 to 1, but pdk gives the network bytes.
            kernel = kernel / np.float32(255) if number == 0 else kernel
            inputs = [before, keep(f"kernel_{number}", kernel), keep(f"bias_{number}", layer.weights[1])]
            nodes += [
                helper.make_node("Conv", inputs, [f"conv_{number}"], f"conv_{number}", strides=[STRIDE, STRIDE]),
                helper.make_node("Relu", [f"conv_{number}"], [f"relu_{number}"], f"relu_{number}"),
            ]
            before = f"relu_{number}"
        nodes.append(helper.make_node("Flatten", [before], ["flat"], "flat", axis=1))
        hidden, last = self.dense
        inputs = ["flat", keep("weights_hidden", hidden.weights[0]), keep("bias_hidden", hidden.weights[1])]
        nodes += [helper.make_node("Gemm", inputs, ["hidden"], "hidden"), helper.make_node("Relu", ["hidden"], ["relu"], "relu")]
        nodes.append(helper.make_node("Gemm", ["relu", keep("weights", last.weights[0]), keep("bias", last.weights[1])], [output], output))
        count = last.weights[1].size
        image = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, *self.shape])
        result = helper.make_tensor_value_info(output, TensorProto.FLOAT, [1, count])
        graph = helper.make_graph(nodes, "example", [image], [result], weights)
        model = helper.make_model(graph, producer_name="pdk", opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
        helper.set_model_props(model, notes)
        onnx.checker.check_model(model)
        onnx.save(model, path)
