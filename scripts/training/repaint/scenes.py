"""Pictures to learn from: drives of the embedded simulator on the same roads in different weather, and how places move between frames."""

import io
import json
import math

import numpy as np
import torch
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from PIL import Image
from torch.nn import functional

WEATHER = ("day", "overcast", "night", "rain")
# The simulator's camera.
HEIGHT, WIDTH = 160, 320
FOCAL = WIDTH / 2 / math.tan(math.radians(75 / 2))
PITCH = math.radians(8)
AHEAD_OF_CENTRE = 0.5  # of the vehicle, in metres
# The fog that says how far away places are: 5 % of the light is left at this distance, in metres.
VISIBILITY = 100
FAR = 1e4  # in metres: the sky, and what the fog hides


def trace(path):
    """Frames as the camera saw them, frames as perturbations left them, and places and headings, by the number of the frame."""
    raw, perturbed, poses = {}, {}, {}
    decoder = DecoderFactory()
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages(topics=["/raw", "/perturbed", "/state"]):
            found = decoder.decoder_for(message_encoding=channel.message_encoding, schema=schema)(message.data)
            if channel.topic == "/state":
                poses[message.sequence] = (found.x, found.z, found.heading)
            else:
                image = np.asarray(Image.open(io.BytesIO(found.data)).convert("RGB"))
                (raw if channel.topic == "/raw" else perturbed)[message.sequence] = image
    return raw, perturbed, poses


def distances(fog):
    """Metres to each pixel along its ray, from a picture of white fog before black."""
    stored = fog.mean(2) / 255
    light = np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)
    metres = -np.log(np.clip(1 - light, 1e-6, 1)) * VISIBILITY / math.log(20)
    return np.where(stored > 253 / 255, FAR, np.maximum(metres, 1))


def motion(distance, before, after):
    """Where the pixels of a frame are in another: column, row, and distance along the ray, each as (height, width)."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    right, down, along = (x - WIDTH / 2) / FOCAL, (y - HEIGHT / 2) / FOCAL, np.ones_like(x)
    scale = distance / np.sqrt(right**2 + down**2 + 1)
    right, down, along = right * scale, down * scale, along * scale
    ahead = along * math.cos(PITCH) - down * math.sin(PITCH) + AHEAD_OF_CENTRE
    below = along * math.sin(PITCH) + down * math.cos(PITCH)
    # From one vehicle's axes to the world's, and to the other's.
    (x, z, heading), (later_x, later_z, later) = before, after
    east = x + ahead * math.sin(heading) + right * math.cos(heading) - later_x
    north = z + ahead * math.cos(heading) - right * math.sin(heading) - later_z
    ahead = east * math.sin(later) + north * math.cos(later) - AHEAD_OF_CENTRE
    right = east * math.cos(later) - north * math.sin(later)
    along = np.maximum(ahead * math.cos(PITCH) + below * math.sin(PITCH), 0.1)
    down = below * math.cos(PITCH) - ahead * math.sin(PITCH)
    return WIDTH / 2 + FOCAL * right / along, HEIGHT / 2 + FOCAL * down / along, np.sqrt(right**2 + down**2 + along**2)


def warped(images, places):
    """Pictures at places of them: (count, height, width, 2), from -1 to 1 across a picture."""
    return functional.grid_sample(images, places, mode="bilinear", padding_mode="border", align_corners=False)


class Drives:
    """Frames of the same places in all weather, as (count, 3, height, width) of bytes for each; and for each frame where its
    pixels are in the next one, and which of them are to be seen there."""

    def __init__(self, record):
        roads, images, self.places, self.seen, self.conditions = {}, {weather: [] for weather in WEATHER}, [], [], []
        for text in open(record / "scenarios.jsonl"):
            scenario = json.loads(text)
            conditions, road, weather = scenario["name"].split()
            roads.setdefault((conditions, road), {})[weather] = trace(record / "traces" / f"{scenario['id']}.mcap")
        for (conditions, _), drives in roads.items():
            frames, fog, poses = drives["day"]
            if any(drive[2] != poses for drive in drives.values()):
                raise SystemExit(f"{record}: the drives on a road of {conditions} conditions went different ways; record them anew")
            numbers = sorted(frames)
            for weather, (raw, perturbed, _) in drives.items():
                images[weather] += [(perturbed if weather == "rain" else raw)[number] for number in numbers]
            metres = [distances(fog[number]) for number in numbers]
            for at, number in enumerate(numbers):
                self.conditions.append(conditions)
                places, seen = np.zeros((HEIGHT, WIDTH, 2)), np.zeros((HEIGHT, WIDTH))
                if at + 1 < len(numbers):
                    places, seen = self.moved(metres[at], metres[at + 1], poses[number], poses[numbers[at + 1]])
                self.places.append(places.astype(np.float32))
                self.seen.append(seen.astype(np.float32))
        self.images = {weather: torch.from_numpy(np.stack(found)).permute(0, 3, 1, 2).contiguous() for weather, found in images.items()}
        self.places = torch.from_numpy(np.stack(self.places))
        self.seen = torch.from_numpy(np.stack(self.seen))[:, None]
        # The frames that have a next one.
        self.first = self.seen.flatten(1).amax(1).nonzero()[:, 0]

    def __len__(self):
        return len(self.places)

    @staticmethod
    def moved(metres, later, before, after):
        column, row, expected = motion(metres, before, after)
        places = np.stack([2 * column / WIDTH - 1, 2 * row / HEIGHT - 1], 2)
        at = torch.from_numpy(places)[None].float()
        found = warped(torch.from_numpy(later)[None, None].float(), at)[0, 0].numpy()
        # What something hides in the next frame is further away than what is seen in its place, and vehicles move on their own.
        same = (np.abs(found - expected) < 0.08 * expected + 0.3) | ((metres >= FAR) & (found >= FAR / 2))
        return places, same & (np.abs(places) < 1).all(2)
