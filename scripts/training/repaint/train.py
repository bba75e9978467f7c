"""Trains the shipped networks that repaint: `night.onnx`, `rainy.onnx` and `artistic.onnx`.

    pip install -r scripts/training/requirements.txt
    pdk run collect --out day --set 'lights=["day"]' --set road_seed=5001 --set roads=1 --set duration=20 --set images_every=32
    pdk run collect --out dusk --set 'lights=["dusk"]' --set road_seed=6001 --set roads=1 --set duration=20 --set images_every=32
    pdk run collect --out overcast --set 'lights=["overcast"]' --set road_seed=7001 --set roads=1 --set duration=20 --set images_every=32
    python scripts/training/repaint/train.py day dusk overcast scripts/painters

All pictures are this project's own: frames of the embedded simulator, on other roads for each light, and six drawings that
`styles.py` makes. No weights come from elsewhere. `scenes.py` says what night and rain look like, `weather.py` and `styles.py` how
painters learn, and `painter.py` what they are and why their arithmetic is exact.
"""

import argparse
import pathlib

import torch
from PIL import Image

import scenes
import styles
import weather
from painter import export

HEIGHT, WIDTH = 160, 320
SEED = 1


def watcher(folder, name, images, count=1):
    """Paints a few frames with each style as the training goes on, for people to look at."""
    if folder is None:
        return None
    folder.mkdir(parents=True, exist_ok=True)

    def show(painter, step):
        exact, painter.exact = painter.exact, True
        with torch.no_grad():
            painted = [painter(images.float(), torch.full((len(images),), style) if count > 1 else None) for style in range(count)]
        painter.exact = exact
        rows = [torch.cat(list(row), 2) for row in [images, *painted]]
        pixels = torch.cat(rows, 1).round().to(torch.uint8).permute(1, 2, 0)
        Image.fromarray(pixels.numpy()).save(folder / f"{name}.png")
        print(f"{folder / name}.png is of step {step}", flush=True)

    return show


def main():
    parser = argparse.ArgumentParser(description="Trains networks that repaint on records of the embedded simulator.")
    parser.add_argument("day", type=pathlib.Path, help="a record by day")
    parser.add_argument("dusk", type=pathlib.Path, help="a record at dusk")
    parser.add_argument("overcast", type=pathlib.Path, help="a record under clouds")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--only", choices=["night", "rainy", "artistic"])
    parser.add_argument("--pictures", type=pathlib.Path, help="a folder for pictures of how the training goes on")
    arguments = parser.parse_args()
    # One thread adds in the same order every time.
    torch.set_num_threads(1)
    day, dusk, overcast = (scenes.frames(record) for record in (arguments.day, arguments.dusk, arguments.overcast))
    print(f"{len(day)} images by day, {len(dusk)} at dusk, {len(overcast)} under clouds", flush=True)
    arguments.out.mkdir(parents=True, exist_ok=True)
    shown = day[:: max(1, len(day) // 4)][:4]

    for name, after, steps, memory in [("night", scenes.night(dusk), 3000, 1.0), ("rainy", scenes.rain(overcast), 1800, 0.1)]:
        if arguments.only in (None, name):
            painter = weather.train(day, after, steps, SEED, memory=memory, show=watcher(arguments.pictures, name, shown))
            export(painter, arguments.out / f"{name}.onnx", HEIGHT, WIDTH)
    if arguments.only in (None, "artistic"):
        show = watcher(arguments.pictures, "artistic", shown, len(styles.STYLES))
        painter = styles.train(torch.cat([day, overcast, dusk[::2]]), 800, SEED, show=show)
        export(painter, arguments.out / "artistic.onnx", HEIGHT, WIDTH, tuple(styles.STYLES))


if __name__ == "__main__":
    main()
