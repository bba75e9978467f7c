"""Trains the shipped DAVE-2 networks on records of the embedded simulator.

    pip install -r scripts/training/requirements.txt
    pdk run collect --out training-data
    python scripts/training/train.py training-data scripts/models

The network is that of Bojarski et al., "End to End Learning for Self-Driving Cars" (2016): five convolutions and four
fully connected layers on an image of 66x200 pixels. Beside the image it takes the speed, which the first fully connected
layer sees too, and it gives steering and throttle.

What it learns is not what the vehicle did, which swung about its lane on purpose, but what would have been right at each
place: to steer by pure pursuit towards the middle of the lane, to slow down for bends, and to keep a time gap to the vehicle
ahead. Position, course and the vehicle ahead are in the record. On easy roads, which look like a drawing, it learns to drive
at 8 m/s; on the others at up to 16 m/s, and to allow for the time that controls take to have their effect.

Two networks come of it: `dave2.onnx`, trained on the recorded images alone, and `dave2_augmented.onnx`, trained on images
with random noise, blur, brightness and contrast as well.

The networks that come with pdk were made by this script from 15,426 images of easy conditions alone, with torch 2.15.0 on one
thread. On images that were held out, the mean error of the steering was 0.012 of full lock, that of the throttle 0.107 and 0.105.
Recording took two minutes and each network three to four on two cores. Another version of torch or another processor gives
networks that differ a little; every record names the network by its hash.
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


def samples(folder):
    """Images, speeds and controls of a record."""
    images, speeds, controls = [], [], []
    for drive in map(json.loads, open(folder / "scenarios.jsonl")):
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
        curvature = bends(points)
        for sequence in frames:
            state, frame = (decode(data) for decode, data in (states[sequence], frames[sequence]))
            # One pixel between four: as the driver resizes its frames.
            image = torch.from_numpy(np.asarray(Image.open(io.BytesIO(frame.data))).copy()).permute(2, 0, 1)[None].float()
            small = functional.interpolate(image, (HEIGHT, WIDTH), mode="bilinear", align_corners=False)
            images.append(small[0].round().to(torch.uint8))
            speeds.append([state.speed])
            controls.append(labels(points, curvature, state, conditions))
    return torch.stack(images), torch.tensor(speeds), torch.tensor(controls)


class Dave2(nn.Module):
    def __init__(self):
        super().__init__()
        self.convolutions = nn.Sequential(
            nn.Conv2d(3, 24, 5, 2), nn.ReLU(),
            nn.Conv2d(24, 36, 5, 2), nn.ReLU(),
            nn.Conv2d(36, 48, 5, 2), nn.ReLU(),
            nn.Conv2d(48, 64, 3), nn.ReLU(),
            nn.Conv2d(64, 64, 3), nn.ReLU(),
            nn.Flatten(),
        )
        self.connected = nn.Sequential(
            nn.Linear(64 * 18 + 1, 100), nn.ReLU(),
            nn.Linear(100, 50), nn.ReLU(),
            nn.Linear(50, 10), nn.ReLU(),
            nn.Linear(10, 2),
        )

    def forward(self, image, speed):
        """Image in 0..255 as (batch, 3, 66, 200), speed in m/s as (batch, 1); gives steering and throttle in -1..1."""
        features = self.convolutions(image / 127.5 - 1)
        return torch.tanh(self.connected(torch.cat([features, speed / 10], 1)))


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


def train(data, epochs, augment):
    images, speeds, controls = data
    torch.manual_seed(SEED)
    random = torch.Generator().manual_seed(SEED)
    network = Dave2().to(memory_format=torch.channels_last)
    held_out = torch.zeros(len(images), dtype=torch.bool)
    # Whole stretches, because neighbouring frames look alike.
    for start in range(0, len(images), 4000):
        held_out[start:start + 300] = True
    training = torch.nonzero(~held_out)[:, 0]
    batch, steps = 64, len(training) // 64
    if steps == 0:
        raise SystemExit(f"{len(images)} images are too few to train on: record more roads, or set images_every lower")
    optimiser = torch.optim.Adam(network.parameters(), 1e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 2e-3, epochs * steps)
    weights = torch.tensor([4.0, 1.0])  # an error in steering matters more

    def error(predicted, wanted):
        return (functional.smooth_l1_loss(predicted, wanted, beta=0.05, reduction="none") * weights).mean()

    for epoch in range(epochs):
        network.train()
        total = 0.0
        order = training[torch.randperm(len(training), generator=random)]
        for step in range(steps):
            chosen = order[step * batch:(step + 1) * batch]
            image, speed, control = images[chosen].float(), speeds[chosen], controls[chosen].clone()
            # A mirrored world drives on the other side: the network would not learn to keep right. So no mirroring.
            if augment:
                image = augmented(image, random)
            # Half the digits: several times faster on processors that can, and enough to learn by.
            with torch.autocast("cpu", torch.bfloat16):
                predicted = network(image.contiguous(memory_format=torch.channels_last), speed)
            loss = error(predicted.float(), control)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            total += loss.item()
        network.eval()
        with torch.no_grad():
            predicted = torch.cat([network(i.float(), s) for i, s in
                                   zip(images[held_out].split(256), speeds[held_out].split(256))])
            mean = (predicted - controls[held_out]).abs().mean(0)
        print(f"epoch {epoch + 1}: loss {total / steps:.5f}, held out: mean error of steering {mean[0]:.4f}, "
              f"of throttle {mean[1]:.4f}", flush=True)
    return network.to(memory_format=torch.contiguous_format)


def export(network, path):
    torch.onnx.export(
        network, (torch.zeros(1, 3, HEIGHT, WIDTH), torch.zeros(1, 1)), path,
        input_names=["image", "speed"], output_names=["control"], opset_version=17, dynamo=False,
    )
    print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


def main():
    parser = argparse.ArgumentParser(description="Trains driving networks on records of the embedded simulator.")
    parser.add_argument("record", type=pathlib.Path, nargs="+")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--epochs", type=int, default=8)
    parser.add_argument("--samples", type=pathlib.Path, help="keep what was read from the records here, and use it where it is there")
    parser.add_argument("--only", choices=["dave2", "dave2_augmented"])
    arguments = parser.parse_args()
    # One thread adds in the same order every time; and it is hardly slower than two, for images this small.
    torch.set_num_threads(1)
    if arguments.samples and arguments.samples.exists():
        data = torch.load(arguments.samples)
    else:
        parts = [samples(folder) for folder in arguments.record]
        data = [torch.cat(tensors) for tensors in zip(*parts)]
        if arguments.samples:
            torch.save(data, arguments.samples)
    print(f"{len(data[0])} images; steering {data[2][:, 0].std():.3f}, throttle {data[2][:, 1].std():.3f} (deviation)",
          flush=True)
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name, augment in [("dave2", False), ("dave2_augmented", True)]:
        if arguments.only in (None, name):
            export(train(data, arguments.epochs, augment), arguments.out / f"{name}.onnx")


if __name__ == "__main__":
    main()
