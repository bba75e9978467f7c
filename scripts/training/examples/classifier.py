"""Draws the signs of docs/examples, and trains the classifier beside them.

    pip install -r scripts/training/examples/requirements.txt
    python scripts/training/examples/classifier.py docs/examples

The classifier has never seen the pictures in the folder, which come from another seed.
"""

import pathlib
import sys

import numpy as np
from PIL import Image, ImageDraw, ImageFilter

from network import Network

SIZE = 48  # of the pictures
SEEN = 32  # of what the network sees
CLASSES = ("crossing", "limit", "oneway", "stop", "yield")  # in the order of the outputs
RED, BLUE, YELLOW, WHITE, BLACK = (190, 30, 40), (30, 80, 170), (240, 200, 40), (245, 245, 245), (25, 25, 25)


def ring(count, radius, turn=0.0):
    """Corners on a circle about the middle of a canvas of 200 x 200."""
    angles = np.arange(count) / count * 2 * np.pi + turn
    return [(100 + radius * np.sin(a), 100 - radius * np.cos(a)) for a in angles]


def draw(name, random):
    """A sign on a transparent canvas."""
    canvas = Image.new("RGBA", (200, 200))
    pen = ImageDraw.Draw(canvas)
    if name == "stop":
        pen.polygon(ring(8, 98, np.pi / 8), fill=WHITE)
        pen.polygon(ring(8, 90, np.pi / 8), fill=RED)
        pen.rectangle((45, 84, 155, 116), fill=WHITE)
    elif name == "yield":
        pen.polygon(ring(3, 98, np.pi), fill=RED)
        pen.polygon(ring(3, 58, np.pi), fill=WHITE)
    elif name == "limit":
        pen.ellipse((4, 4, 196, 196), fill=RED)
        pen.ellipse((32, 32, 168, 168), fill=WHITE)
        digits = random.integers(3, 9)
        pen.rectangle((62, 66, 92, 134), outline=BLACK, width=6 + int(digits))
        pen.rectangle((108, 66, 138, 134), outline=BLACK, width=11)
    elif name == "oneway":
        pen.ellipse((4, 4, 196, 196), fill=BLUE)
        pen.polygon([(40, 88), (110, 88), (110, 60), (165, 100), (110, 140), (110, 112), (40, 112)], fill=WHITE)
    else:
        pen.polygon(ring(4, 98), fill=BLACK)
        pen.polygon(ring(4, 92), fill=YELLOW)
        pen.ellipse((88, 50, 112, 74), fill=BLACK)
        pen.polygon([(92, 78), (108, 78), (128, 148), (112, 148), (100, 112), (88, 148), (72, 148)], fill=BLACK)
    return canvas


def scene(random):
    """Sky, woods or houses behind a sign."""
    top, bottom = random.integers(60, 230, 3), random.integers(40, 170, 3)
    shade = np.linspace(0, 1, SIZE)[:, None, None]
    picture = np.broadcast_to(top * (1 - shade) + bottom * shade, (SIZE, SIZE, 3)).astype(np.uint8).copy()
    image = Image.fromarray(picture)
    pen = ImageDraw.Draw(image)
    for _ in range(random.integers(2, 7)):
        x, y, width, height = random.integers(-10, SIZE, 2).tolist() + random.integers(4, 26, 2).tolist()
        pen.rectangle((x, y, x + width, y + height), fill=tuple(random.integers(20, 220, 3).tolist()))
    return image.filter(ImageFilter.GaussianBlur(0.8))


def picture(name, random):
    """A picture of a sign, as a camera beside the road takes it."""
    image = scene(random)
    size = int(random.integers(20, 44))
    sign = draw(name, random).rotate(random.uniform(-12, 12), Image.BICUBIC)
    sign = sign.resize((max(10, int(size * random.uniform(0.75, 1))), size), Image.LANCZOS)
    image.paste(sign, (int(random.integers(0, SIZE - sign.width + 1)), int(random.integers(0, SIZE - size + 1))), sign)
    light = np.asarray(image, np.float32) * random.uniform(0.5, 1.15) + random.normal(0, 5, (SIZE, SIZE, 3))
    return Image.fromarray(np.clip(light, 0, 255).astype(np.uint8))


def seen(image):
    """A picture as the network sees it. It is resized as pdk does with `resize = "pil_bilinear"`, which signs.toml sets."""
    small = image.convert("RGB").resize((SEEN, SEEN), Image.BILINEAR, reducing_gap=None)
    return np.asarray(small, np.float32).transpose(2, 0, 1) / 255


def sample(count, seed):
    random = np.random.default_rng(seed)
    labels = random.integers(0, len(CLASSES), count)
    return np.stack([seen(picture(CLASSES[label], random)) for label in labels]), labels


def main(examples):
    random = np.random.default_rng(40)
    for name in CLASSES:
        folder = examples / "signs" / name
        folder.mkdir(parents=True, exist_ok=True)
        for number in range(8):
            picture(name, random).save(folder / f"{number}.jpg", quality=85, optimize=True)

    images, labels = sample(4000, 1)

    def loss(out, chosen):
        share = np.exp(out - out.max(1, keepdims=True))
        share /= share.sum(1, keepdims=True)
        wanted = np.eye(len(CLASSES), dtype=np.float32)[labels[chosen]]
        return float(-np.log((share * wanted).sum(1) + 1e-9).mean()), share - wanted

    network = Network((3, SEEN, SEEN), [(12, 3), (16, 3), (24, 3)], 32, len(CLASSES))
    network.train(images, loss, 1500)
    network.save(examples / "signs.onnx", "scores", {"classes": ",".join(CLASSES), "made_by": "scripts/training/examples/classifier.py"})
    others, truth = sample(1000, 2)
    print("right of 1000 others:", (network.forward(others).argmax(1) == truth).mean())
    folder = [(seen(Image.open(path)), label) for label, name in enumerate(CLASSES) for path in sorted((examples / "signs" / name).iterdir())]
    found = network.forward(np.stack([image for image, _ in folder])).argmax(1)
    print("right of the folder:", (found == [label for _, label in folder]).mean(), "of", len(folder))


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
