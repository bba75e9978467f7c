"""Projected gradient descent in plain PyTorch, written from the paper, against what `pdk corrupt` made of the same frames with `pgd`.
The shifts of the steering of both are measured by this program.

MODEL.onnx FRAMES EPSILON linf|l2 away|left|right PERTURBED...; each folder PERTURBED is what `pdk corrupt` made with another seed, and the attack of this
program is repeated for each. Frames are PNG files, since decoders of JPEG differ. It needs pip install torch numpy onnx pillow.
"""
import pathlib
import sys

import numpy as np
import onnx
import torch
import torch.nn.functional as F
from onnx import numpy_helper
from PIL import Image

MODEL, FRAMES, EPSILON, NORM, GOAL, *PERTURBED = sys.argv[1:]
EPSILON = float(EPSILON)
STEPS, STEP, SPEED = 10, 0.25, 8.0
SIDES = {"left": [-1], "right": [1], "away": [1, -1]}[GOAL]

torch.manual_seed(1)
model = onnx.load(MODEL)
weights = {w.name: torch.tensor(numpy_helper.to_array(w)) for w in model.graph.initializer}
HEIGHT, WIDTH = [size.dim_value for size in model.graph.input[0].type.tensor_type.shape.dim][2:]


def network(image):
    """The steering for an image of the network's size."""
    values = dict(weights, image=image, speed=torch.tensor([[SPEED]]))
    for node in model.graph.node:
        of = {a.name: onnx.helper.get_attribute_value(a) for a in node.attribute}
        x = [values[name] for name in node.input]
        values[node.output[0]] = {
            "Constant": lambda: torch.tensor(numpy_helper.to_array(of["value"])),
            "Div": lambda: x[0] / x[1],
            "Sub": lambda: x[0] - x[1],
            "Conv": lambda: F.conv2d(x[0], x[1], x[2], of["strides"]),
            "Relu": lambda: F.relu(x[0]),
            "Flatten": lambda: x[0].flatten(1),
            "Concat": lambda: torch.cat(x, of["axis"]),
            "Gemm": lambda: F.linear(x[0], x[1] if of.get("transB") else x[1].T, x[2]),
            "Tanh": lambda: torch.tanh(x[0]),
        }[node.op_type]()
    return values["control"][0, 0]


def steering(frame):
    """The steering for a frame of any size: height x width x RGB from 0 to 255."""
    size = (HEIGHT, WIDTH)
    image = F.interpolate(frame.permute(2, 0, 1)[None], size, mode="bilinear", align_corners=False)
    return network(image)


def project(delta, frame, radius):
    delta = delta.clamp(-radius, radius) if NORM == "linf" else delta
    delta = (frame + delta).clamp(0, 255) - frame
    return delta * min(1.0, radius / delta.norm().item()) if NORM == "l2" else delta


def attack(frame):
    """The frame that moves the steering most, in whole grey levels."""
    radius = EPSILON if NORM == "linf" else EPSILON * frame.numel() ** 0.5
    before = steering(frame).item()
    best = (0.0, frame)
    for side in SIDES:
        delta = torch.rand_like(frame) * 2 - 1
        delta *= radius if NORM == "linf" else torch.rand(()).item() * radius / delta.norm()
        delta = (frame + delta).clamp(0, 255) - frame
        for _ in range(STEPS):
            moved = (frame + delta).requires_grad_()
            (slope,) = torch.autograd.grad(steering(moved) * side, moved)
            delta = delta + STEP * radius * (slope.sign() if NORM == "linf" else slope / slope.norm())
            delta = project(delta, frame, radius)
        moved = (frame + delta).round().clamp(0, 255)
        shift = steering(moved).item() - before
        score = abs(shift) if GOAL == "away" else side * shift
        if score > best[0]:
            best = (score, moved)
    return best[1]


def read(path):
    return torch.tensor(np.asarray(Image.open(path).convert("RGB"), np.float32))


if not PERTURBED or not any(pathlib.Path(FRAMES).glob("*.png")):
    sys.exit(f"no PNG files in {FRAMES}, or no folders with perturbed ones: convert frames first, such as by ffmpeg -i %04d.jpg %04d.png")
names = sorted(path.name for path in pathlib.Path(FRAMES).glob("*.png"))
shifts, changes = [], []
for folder in PERTURBED:
    for name in names:
        frame, theirs = read(pathlib.Path(FRAMES) / name), read(pathlib.Path(folder) / name)
        own = attack(frame)
        before, *after = [steering(x).item() for x in (frame, theirs, own)]
        shifts.append([abs(x - before) for x in after])
        changes.append([(theirs - frame).abs().max().item()] + [((x - frame) ** 2).mean().sqrt().item() for x in (theirs, own)])
shifts, changes = np.array(shifts), np.array(changes)
print(f"{len(names)} frames, {len(PERTURBED)} times, epsilon {EPSILON:g} {NORM} {GOAL}")
for name, shift in zip(("pdk", "torch"), shifts.T):
    shares = ", ".join(f"by more than {limit}: {np.mean(shift > limit):.1%}" for limit in (0.1, 0.3))
    print(f"  {name:5}  mean shift {shift.mean():.4f}, {shares}")
difference = shifts[:, 0] - shifts[:, 1]
ratio, error = shifts[:, 0].mean() / shifts[:, 1].mean(), difference.std(ddof=1) / len(difference) ** 0.5 / shifts[:, 1].mean()
print(f"  pdk / torch {ratio:.4f}, standard error {error:.4f}; largest change {changes[:, 0].max():.0f}, root mean square at most {changes[:, 1].max():.3f} and {changes[:, 2].max():.3f}")
