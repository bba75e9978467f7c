"""Trains the pilot of docs/examples, and writes the recordings beside it: a tub of a DonkeyCar, and frames with a CSV.

    pip install -r scripts/training/examples/requirements.txt
    pdk run scripts/training/examples/record.lua --out training-examples
    python scripts/training/examples/pilot.py training-examples docs/examples

The pilot steers as the driver `lane_keeper` does, with a constant throttle. Its drives but the last two are for training; the recordings are from those two.
"""

import csv
import io
import json
import pathlib
import sys

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from PIL import Image

from network import Network

SHAPE = (3, 40, 80)
RATE = 20  # frames a second
BEGIN = 1_700_000_000_000  # of the recordings, in milliseconds
FRAMES = 30


def drives(folder):
    """The frames of each drive: number, encoded picture, steering, throttle and speed."""
    for drive in map(json.loads, open(folder / "scenarios.jsonl")):
        found = {}
        with open(folder / "traces" / f"{drive['id']}.mcap", "rb") as file:
            factory = DecoderFactory()
            for schema, channel, message in make_reader(file).iter_messages(topics=["/state", "/raw", "/control"]):
                decoded = factory.decoder_for(message_encoding=channel.message_encoding, schema=schema)(message.data)
                found.setdefault(channel.topic, {})[message.sequence] = decoded
        yield [
            (at, frame.data, found["/control"][at].steering, found["/control"][at].throttle, found["/state"][at].speed)
            for at, frame in sorted(found["/raw"].items())
        ]


def small(picture):
    """A picture as the network sees it. It is resized as the driver `onnx` does with `resize = "pil_bilinear"`, which pilot.toml sets."""
    image = Image.open(io.BytesIO(picture)).convert("RGB").resize((SHAPE[2], SHAPE[1]), Image.BILINEAR, reducing_gap=None)
    return np.asarray(image, np.float32).transpose(2, 0, 1) / 255


def jpeg(picture, path):
    Image.open(io.BytesIO(picture)).convert("RGB").save(path, quality=70, optimize=True)


def tub(folder, frames):
    """A tub of version 2, as donkeycar 4 and 5 write it."""
    (folder / "images").mkdir(parents=True, exist_ok=True)
    lines = []
    for index, (at, picture, steering, throttle, _) in enumerate(frames):
        name = f"{index}_cam_image_array_.jpg"
        jpeg(picture, folder / "images" / name)
        record = {
            "_index": index, "_session_id": "23-11-14_0", "_timestamp_ms": BEGIN + round(1000 * at / RATE), "cam/image_array": name,
            "user/angle": round(steering, 4), "user/mode": "user", "user/throttle": round(throttle, 4),
        }
        lines.append(json.dumps(record) + "\n")
    (folder / "catalog_0.catalog").write_text("".join(lines))
    begin = BEGIN / 1000
    catalog = {"created_at": begin, "line_lengths": [len(line) for line in lines], "path": "catalog_0.catalog_manifest", "start_index": 0}
    (folder / "catalog_0.catalog_manifest").write_text(json.dumps(catalog) + "\n")
    inputs = ["cam/image_array", "user/angle", "user/throttle", "user/mode"]
    manifest = [
        inputs, ["image_array", "float", "float", "str"], {}, {"created_at": begin, "sessions": {"all_full_ids": ["23-11-14_0"], "last_id": 0}},
        {"paths": ["catalog_0.catalog"], "current_index": len(lines), "max_len": 1000, "deleted_indexes": []},
    ]
    (folder / "manifest.json").write_text("".join(json.dumps(line) + "\n" for line in manifest))


def recording(folder, frames):
    """Frames with a CSV that names them."""
    (folder / "frames").mkdir(parents=True, exist_ok=True)
    with open(folder / "log.csv", "w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["image", "steering", "throttle", "speed", "timestamp"])
        for index, (at, picture, steering, throttle, speed) in enumerate(frames):
            name = f"frames/{index:04}.jpg"
            jpeg(picture, folder / name)
            rows.writerow([name, f"{steering:.4f}", f"{throttle:.4f}", f"{speed:.3f}", f"{at / RATE:.3f}"])


def middle(frames):
    """The part of a drive with the most steering in it."""
    steering = np.abs([frame[2] for frame in frames])
    begin = int(np.argmax(np.convolve(steering, np.ones(FRAMES), "valid")))
    return frames[begin:begin + FRAMES]


def main(recorded, examples):
    *learned, first, second = drives(recorded)
    tub(examples / "tub", middle(first))
    recording(examples / "recording", middle(second)[:20])

    images = np.stack([small(frame[1]) for drive in learned for frame in drive])
    wanted = np.array([frame[2:4] for drive in learned for frame in drive], np.float32)
    # A mirrored road is steered the other way.
    images = np.concatenate([images, images[:, :, :, ::-1]])
    wanted = np.concatenate([wanted, wanted * (-1, 1)]).astype(np.float32)

    def loss(out, chosen):
        error = (out - wanted[chosen]) * np.float32([1, 0.15])
        return float((error**2).mean()), error

    network = Network(SHAPE, [(8, 5), (12, 5), (16, 3)], 32, 2)
    network.train(images, loss, 1600)
    # The throttle follows the speed above all, which a picture does not show: what it learned of that is worse than the mean.
    weights, bias = network.dense[1].weights
    weights[:, 1], bias[1] = 0, wanted[:, 1].mean()
    network.save(examples / "pilot.onnx", "control", {"made_by": "scripts/training/examples/pilot.py"})
    held_out = [frame for drive in (first, second) for frame in drive]
    out = network.forward(np.stack([small(frame[1]) for frame in held_out]))
    truth = np.array([frame[2:4] for frame in held_out])
    print("mean absolute error:", np.abs(out - truth).mean(0), "of the mean:", np.abs(truth - wanted.mean(0)).mean(0))


if __name__ == "__main__":
    main(*map(pathlib.Path, sys.argv[1:]))
