#!/usr/bin/env python3
"""What the networks in this folder compute, by a program as one writes it beside a network: no code of pdk.

`pip install numpy onnxruntime opencv-python-headless pillow`, then

    python3 tests/networks/plain.py > tests/networks/expected.json
    python3 tests/networks/plain.py --frames DIR > expected.json

The first takes eight frames that are made of docs/road.png, the second the pictures of a folder in the order of the numbers in their names.
Prints steering and throttle of each network for each frame, as one sequence, at a speed that is not known.
"""

import json
import re
import sys
from collections import deque
from pathlib import Path

import cv2
import numpy as np
import onnxruntime
from PIL import Image

FOLDER = Path(__file__).parent
FRAMES = 8


def road_frames():
    """The road, moved to the side and darker with each frame."""
    road = np.array(Image.open(FOLDER / "../../docs/road.png").convert("RGB"))
    for i in range(FRAMES):
        moved = np.roll(road, 23 * i, axis=1)
        yield (moved.astype(np.uint32) * (16 - i) // 16).astype(np.uint8)


def pictures(folder):
    files = sorted(Path(folder).iterdir(), key=lambda file: int(re.match(r"\d+", file.name).group()))
    for file in files:
        yield np.array(Image.open(file).convert("RGB"))


class Network:
    def __init__(self, name):
        self.session = onnxruntime.InferenceSession(str(FOLDER / f"{name}.onnx"), providers=["CPUExecutionProvider"])

    def run(self, **inputs):
        names = [output.name for output in self.session.get_outputs()]
        return {name: value[0] for name, value in zip(names, self.session.run(None, inputs))}


def planes(image):
    return np.ascontiguousarray(image.transpose(2, 0, 1))[None]


class MeanCrop(Network):
    def drive(self, frame):
        height = frame.shape[0]
        image = cv2.resize(np.ascontiguousarray(frame[int(height * 0.375 + 0.5):]), (96, 48), interpolation=cv2.INTER_AREA)
        image = image[:, :, ::-1].astype(np.float32) / 255
        image = (image - np.float32([0.485, 0.456, 0.406])) / np.float32([0.229, 0.224, 0.225])
        throttle, steering = self.run(image=planes(image))["control"]
        return float(np.clip(-1.5 * steering + 0.1, -0.8, 0.8)), float(throttle)


class Yuv(Network):
    def drive(self, frame):
        height = frame.shape[0]
        part = np.ascontiguousarray(frame[int(height * 0.4 + 0.5):int(height * 0.9 + 0.5)])
        image = cv2.cvtColor(cv2.resize(part, (200, 66), interpolation=cv2.INTER_LINEAR), cv2.COLOR_RGB2YUV)
        return float(self.run(input_1=(image / 127.5 - 1).astype(np.float32)[None])["angle"][0]), 0.2


class Categorical(Network):
    @staticmethod
    def linear_unbin(array, n, offset, r):
        return float(np.argmax(array) * (r / (n + offset)) + offset)

    def drive(self, frame):
        image = np.array(Image.fromarray(frame).resize((80, 60), Image.BICUBIC))
        outputs = self.run(img_in=(image / 255).astype(np.float32)[None])
        steering = self.linear_unbin(outputs["angle_out"], 15, -1, 2.0)
        return steering, self.linear_unbin(outputs["throttle_out"], 20, 0.0, 0.8)


class Stack(Network):
    def __init__(self, name):
        super().__init__(name)
        self.seen = deque(maxlen=5)

    def drive(self, frame):
        image = planes(np.array(Image.fromarray(frame).resize((64, 32), Image.BILINEAR)).astype(np.float32) / 255)
        self.seen.append(image)
        while len(self.seen) < 5:
            self.seen.appendleft(self.seen[0])
        frames = np.concatenate([self.seen[0], self.seen[2], self.seen[4]], axis=1)
        return float(self.run(frames=frames)["steering"][0]), 0.3


class Recurrent(Network):
    def __init__(self, name):
        super().__init__(name)
        self.hidden = np.zeros((1, 4), np.float32)

    def drive(self, frame):
        image = np.array(Image.fromarray(frame).resize((60, 40), Image.NEAREST))
        grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32) / 127.5 - 1
        outputs = self.run(image=grey[None, None], hidden=self.hidden)
        self.hidden = outputs["hidden_next"][None]
        return float(outputs["steering"][0]), float(outputs["throttle"][0])


class Speed(Network):
    def drive(self, frame):
        image = cv2.cvtColor(cv2.resize(frame, (60, 40), interpolation=cv2.INTER_LINEAR), cv2.COLOR_RGB2HSV)
        v = np.float32([[8.0 * 3.6 * 0.02 - 0.5]])
        command = np.float32([[0, 1, 0]])
        control = self.run(image=planes(image.astype(np.float32) * np.float32(0.01)), v=v, command=command)["control"]
        return tuple(map(float, control))


class Memory(Network):
    def __init__(self, name):
        super().__init__(name)
        self.memory = deque([[0.0, 0.0]] * 3)

    def drive(self, frame):
        image = cv2.resize(frame, (80, 60), interpolation=cv2.INTER_LINEAR)
        memory = np.array(self.memory).reshape((1, 6)).astype(np.float32)
        outputs = self.run(img_in=(image / 255).astype(np.float32)[None], mem_in=memory)
        control = [float(outputs["n_outputs0"][0]), float(outputs["n_outputs1"][0])]
        self.memory.popleft()
        self.memory.append(control)
        return tuple(control)


class Time(Network):
    def __init__(self, name):
        super().__init__(name)
        self.seen = deque()

    def drive(self, frame):
        image = cv2.resize(frame, (64, 32), interpolation=cv2.INTER_AREA) / 255
        while len(self.seen) < 3:
            self.seen.append(image)
        self.seen.popleft()
        self.seen.append(image)
        return tuple(map(float, self.run(img_in=np.array(self.seen).astype(np.float32)[None])["model_outputs"]))


class Differences(Network):
    def __init__(self, name):
        super().__init__(name)
        self.seen = deque([np.zeros((32, 64), np.float32)] * 5, maxlen=5)

    def drive(self, frame):
        image = cv2.cvtColor(cv2.resize(frame, (64, 32), interpolation=cv2.INTER_LINEAR), cv2.COLOR_RGB2GRAY)
        self.seen.append(image.astype(np.float32) / 255)
        newest, middle, oldest = self.seen[4], self.seen[2], self.seen[0]
        return float(self.run(image=np.stack([newest, newest - middle, middle - oldest])[None])["steering"][0]), 0.3


class Half(Network):
    def drive(self, frame):
        image = cv2.resize(frame, (64, 32), interpolation=cv2.INTER_LINEAR).astype(np.float32) / 255
        return tuple(map(float, self.run(image=planes(image).astype(np.float16))["control"]))


class Bytes(Network):
    def drive(self, frame):
        image = cv2.resize(frame, (64, 32), interpolation=cv2.INTER_LINEAR)
        return tuple(map(float, self.run(image=image[None])["control"]))


NETWORKS = {
    "mean_crop": MeanCrop,
    "yuv": Yuv,
    "categorical": Categorical,
    "stack": Stack,
    "recurrent": Recurrent,
    "speed": Speed,
    "memory": Memory,
    "time": Time,
    "differences": Differences,
    "half": Half,
    "bytes": Bytes,
}

if __name__ == "__main__":
    frames = list(pictures(sys.argv[2]) if sys.argv[1:2] == ["--frames"] else road_frames())
    lines = []
    for name, network in NETWORKS.items():
        driver = network(name)
        lines.append(f'"{name}": {json.dumps([driver.drive(frame) for frame in frames])}')
    print("{\n" + ",\n".join(lines) + "\n}")
