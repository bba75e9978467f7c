"""Makes the videos of docs/examples: a drive, and a green-screen clip of leaves that the wind blows past. It needs the program ffmpeg with
libx264.

    pip install -r scripts/training/examples/requirements.txt
    pdk run scripts/training/examples/record.lua --out training-examples
    python scripts/training/examples/clip.py training-examples docs/examples
"""

import io
import math
import pathlib
import subprocess
import sys

import numpy as np
from PIL import Image, ImageDraw

from pilot import drives

WIDTH, HEIGHT, RATE, FRAMES = 256, 192, 15, 30
DRIVE_RATE = 12  # the recorded frames are 5 a second, so the drive runs a little faster than it was
SCREEN = (0, 200, 40)
FINER = 4  # times as large as the clip, so that edges are soft
LEAVES = 9


def leaf(size, turn, roll):
    """Corners of a leaf that turns in its plane and rolls about its rib."""
    half = [(t, math.sin(math.pi * t) ** 0.8 * 0.32 * roll) for t in np.linspace(0, 1, 14)]
    outline = half + [(t, -w) for t, w in reversed(half)]
    c, s = math.cos(turn), math.sin(turn)
    return [(size * (c * (t - 0.5) - s * w), size * (s * (t - 0.5) + c * w)) for t, w in outline]


def write(path, images, rate):
    """Writes images as a video: H.264 in MP4."""
    width, height = images[0].size
    encoder = subprocess.Popen(
        ["ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", str(rate), "-i", "-",
         "-c:v", "libx264", "-profile:v", "main", "-bf", "0", "-pix_fmt", "yuv420p", "-crf", "24", "-preset", "veryslow", "-threads", "1", str(path)],
        stdin=subprocess.PIPE,
    )
    for image in images:
        encoder.stdin.write(image.convert("RGB").tobytes())
    encoder.stdin.close()
    if encoder.wait() != 0:
        raise SystemExit(f"ffmpeg did not write {path}")


def leaves():
    """Leaves before the screen."""
    random = np.random.default_rng(3)
    wind = [
        {
            "x": random.uniform(0, WIDTH), "y": random.uniform(20, HEIGHT - 20), "size": random.uniform(18, 46), "turn": random.uniform(0, 6),
            "spin": random.choice([-2, -1, 1, 2]), "roll": random.uniform(0, 6), "laps": int(random.integers(1, 3)),
            "colour": tuple(int(v) for v in random.choice([(150, 70, 20), (190, 120, 30), (120, 40, 25), (170, 140, 60)])),
        }
        for _ in range(LEAVES)
    ]
    for frame in range(FRAMES):
        part = frame / FRAMES
        image = Image.new("RGB", (WIDTH * FINER, HEIGHT * FINER), SCREEN)
        pen = ImageDraw.Draw(image)
        for one in wind:
            span = WIDTH + 80
            x = (one["x"] + one["laps"] * span * part) % span - 40
            y = one["y"] + 10 * math.sin(2 * math.pi * (part + one["turn"]))
            roll = 0.25 + 0.75 * abs(math.cos(math.pi * one["spin"] * part + one["roll"]))
            corners = leaf(one["size"], one["turn"] + 2 * math.pi * one["spin"] * part, roll)
            corners = [(FINER * (x + a), FINER * (y + b)) for a, b in corners]
            pen.polygon(corners, fill=one["colour"])
            pen.line([corners[0], corners[13]], fill=tuple(v // 2 for v in one["colour"]), width=FINER)
        yield image.resize((WIDTH, HEIGHT), Image.BOX)


def main(recorded, examples):
    (examples / "clips").mkdir(exist_ok=True)
    write(examples / "clips/leaves.mp4", list(leaves()), RATE)
    *_, last = drives(recorded)
    write(examples / "drive.mp4", [Image.open(io.BytesIO(frame[1])) for frame in last[20:44]], DRIVE_RATE)


if __name__ == "__main__":
    main(*map(pathlib.Path, sys.argv[1:]))
