"""The network that repaints: small, fully convolutional, and exact.

Its arithmetic is exact in 32-bit floats. Activations are whole numbers from 0 to 1023, weights are multiples of a power of
two, and each layer's weights are so small that no sum of products needs more than the 24 bits of a float's mantissa. So every
sum is the same in whatever order it is taken, with fused multiplications or without: any processor and any program that runs
the file gives the same picture, bit for bit. In training the same rounding lets gradients pass (Bengio et al., "Estimating or
Propagating Gradients Through Stochastic Neurons for Conditional Computation", 2013).

Its shape is that of the networks of Johnson et al., "Perceptual Losses for Real-Time Style Transfer" (2016): convolutions
that halve the size, residual blocks, others that double it, as nearest neighbours and a convolution, which leaves no checkerboard
(Odena et al., "Deconvolution and Checkerboard Artifacts", 2016). Styles halve the size twice. Weather halves it three times, so that the
blocks see as far as from the road to what it mirrors. What each half saw goes on to its counterpart, so that edges stay
where they are. With several styles each layer has a factor and an offset a channel for each of them, and its weights are shared
(Dumoulin et al., "A Learned Representation for Artistic Style", 2017), but for the last two, which are small.
"""

import math

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import nn
from torch.nn import functional

STEP = 1 / 256  # between two activations
LARGEST = 1023 * STEP  # activation
FACTOR_STEP = 1 / 64  # between two factors of a style
MANTISSA = 2.0**24
OPSET = 17


def snapped(values, step):
    """The nearest multiples of a step; gradients pass as if nothing had happened."""
    return values + (torch.round(values / step) * step - values).detach()


class Layer(nn.Module):
    """A convolution that keeps the size or halves it, with a factor and an offset for each style, or weights of its own."""

    def __init__(self, before, after, size, stride=1, styles=0, gain=1.0, own=False):
        super().__init__()
        self.stride, self.padding, self.own = stride, size // 2, own and styles > 0
        each = (styles,) if self.own else ()
        self.weight = nn.Parameter(torch.randn(*each, after, before, size, size) * gain * math.sqrt(2 / (before * size * size)))
        self.bias = nn.Parameter(torch.zeros(*each, after))
        if styles and not own:
            self.factor = nn.Parameter(1 + 0.4 * torch.randn(styles, after, 1, 1))
            self.offset = nn.Parameter(0.3 * torch.randn(styles, after, 1, 1))
        else:
            self.factor = self.offset = None

    def exact(self):
        """Weights and bias such that no sum needs more digits than a float has."""
        most = (self.weight.abs().sum((-3, -2, -1)) * (LARGEST + STEP) + self.bias.abs() + 1).max().item()
        step = 2.0 ** math.ceil(math.log2(most / STEP / MANTISSA))
        return snapped(self.weight, step), snapped(self.bias, STEP)

    def exact_style(self):
        return snapped(self.factor.clamp(-3, 3), FACTOR_STEP), snapped(self.offset, STEP)

    def forward(self, x, style, exact):
        weight, bias = self.exact() if exact else (self.weight, self.bias)
        if self.own:
            convolved = [functional.conv2d(x[i:i + 1], weight[s], bias[s], self.stride, self.padding) for i, s in enumerate(style)]
            y = torch.cat(convolved)
        else:
            y = functional.conv2d(x, weight, bias, self.stride, self.padding)
        if exact:
            y = snapped(y, STEP)
        if self.factor is not None:
            factor, offset = self.exact_style() if exact else (self.factor, self.offset)
            y = y * factor[style] + offset[style]
            if exact:
                y = snapped(y, STEP)
        return y


def rectified(x):
    return x.clamp(0, LARGEST)


def doubled(x):
    return functional.interpolate(x, scale_factor=2, mode="nearest")


class Painter(nn.Module):
    def __init__(self, styles=0, width=16, blocks=3, detail=8, halvings=2):
        super().__init__()
        self.styles = styles
        self.down = nn.ModuleList([Layer(3, width, 5, 2, styles), Layer(width, 2 * width, 3, 2, styles)])
        for _ in range(2, halvings):
            self.down.append(Layer(2 * width, 2 * width, 3, 2, styles))
        self.blocks = nn.ModuleList([
            nn.ModuleList([
                Layer(2 * width, 2 * width, 3, 1, styles),
                Layer(2 * width, 2 * width, 3, 1, styles, 0.3),
            ])
            for _ in range(blocks)
        ])
        self.up = nn.ModuleList([Layer(2 * width, 2 * width, 3, 1, styles) for _ in range(2, halvings)])
        self.up.append(Layer(2 * width, width, 3, 1, styles))
        self.detail = Layer(width + 3, detail, 3, 1, styles, own=True)
        self.paint = Layer(detail + 3, 3, 3, 1, styles, 0.3, own=True)
        with torch.no_grad():
            for channel in range(3):  # it begins with the picture itself
                self.paint.weight[..., channel, detail + channel, 1, 1] += 1
            self.paint.bias += 2
        self.exact = False

    def forward(self, image, style=None):
        """An image of 0 to 255 as (batch, 3, height, width), both multiples of eight; with styles, the number of one for each."""
        x = h = image / 64 - 2
        sizes = []
        for layer in self.down:
            h = rectified(layer(h, style, self.exact))
            sizes.append(h)
        for inner, outer in self.blocks:
            h = rectified(h + outer(rectified(inner(h, style, self.exact)), style, self.exact))
        for layer, before in zip(self.up, sizes[-2::-1]):
            h = rectified(before + layer(doubled(h), style, self.exact))
        h = rectified(self.detail(torch.cat([doubled(h), x], 1), style, self.exact))
        y = self.paint(torch.cat([h, x], 1), style, self.exact)
        if self.exact:
            # Exported, this layer has a quarter of the weights, so that its sums are bytes.
            return snapped(y, 4 * STEP).clamp(0, 255 * 4 * STEP) * 64
        inside = y.clamp(0, 255 / 64)
        return (inside + 0.05 * (y - inside)) * 64


class Exporter:
    """Writes a painter as an ONNX graph whose activations are whole numbers."""

    def __init__(self, painter):
        self.painter, self.nodes, self.weights = painter, [], []

    def constant(self, name, values):
        self.weights.append(numpy_helper.from_array(np.asarray(values), name))
        return name

    def node(self, operator, inputs, name, **attributes):
        self.nodes.append(helper.make_node(operator, inputs, [name], name=name, **attributes))
        return name

    def layer(self, layer, x, name, image_channels=0, last=False):
        weight, bias = (t.detach().double().numpy().copy() for t in layer.exact())
        bias = np.round(bias / STEP)
        if image_channels:
            weight[..., -image_channels:, :, :] *= 4  # of pixels, of which each is four steps
        weight, bias = (self.constant(f"{name}.{what}", values.astype(np.float32)) for what, values in [("weight", weight), ("bias", bias)])
        if layer.own:
            weight, bias = (self.node("Gather", [values, "style"], f"{values}.chosen") for values in (weight, bias))
        y = self.node(
            "Conv", [x, weight, bias],
            name, kernel_shape=layer.weight.shape[-2:], strides=[layer.stride] * 2, pads=[layer.padding] * 4,
        )
        y = self.node("Round", [y], f"{name}.round")
        if layer.factor is not None:
            factor, offset = (t.detach().double().numpy() for t in layer.exact_style())
            factors = self.constant(f"{name}.factors", factor[:, None].astype(np.float32))
            offsets = self.constant(f"{name}.offsets", np.round(offset[:, None] / STEP).astype(np.float32))
            y = self.node("Mul", [y, self.node("Gather", [factors, "style"], f"{name}.factor")], f"{name}.scaled")
            y = self.node("Add", [y, self.node("Gather", [offsets, "style"], f"{name}.offset")], f"{name}.shifted")
            y = self.node("Round", [y], f"{name}.snapped")
        if last:
            y = self.node("Mul", [y, "quarter"], f"{name}.bytes")
            return self.node("Round", [y], f"{name}.whole")
        return y

    def rectified(self, x, name):
        return self.node("Clip", [x, "zero", "largest"], name)

    def doubled(self, x, name):
        return self.node("Resize", [x, "", "double"], name, mode="nearest", coordinate_transformation_mode="asymmetric", nearest_mode="floor")

    def model(self, height, width, styles=()):
        painter = self.painter
        for name, values in [("zero", np.float32(0)), ("largest", np.float32(1023)), ("white", np.float32(255)),
                             ("grey", np.float32(128)), ("quarter", np.float32(0.25)), ("double", np.float32([1, 1, 2, 2]))]:
            self.constant(name, values)
        if styles:
            self.constant("style", np.int64(0))
        x = self.node("Sub", ["image", "grey"], "centred")
        h, sizes = x, []
        for number, layer in enumerate(painter.down, 1):
            h = self.rectified(self.layer(layer, h, f"down_{number}", 3 if number == 1 else 0), f"down_{number}.out")
            sizes.append(h)
        for number, (inner, outer) in enumerate(painter.blocks, 1):
            inside = self.rectified(self.layer(inner, h, f"block_{number}.inner"), f"block_{number}.between")
            outside = self.layer(outer, inside, f"block_{number}.outer")
            h = self.rectified(self.node("Add", [h, outside], f"block_{number}.sum"), f"block_{number}.out")
        for number, (layer, before) in enumerate(zip(painter.up, sizes[-2::-1]), 1):
            h = self.layer(layer, self.doubled(h, f"up_{number}.doubled"), f"up_{number}")
            h = self.rectified(self.node("Add", [before, h], f"up_{number}.sum"), f"up_{number}.out")
        h = self.node("Concat", [self.doubled(h, "detail.doubled"), x], "detail.in", axis=1)
        h = self.rectified(self.layer(painter.detail, h, "detail", 3), "detail.out")
        h = self.layer(painter.paint, self.node("Concat", [h, x], "paint.in", axis=1), "paint", 3, last=True)
        self.node("Clip", [h, "zero", "white"], "painted")
        shape = [1, 3, height, width]
        graph = helper.make_graph(
            self.nodes, "painter",
            [helper.make_tensor_value_info("image", TensorProto.FLOAT, shape)],
            [helper.make_tensor_value_info("painted", TensorProto.FLOAT, shape)],
            self.weights,
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=8)
        if styles:
            helper.set_model_props(model, {"styles": ",".join(styles)})
        onnx.checker.check_model(model, full_check=True)
        return model


def export(painter, path, height, width, styles=()):
    """Writes the network, and checks with another program that the file paints what the network does, bit for bit."""
    from onnx.reference import ReferenceEvaluator

    painter.exact = True
    painter = painter.double()
    random = torch.Generator().manual_seed(1)
    image = torch.randint(0, 256, (1, 3, 32, 64), generator=random)
    for style in range(max(len(styles), 1)):
        small = Exporter(painter).model(32, 64, styles)
        for tensor in small.graph.initializer:
            if tensor.name == "style":
                tensor.CopyFrom(numpy_helper.from_array(np.array(style, np.int64), "style"))
        found = ReferenceEvaluator(small).run(None, {"image": image.numpy().astype(np.float32)})[0]
        with torch.no_grad():
            expected = painter(image.double(), torch.tensor([style]) if styles else None).numpy()
        if not np.array_equal(found, expected):
            raise SystemExit(f"{path}: the file paints other pictures than the network, by up to {np.abs(found - expected).max()}")
    onnx.save(Exporter(painter).model(height, width, styles), path)
    parameters = sum(p.numel() for p in painter.parameters())
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB, {parameters} parameters", flush=True)
