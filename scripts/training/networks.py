"""The driving networks that come with pdk, as torch modules.

All take an image in 0..255 as (batch, 3, 66, 200) and the speed in m/s as (batch, 1). `inputs` and `outputs` are what their ONNX files have.
"""

import torch
from torch import nn
from torch.nn import functional

HEIGHT, WIDTH = 66, 200
STEP = 6  # frames from one recorded image to the next, as in collect.lua: 0.3 s
WINDOW = 8  # successive images that a network with a memory learns from together
# The times of a plan's waypoints in seconds from when the control has its effect.
TIMES = [0.25 * (k + 1) for k in range(8)]


def convolutions():
    return nn.Sequential(
        nn.Conv2d(3, 24, 5, 2), nn.ReLU(),
        nn.Conv2d(24, 36, 5, 2), nn.ReLU(),
        nn.Conv2d(36, 48, 5, 2), nn.ReLU(),
        nn.Conv2d(48, 64, 3), nn.ReLU(),
        nn.Conv2d(64, 64, 3), nn.ReLU(),
        nn.Flatten(),
    )


def connected(features):
    return nn.Sequential(
        nn.Linear(features + 1, 100), nn.ReLU(),
        nn.Linear(100, 50), nn.ReLU(),
        nn.Linear(50, 10), nn.ReLU(),
        nn.Linear(10, 2),
    )


class Network(nn.Module):
    """What the networks have in common."""

    inputs = {"image": (1, 3, HEIGHT, WIDTH), "speed": (1, 1)}
    outputs = ["control"]
    # What an error in each number of the output costs.
    costs = [4.0, 1.0]
    # The error below which costs grow with its square.
    beta = 0.05

    def in_windows(self, images, speeds):
        """The output for images of windows, one after the other."""
        return self(images, speeds)


class Dave2(Network):
    """Bojarski et al., "End to End Learning for Self-Driving Cars" (2016), with the speed beside the image: steering and throttle in -1..1."""

    def __init__(self):
        super().__init__()
        self.convolutions, self.connected = convolutions(), connected(64 * 18)

    def forward(self, image, speed):
        return torch.tanh(self.connected(torch.cat([self.convolutions(image / 127.5 - 1), speed / 10], 1)))


class Dave2Temporal(Network):
    """As `Dave2`, with the features of the last frames in and out: zeros where there was none yet."""

    FEATURES = 64
    inputs = {**Network.inputs, "features_in": (1, 2 * STEP, FEATURES)}
    outputs = ["control", "features_out"]

    def __init__(self):
        super().__init__()
        self.convolutions, self.connected = convolutions(), connected(3 * self.FEATURES)
        self.features = nn.Linear(64 * 18, self.FEATURES)

    def seen(self, images):
        return self.features(self.convolutions(images / 127.5 - 1))

    def decide(self, now, before, long_before, speed):
        return torch.tanh(self.connected(torch.cat([now, before, long_before, speed / 10], 1)))

    def forward(self, image, speed, features_in):
        now = self.seen(image)
        control = self.decide(now, features_in[:, STEP], features_in[:, 0], speed)
        return control, torch.cat([features_in[:, 1:], now[:, None]], 1)

    def in_windows(self, images, speeds):
        now = self.seen(images).reshape(-1, WINDOW, self.FEATURES)
        none = torch.zeros_like(now)
        before = torch.cat([none[:, :1], now[:, :-1]], 1)
        long_before = torch.cat([none[:, :2], now[:, :-2]], 1)
        return self.decide(*(features.flatten(0, 1) for features in (now, before, long_before)), speeds)


class Block(nn.Module):
    """Attention among all tokens, then a layer for each, both beside the way past them (Vaswani et al., "Attention Is All You Need", 2017)."""

    def __init__(self, width, heads):
        super().__init__()
        self.heads = heads
        self.before_attention, self.before_layer = nn.LayerNorm(width), nn.LayerNorm(width)
        self.queries_keys_values, self.joined = nn.Linear(width, 3 * width), nn.Linear(width, width)
        self.layer = nn.Sequential(nn.Linear(width, 4 * width), nn.GELU(), nn.Linear(4 * width, width))

    def forward(self, x):
        batch, tokens, width = x.shape
        split = self.queries_keys_values(self.before_attention(x)).reshape(batch, tokens, 3, self.heads, width // self.heads)
        queries, keys, values = split.permute(2, 0, 3, 1, 4).unbind(0)
        scores = torch.softmax(queries @ keys.transpose(2, 3) * (width // self.heads) ** -0.5, 3)
        x = x + self.joined((scores @ values).transpose(1, 2).reshape(batch, tokens, width))
        return x + self.layer(self.before_layer(x))


class Transformer(Network):
    """A small vision transformer: 60 patches of 11x20 pixels, the speed and the control as tokens, four blocks (Dosovitskiy et al., "An Image
    is Worth 16x16 Words", 2021). Steering and throttle in -1..1."""

    PATCH = (11, 20)

    def __init__(self, width=64, blocks=4, heads=4):
        super().__init__()
        self.patches = nn.Conv2d(3, width, self.PATCH, self.PATCH)
        self.places = nn.Parameter(0.02 * torch.randn(1, HEIGHT // self.PATCH[0] * (WIDTH // self.PATCH[1]), width))
        self.speed = nn.Linear(1, width)
        self.control = nn.Parameter(0.02 * torch.randn(1, 1, width))
        self.blocks = nn.Sequential(*(Block(width, heads) for _ in range(blocks)))
        self.decided = nn.Sequential(nn.LayerNorm(width), nn.Linear(width, 2))

    def forward(self, image, speed):
        patches = self.patches(image / 127.5 - 1).flatten(2).transpose(1, 2) + self.places
        speed = self.speed(speed / 10)[:, None]
        tokens = torch.cat([self.control + 0 * speed, speed, patches], 1)
        return torch.tanh(self.decided(self.blocks(tokens)[:, 0]))


class Residual(nn.Module):
    """Two convolutions beside the way past them (He et al., "Deep Residual Learning for Image Recognition", 2016)."""

    def __init__(self, channels_in, channels_out, stride):
        super().__init__()
        self.two = nn.Sequential(
            nn.Conv2d(channels_in, channels_out, 3, stride, 1, bias=False), nn.BatchNorm2d(channels_out), nn.ReLU(),
            nn.Conv2d(channels_out, channels_out, 3, 1, 1, bias=False), nn.BatchNorm2d(channels_out),
        )
        self.past = nn.Sequential(nn.Conv2d(channels_in, channels_out, 1, stride, bias=False), nn.BatchNorm2d(channels_out))

    def forward(self, x):
        return functional.relu(self.two(x) + self.past(x))


class WaypointPlanner(Network):
    """A residual network that plans: eight waypoints, metres to the right and ahead of where the vehicle is when its control has its effect, at
    `TIMES` after that. A controller follows them."""

    outputs = ["waypoints"]
    # Near waypoints are nearer to each other, and steering follows them; metres to the right matter more than those ahead.
    costs = [4.0, 1.0] * len(TIMES)
    beta = 0.1

    def __init__(self):
        super().__init__()
        self.seen = nn.Sequential(
            nn.Conv2d(3, 16, 5, 2, 2, bias=False), nn.BatchNorm2d(16), nn.ReLU(),
            Residual(16, 24, 2), Residual(24, 32, 2), Residual(32, 32, 2),
            nn.Flatten(),
        )
        self.planned = nn.Sequential(nn.Linear(32 * 5 * 13 + 1, 64), nn.ReLU(), nn.Linear(64, 2 * len(TIMES)))

    def forward(self, image, speed):
        steps = self.planned(torch.cat([self.seen(image / 127.5 - 1), speed / 10], 1)).reshape(-1, len(TIMES), 2)
        # Each waypoint from the one before, where constant speed straight ahead would lead.
        straight = torch.cat([torch.zeros_like(speed), speed * TIMES[0]], 1)[:, None]
        return torch.cumsum(steps + straight, 1)

    def in_windows(self, images, speeds):
        return self(images, speeds).flatten(1)
