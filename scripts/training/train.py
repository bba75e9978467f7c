"""Trains the driving networks that come with pdk.

    pip install -r scripts/training/requirements.txt
    pdk run collect --out training-data
    python scripts/training/train.py training-data scripts/models --tub TUB

All are variants of the network of Bojarski et al., "End to End Learning for Self-Driving Cars" (2016): five convolutions and
four fully connected layers on an image of 66x200 pixels. Beside the image they take the speed, which the first fully connected
layer sees too, and they give steering and throttle.

What they learn is not what the vehicle did, which swung about its lane on purpose, but what would have been right at each
place: to steer by pure pursuit towards the middle of the lane, to slow down for bends, and to keep a time gap to the vehicle
ahead. Position, course and the vehicle ahead are in the record. On easy roads, which look like a drawing, they learn to drive
at 8 m/s; on the others at up to 16 m/s, and to allow for the time that controls take to have their effect.

`dave2`            sees the recorded images as they are.
`dave2_augmented`  sees them with random noise, blur, brightness and contrast.
`dave2_temporal`   sees them as they are, and remembers features of what it saw 0.3 and 0.6 seconds before.
`dave2_tub`        sees, beside them, real images: a recording of a DonkeyCar, with what its human driver did.

The networks that come with pdk were made by this script with torch 2.15.0 on one thread each; docs/drivers.md says what they saw
and how well they did. Another version of torch or another processor gives networks that differ a little; every record names the
network by its hash.
"""

import argparse
import io
import json
import math
import pathlib

import numpy as np
import torch
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from PIL import Image
from torch import nn
from torch.nn import functional

HEIGHT, WIDTH = 66, 200
WHEELBASE = 2.6  # metres
LARGEST_STEERING_ANGLE = math.radians(25)
LATERAL_ACCELERATION = 2.5  # metres per second squared, in bends
DECELERATION = 2.0  # metres per second squared, before bends
# By conditions: speed on straight road in metres per second, and seconds until a control has its effect.
CRUISE = {"easy": 8.0, "standard": 16.0, "hard": 16.0}
DELAY = {"easy": 0.0, "standard": 0.1, "hard": 0.2}
STANDSTILL_GAP, TIME_GAP = 4.0, 1.4  # metres, seconds
STEP = 6  # frames from one recorded image to the next, as in collect.lua: 0.3 s
WINDOW = 8  # successive images that a network with a memory learns from together
SEED = 1


def line(text):
    """Points of a waypoint string, half a metre apart, as x and z."""
    points = np.array([[float(v) for v in point.split(",")] for point in text.split("@")])[:, [0, 2]]
    # It goes on straight behind its end.
    last = points[-1] - points[-2]
    points = np.vstack([points, points[-1] + last / np.linalg.norm(last) * 120])
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.arange(0, along[-1], 0.5)
    return np.stack([np.interp(at, along, points[:, k]) for k in range(2)], axis=1)


def bends(points):
    """Curvature at each of these points in 1/m, over 8 m to either side."""
    reach = 16
    curvature = np.full(len(points), 1e-6)
    a, b, c = points[:-2 * reach], points[reach:-reach], points[2 * reach:]
    (u, v, w) = (b - a, c - b, c - a)
    sides = np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1) * np.linalg.norm(w, axis=1)
    curvature[reach:-reach] += 2 * np.abs(u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / sides
    return curvature


def labels(points, curvature, state, conditions):
    """Steering and throttle that would be right in a state."""
    heading, speed = state.heading, state.speed
    # Where it is when the control has its effect.
    x, z = (state.x + math.sin(heading) * speed * DELAY[conditions], state.z + math.cos(heading) * speed * DELAY[conditions])
    nearest = int(np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - z)))
    reach = min(max(3 + 0.5 * speed, 5), 14)
    target = points[min(nearest + round(2 * reach), len(points) - 1)]
    dx, dz = target - (x, z)
    right = dx * math.cos(heading) - dz * math.sin(heading)
    ahead = dx * math.sin(heading) + dz * math.cos(heading) + WHEELBASE / 2
    turn = 2 * right / (right * right + ahead * ahead)
    steering = math.atan(WHEELBASE * turn) / LARGEST_STEERING_ANGLE

    # As fast as the bends allow, and as there is room to brake before them.
    sight = 2 * round(15 + speed * speed / (2 * DECELERATION))
    bend = curvature[nearest:nearest + sight]
    distance = np.maximum(np.arange(len(bend)) * 0.5 - 15, 0)
    allowed = np.sqrt(LATERAL_ACCELERATION / bend + 2 * DECELERATION * distance)
    wanted = min(CRUISE[conditions], float(allowed.min()))
    if math.isfinite(state.vehicle_ahead):
        wanted = min(wanted, max((state.vehicle_ahead - STANDSTILL_GAP) / TIME_GAP, 0))
    throttle = 0.5 * (wanted - speed) + 0.05
    return max(-1, min(1, steering)), max(-1, min(1, throttle))


def small(image):
    """An image in the size that networks see: one pixel between four, as the driver resizes its frames."""
    whole = torch.from_numpy(np.asarray(image).copy()).permute(2, 0, 1)[None].float()
    return functional.interpolate(whole, (HEIGHT, WIDTH), mode="bilinear", align_corners=False)[0].round().to(torch.uint8)


def samples(folder):
    """Images, speeds, controls, and the number of its drive for each, of a record."""
    images, speeds, controls, drives = [], [], [], []
    for number, drive in enumerate(map(json.loads, open(folder / "scenarios.jsonl"))):
        conditions = drive["scenario"]["simulator"]["parameters"]["conditions"]
        states, frames, points = {}, {}, None
        with open(folder / "traces" / f"{drive['id']}.mcap", "rb") as file:
            decoder = DecoderFactory()
            for schema, channel, message in make_reader(file).iter_messages(topics=["/state", "/raw", "/road"]):
                decode = decoder.decoder_for(message_encoding=channel.message_encoding, schema=schema)
                if channel.topic == "/road":
                    points = line(decode(message.data).waypoints)
                else:
                    found = states if channel.topic == "/state" else frames
                    found[message.sequence] = (decode, message.data)
        if any(sequence % STEP for sequence in frames):
            raise SystemExit(f"{folder} holds images every few frames, but not every {STEP}: record it with images_every={STEP}")
        curvature = bends(points)
        for sequence in sorted(frames):
            state, frame = (decode(data) for decode, data in (states[sequence], frames[sequence]))
            images.append(small(Image.open(io.BytesIO(frame.data))))
            speeds.append([state.speed])
            controls.append(labels(points, curvature, state, conditions))
            drives.append(number)
    return torch.stack(images), torch.tensor(speeds), torch.tensor(controls), torch.tensor(drives)


def tub(folder):
    """Images and controls of a recording of a DonkeyCar, in the format of tub 2."""
    images, controls = [], []
    for catalog in sorted(folder.glob("catalog_*.catalog"), key=lambda path: int(path.stem.split("_")[1])):
        for entry in map(json.loads, open(catalog)):
            images.append(small(Image.open(folder / "images" / entry["cam/image_array"]).convert("RGB")))
            controls.append([entry["user/angle"], entry["user/throttle"]])
    if not images:
        raise SystemExit(f"{folder} is not a tub: it holds no catalog_*.catalog with images")
    return torch.stack(images), torch.tensor(controls)


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


class Dave2(nn.Module):
    """Image in 0..255 as (batch, 3, 66, 200) and speed in m/s as (batch, 1) to steering and throttle in -1..1."""

    inputs = {"image": (1, 3, HEIGHT, WIDTH), "speed": (1, 1)}
    outputs = ["control"]

    def __init__(self):
        super().__init__()
        self.convolutions, self.connected = convolutions(), connected(64 * 18)

    def forward(self, image, speed):
        return torch.tanh(self.connected(torch.cat([self.convolutions(image / 127.5 - 1), speed / 10], 1)))

    def in_windows(self, images, speeds):
        """The same for images of windows, one after the other."""
        return self(images, speeds)


class Dave2Temporal(nn.Module):
    """As `Dave2`, with the features of the last frames in and out: zeros where there was none yet."""

    FEATURES = 64
    inputs = {**Dave2.inputs, "features_in": (1, 2 * STEP, FEATURES)}
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


def augmented(images, random):
    """Images with random brightness, contrast, noise and blur."""
    count = len(images)

    def draw(low, high):
        return low + (high - low) * torch.rand(count, 1, 1, 1, generator=random)

    images = (images - 128) * draw(0.4, 1.5) + 128 + draw(-50, 50)
    sigma = draw(0, 1) ** 2 * 45
    images = images + sigma * torch.randn(images.shape, generator=random)
    chosen = torch.rand(count, generator=random) < 0.5
    for size in (3, 5):
        blurred = functional.avg_pool2d(images, size, 1, size // 2, count_include_pad=False)
        here = chosen & (torch.randint(0, 2, (count,), generator=random) == (size == 5))
        images = torch.where(here[:, None, None, None], blurred, images)
    return images.clamp(0, 255)


def windows(drives, chosen, random):
    """Places of successive samples of one drive each, WINDOW in a row; they begin at another one of its images every time."""
    rows = []
    for drive in torch.unique(drives[chosen]):
        places = torch.nonzero((drives == drive) & chosen)[:, 0]
        begin = int(torch.randint(0, WINDOW, (), generator=random))
        rows += [places[i:i + WINDOW] for i in range(begin, len(places) - WINDOW + 1, WINDOW)]
    return torch.stack(rows)


def train(network, data, epochs, augment=False, real=None):
    """Trains a network on samples, and on real images among them where they are given."""
    images, speeds, controls, drives = data
    random = torch.Generator().manual_seed(SEED)
    network.to(memory_format=torch.channels_last)
    # Whole drives, because neighbouring frames look alike.
    held_out = drives % 20 == 7
    batch = 64
    steps = int((~held_out).sum()) // batch
    if steps == 0:
        raise SystemExit(f"{len(images)} images are too few to train on: record more roads, or set images_every lower")
    optimiser = torch.optim.Adam(network.parameters(), 1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 2e-3, epochs * steps)
    weights = torch.tensor([4.0, 1.0])  # an error in steering matters more

    def error(predicted, wanted):
        return (functional.smooth_l1_loss(predicted, wanted, beta=0.05, reduction="none") * weights).mean()

    def batches():
        """Places of samples: single ones, or windows where the network has a memory."""
        if remembers:
            rows = windows(drives, ~held_out, random)
            return rows[torch.randperm(len(rows), generator=random)].flatten().split(batch)
        places = torch.nonzero(~held_out)[:, 0]
        return places[torch.randperm(len(places), generator=random)].split(batch)

    def with_real(image, speed, control):
        """A batch with eight real images of the first four fifths. No one recorded their speed: it may be any."""
        places = torch.randint(0, len(real[0]) * 4 // 5, (8,), generator=random)
        return (torch.cat([image, real[0][places].float()]),
                torch.cat([speed, torch.rand(8, 1, generator=random) * 16]),
                torch.cat([control, real[1][places]]))

    def errors(images, speeds, controls):
        """Mean errors of steering and throttle; the samples are windows where the network has a memory."""
        with torch.no_grad():
            predicted = [network.in_windows(i.float(), s) for i, s in zip(images.split(256), speeds.split(256))]
        return (torch.cat(predicted) - controls).abs().mean(0)

    remembers = isinstance(network, Dave2Temporal)
    test = windows(drives, held_out, random).flatten() if remembers else torch.nonzero(held_out)[:, 0]
    for epoch in range(epochs):
        network.train()
        total, count = 0.0, 0
        for chosen in batches():
            if count == steps:
                break
            image, speed, control = images[chosen].float(), speeds[chosen], controls[chosen].clone()
            # A mirrored world drives on the other side: the network would not learn to keep right. So no mirroring.
            if augment:
                image = augmented(image, random)
            if real:
                image, speed, control = with_real(image, speed, control)
            # Half the digits: several times faster on processors that can, and enough to learn by.
            with torch.autocast("cpu", torch.bfloat16):
                predicted = network.in_windows(image.contiguous(memory_format=torch.channels_last), speed)
            loss = error(predicted.float(), control)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            total += loss.item()
            count += 1
        network.eval()
        mean = errors(images[test], speeds[test], controls[test])
        print(f"epoch {epoch + 1}: loss {total / count:.5f}, held out: mean error of steering {mean[0]:.4f}, "
              f"of throttle {mean[1]:.4f}", flush=True)
    if real:
        last = len(real[0]) * 4 // 5
        mean = errors(real[0][last:], torch.full((len(real[0]) - last, 1), 8.0), real[1][last:])
        print(f"real images held out: mean error of steering {mean[0]:.4f}, of throttle {mean[1]:.4f}")
    return network.to(memory_format=torch.contiguous_format)


def export(network, path):
    torch.onnx.export(
        network, tuple(torch.zeros(shape) for shape in network.inputs.values()), path,
        input_names=list(network.inputs), output_names=network.outputs, opset_version=17, dynamo=False,
    )
    print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


NETWORKS = ["dave2", "dave2_augmented", "dave2_temporal", "dave2_tub"]


def main():
    parser = argparse.ArgumentParser(description="Trains driving networks on records of the embedded simulator.")
    parser.add_argument("record", type=pathlib.Path, nargs="+")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--epochs", type=int, default=8)
    parser.add_argument("--samples", type=pathlib.Path, help="keep what was read from the records here, and use it where it is there")
    parser.add_argument("--tub", type=pathlib.Path, help="a recording of a DonkeyCar, for dave2_tub")
    parser.add_argument("--only", choices=NETWORKS)
    arguments = parser.parse_args()
    if arguments.only == "dave2_tub" and not arguments.tub:
        raise SystemExit("dave2_tub learns from real images: give a recording with --tub")
    # One thread adds in the same order every time; and it is hardly slower than two, for images this small.
    torch.set_num_threads(1)
    if arguments.samples and arguments.samples.exists():
        data = torch.load(arguments.samples)
    else:
        parts = [samples(folder) for folder in arguments.record]
        # Each record counts its drives from 0.
        for before, part in zip(parts, parts[1:]):
            part[3].add_(before[3].max() + 1)
        data = [torch.cat(tensors) for tensors in zip(*parts)]
        if arguments.samples:
            torch.save(data, arguments.samples)
    print(f"{len(data[0])} images; steering {data[2][:, 0].std():.3f}, throttle {data[2][:, 1].std():.3f} (deviation)",
          flush=True)
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name in NETWORKS:
        if arguments.only not in (None, name):
            continue
        if name == "dave2_tub" and not arguments.tub:
            print("dave2_tub is left out, because it learns from real images: give a recording with --tub")
            continue
        torch.manual_seed(SEED)
        network = Dave2Temporal() if name == "dave2_temporal" else Dave2()
        real = tub(arguments.tub) if name == "dave2_tub" else None
        export(train(network, data, arguments.epochs, name == "dave2_augmented", real), arguments.out / f"{name}.onnx")


if __name__ == "__main__":
    main()
