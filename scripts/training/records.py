"""Reads what networks learn from: images and what would have been right at each, of records of the embedded simulator and of a DonkeyCar."""

import io
import json
import math
import multiprocessing

import numpy as np
import torch
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from PIL import Image
from torch.nn import functional

from networks import HEIGHT, STEP, TIMES, WIDTH

WHEELBASE = 2.6  # metres
LARGEST_STEERING_ANGLE = math.radians(25)
LATERAL_ACCELERATION = 2.5  # metres per second squared, in bends
DECELERATION = 2.0  # metres per second squared, before bends
# By conditions: speed on straight road in metres per second, and seconds until a control has its effect.
CRUISE = {"easy": 8.0, "standard": 16.0, "hard": 16.0}
DELAY = {"easy": 0.0, "standard": 0.1, "hard": 0.2}
STANDSTILL_GAP, TIME_GAP = 4.0, 1.4  # metres, seconds
GAIN = 0.5  # throttle for each m/s that is lacking


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
    """What would be right in a state: steering and throttle; and the waypoints of a plan, metres to the right and ahead for each of `TIMES`."""
    heading, speed = state.heading, state.speed
    # Where it is when the control has its effect.
    x, z = (state.x + math.sin(heading) * speed * DELAY[conditions], state.z + math.cos(heading) * speed * DELAY[conditions])
    nearest = int(np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - z)))

    def seen(metres):
        """A point so far along the middle of the lane, to the right and ahead of there."""
        place = min(nearest + 2 * metres, len(points) - 1.001)
        whole = int(place)
        dx, dz = points[whole] + (place - whole) * (points[whole + 1] - points[whole]) - (x, z)
        return dx * math.cos(heading) - dz * math.sin(heading), dx * math.sin(heading) + dz * math.cos(heading)

    reach = min(max(3 + 0.5 * speed, 5), 14)
    right, ahead = seen(round(2 * reach) / 2)
    ahead += WHEELBASE / 2
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
    throttle = GAIN * (wanted - speed) + 0.05

    # The speed comes nearer to the wanted one with a time constant of a second.
    travelled = [wanted * t + (speed - wanted) * (1 - math.exp(-t)) for t in TIMES]
    plan = [number for metres in travelled for number in seen(metres)]
    return [max(-1, min(1, steering)), max(-1, min(1, throttle)), *plan]


def small(image):
    """An image in the size that networks see: one pixel between four, as the driver resizes its frames."""
    whole = torch.from_numpy(np.asarray(image).copy()).permute(2, 0, 1)[None].float()
    return functional.interpolate(whole, (HEIGHT, WIDTH), mode="bilinear", align_corners=False)[0].round().to(torch.uint8)


def drive(job):
    """Images, speeds and labels of one drive."""
    folder, topic, scenario = job
    torch.set_num_threads(1)
    conditions = scenario["scenario"]["simulator"]["parameters"]["conditions"]
    states, frames, points = {}, {}, None
    with open(folder / "traces" / f"{scenario['id']}.mcap", "rb") as file:
        decoder = DecoderFactory()
        for schema, channel, message in make_reader(file).iter_messages(topics=["/state", topic, "/road"]):
            decode = decoder.decoder_for(message_encoding=channel.message_encoding, schema=schema)
            if channel.topic == "/road":
                points = line(decode(message.data).waypoints)
            else:
                found = states if channel.topic == "/state" else frames
                found[message.sequence] = (decode, message.data)
    # The last frame is kept as well, wherever it comes.
    frames = {sequence: frame for sequence, frame in frames.items() if sequence % STEP == 0}
    if len(frames) != max(states) // STEP + 1:
        raise ValueError(f"{folder} does not hold an image every {STEP} frames: record it with images_every={STEP}")
    curvature = bends(points)
    images, speeds, wanted = [], [], []
    for sequence in sorted(frames):
        state, frame = (decode(data) for decode, data in (states[sequence], frames[sequence]))
        images.append(small(Image.open(io.BytesIO(frame.data))).numpy())
        speeds.append([state.speed])
        wanted.append(labels(points, curvature, state, conditions))
    return np.stack(images), np.array(speeds, np.float32), np.array(wanted, np.float32)


def samples(folder, topic="/raw"):
    """Images, speeds, labels, and the number of its drive for each, of a record. `topic` is `/perturbed` for images as a driver gets them."""
    jobs = [(folder, topic, json.loads(text)) for text in open(folder / "scenarios.jsonl")]
    with multiprocessing.Pool() as pool:
        parts = pool.map(drive, jobs, chunksize=4)
    numbers = np.concatenate([np.full(len(part[0]), number) for number, part in enumerate(parts)])
    return [*(torch.from_numpy(np.concatenate(those)) for those in zip(*parts)), torch.from_numpy(numbers)]


def tub(folder):
    """Images and controls of a recording of a DonkeyCar, in the format of tub 2, without the records that its user deleted."""
    images, controls = [], []
    deleted = set()
    for part in map(json.loads, open(folder / "manifest.json")):
        if "paths" in part:
            deleted.update(part.get("deleted_indexes", []))
    for catalog in sorted(folder.glob("catalog_*.catalog"), key=lambda path: int(path.stem.split("_")[1])):
        for entry in map(json.loads, open(catalog)):
            if entry.get("_index") in deleted:
                continue
            images.append(small(Image.open(folder / "images" / entry["cam/image_array"]).convert("RGB")))
            controls.append([entry["user/angle"], entry["user/throttle"]])
    if not images:
        raise SystemExit(f"{folder} is not a tub: it holds no catalog_*.catalog with images that are not deleted")
    return torch.stack(images), torch.tensor(controls)
