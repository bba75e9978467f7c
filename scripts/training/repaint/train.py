"""Trains the shipped networks that repaint: `night.onnx`, `rainy.onnx` and `artistic.onnx`.

    pip install -r scripts/training/requirements.txt
    pdk run scripts/training/repaint/drives.lua --out drives
    python scripts/training/repaint/train.py drives scripts/painters --only night
    python scripts/training/repaint/train.py drives scripts/painters --only rainy

All pictures are this project's own: drives of the embedded simulator on the same roads in all weather, and six drawings that
`styles.py` makes. No weights come from elsewhere. `weather.py` and `styles.py` say how painters learn, and `painter.py` what they are and why
their arithmetic is exact. `measure.py` measures how steady they paint on other roads. The `artistic.onnx` that ships is older than
`drives.lua`: it learned from other frames, so `--only artistic` makes another network.
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
    parser = argparse.ArgumentParser(description="Trains networks that repaint on drives of the embedded simulator.")
    parser.add_argument("drives", type=pathlib.Path, help="a record of drives.lua")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--only", choices=["night", "rainy", "artistic"])
    parser.add_argument("--pictures", type=pathlib.Path, help="a folder for pictures of how the training goes on")
    arguments = parser.parse_args()
    # One thread adds in the same order every time.
    torch.set_num_threads(1)
    drives = scenes.Drives(arguments.drives)
    print(f"{len(drives)} frames in each weather", flush=True)
    arguments.out.mkdir(parents=True, exist_ok=True)
    shown = drives.images["day"][:: max(1, len(drives) // 4)][:4]

    for name, after in [("night", "night"), ("rainy", "rain")]:
        if arguments.only in (None, name):
            painter = weather.train(drives, ["day", "overcast"], after, 1500, SEED, show=watcher(arguments.pictures, name, shown))
            export(painter, arguments.out / f"{name}.onnx", HEIGHT, WIDTH)
    if arguments.only in (None, "artistic"):
        show = watcher(arguments.pictures, "artistic", shown, len(styles.STYLES))
        painter = styles.train(torch.cat([drives.images[light] for light in ("day", "overcast", "night")]), 800, SEED, show=show)
        export(painter, arguments.out / "artistic.onnx", HEIGHT, WIDTH, tuple(styles.STYLES))


if __name__ == "__main__":
    main()
