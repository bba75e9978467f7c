"""A driver with a model, in the style of PyTorch: `python3 model.py WEIGHTS`, or with random weights if there are none.

With torch, `Pilot` would be a `torch.nn.Module`, and the frame would come to it as `torch.from_numpy(frame.copy())`.
"""

import sys

import numpy

import pdk_driver


class Pilot:
    """A linear model on a picture of 16 x 8 brightnesses, with the speed beside them."""

    def __init__(self, weights=None):
        random = numpy.random.default_rng(1)
        self.weights = random.normal(0, 0.01, (2, 16 * 8 + 1)) if weights is None else numpy.load(weights)

    def forward(self, picture, speed):
        return numpy.tanh(self.weights @ numpy.append(picture.ravel() / 255.0, speed / 20.0))


class Driver:
    def __init__(self, pilot):
        self.pilot = pilot
        self.scenario = None

    def __call__(self, frame, context):
        if context.scenario != self.scenario:
            # What a model with a memory has to forget.
            self.scenario = context.scenario
        height, width, _ = frame.shape
        rows, columns = (numpy.arange(8) * height // 8, numpy.arange(16) * width // 16)
        speed = 0.0 if numpy.isnan(context.speed) else context.speed
        steering, throttle = self.pilot.forward(frame[rows][:, columns].mean(axis=2), speed)
        return steering, throttle


if __name__ == "__main__":
    pdk_driver.serve(Driver(Pilot(*sys.argv[1:])))
