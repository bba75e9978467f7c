"""Six styles, each a picture that is drawn here, and what makes a painter paint like them.

A style is described by how often the answers of filters occur together (Gatys et al., "Image Style Transfer Using Convolutional
Neural Networks", 2016), and by how strong they are (Heitz et al., "A Sliced Wasserstein Loss for Neural Texture Synthesis", 2021). The
filters are random, of several sizes and on several scales, and nothing had to be trained: such
filters tell textures apart about as well (Ustyuzhaninov et al., "Texture Synthesis Using Shallow Convolutional Networks with Random
Filters", 2016). The content of the picture is described by its edges and its brightness on coarser scales, whatever their colour.
"""

import copy
import math
import time

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFilter
from torch import nn
from torch.nn import functional

from painter import Painter

SIDE = 256  # of a style's picture, in pixels
PLACES = 256  # at which the strength of answers is compared


def field(random, scale):
    """Smooth random numbers of -1 to 1, which change over this many pixels."""
    cells = SIDE // scale + 3
    coarse = Image.fromarray(random.uniform(-1, 1, (cells, cells)).astype(np.float32))
    return np.asarray(coarse.resize((SIDE, SIDE), Image.BICUBIC))


def along(directions, values, reach):
    """Numbers smeared along directions: a line integral convolution (Cabral and Leedom, 1993)."""
    y, x = np.mgrid[:SIDE, :SIDE].astype(np.float32)
    total = values.copy()
    for sign in (1, -1):
        px, py = x.copy(), y.copy()
        for _ in range(reach):
            at = directions[py.astype(int) % SIDE, px.astype(int) % SIDE]
            px, py = px + sign * np.cos(at), py + sign * np.sin(at)
            total = total + values[py.astype(int) % SIDE, px.astype(int) % SIDE]
    return total / (2 * reach + 1)


def coloured(values, colours):
    """Numbers of 0 to 1 as colours between those of a list."""
    at = np.linspace(0, 1, len(colours))
    return np.stack([np.interp(values, at, [c[k] for c in colours]) for k in range(3)], 2)


def equalised(values):
    """The rank of each number among all, from 0 to 1."""
    return values.ravel().argsort().argsort().reshape(values.shape) / (values.size - 1)


def brush(random):
    """Short broad strokes of thick paint."""
    image = Image.new("RGB", (SIDE, SIDE), (90, 110, 120))
    palette = [(38, 70, 83), (42, 157, 143), (233, 196, 106), (244, 162, 97), (231, 111, 81), (120, 60, 50), (240, 235, 215), (25, 35, 60)]
    hue, turn = equalised(field(random, 64)), field(random, 80) * 2.5
    for _ in range(2600):
        x, y = random.integers(0, SIDE, 2)
        shade = random.integers(-22, 23)
        base = palette[int((hue[y, x] * 7 + random.integers(0, 2)) % len(palette))]
        angle, length, width = turn[y, x] + random.normal(0, 0.2), random.uniform(8, 20), random.uniform(3, 6)
        dx, dy = math.cos(angle), math.sin(angle)
        for bristle in np.arange(-width / 2, width / 2, 1):
            colour = tuple(int(np.clip(c + shade + random.integers(-16, 17), 0, 255)) for c in base)
            ox, oy = x - dy * bristle, y + dx * bristle
            ImageDraw.Draw(image).line([ox, oy, ox + dx * length, oy + dy * length], fill=colour, width=2)
    return image.filter(ImageFilter.GaussianBlur(0.5))


def dots(random):
    """Dots of pure colour on light paper."""
    image = Image.new("RGB", (2 * SIDE, 2 * SIDE), (238, 228, 205))
    draw = ImageDraw.Draw(image)
    palette = [(205, 62, 45), (240, 170, 40), (40, 96, 160), (30, 130, 90), (110, 60, 130), (250, 215, 90), (20, 40, 80)]
    hue = equalised(field(random, 50))
    for _ in range(7000):
        x, y = random.uniform(0, 2 * SIDE, 2)
        radius = random.uniform(3.5, 5.5)
        here = hue[int(y) // 2 % SIDE, int(x) // 2 % SIDE]
        colour = palette[int((here * 6 + random.normal(0, 1.1)) % len(palette))]
        draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill=colour)
    return image.resize((SIDE, SIDE), Image.LANCZOS)


def ink(random):
    """Black ink on cream paper: areas of black, areas of paper, and hatching in between."""
    tone = equalised(field(random, 40) + 0.3 * field(random, 16))
    y, x = np.mgrid[:SIDE, :SIDE]
    wobble = 3 * field(random, 24)
    lines = 0.5 + 0.5 * np.sin((x + y + wobble) * 2 * np.pi / 6)
    crossed = 0.5 + 0.5 * np.sin((x - y + wobble) * 2 * np.pi / 6)
    dark = np.where(tone < 0.22, 1, np.where(tone < 0.42, np.maximum(lines, crossed) > 0.55, np.where(tone < 0.62, lines > 0.6, 0)))
    edge = np.abs(np.gradient(tone)[0]) + np.abs(np.gradient(tone)[1])
    dark = np.maximum(dark, (np.abs(tone - 0.62) < edge * 0.9))
    picture = coloured(1 - dark.astype(float), [(22, 20, 28), (244, 236, 218)])
    return Image.fromarray(picture.astype(np.uint8)).filter(ImageFilter.GaussianBlur(0.5))


def mosaic(random):
    """Small stones of one colour each, with dark joints."""
    palette = [(30, 60, 110), (60, 120, 170), (210, 180, 120), (180, 80, 50), (240, 225, 190), (60, 110, 70), (150, 40, 40), (220, 150, 50)]
    cell = 10
    cells = SIDE // cell + 3
    grid = np.stack(np.mgrid[-1:cells - 1, -1:cells - 1], 2).reshape(-1, 2)
    places = (grid + 0.5 + random.uniform(-0.28, 0.28, grid.shape)) * cell
    hue = equalised(field(random, 56))
    inside = np.clip(places, 0, SIDE - 1).astype(int)
    chosen = ((hue[inside[:, 0], inside[:, 1]] * 7).astype(int) + random.integers(0, 2, len(places))) % len(palette)
    colours = np.array(palette)[chosen] + random.integers(-18, 19, (len(places), 1))
    y, x = np.mgrid[:SIDE, :SIDE]
    away = (y.reshape(-1, 1) - places[:, 0]) ** 2 + (x.reshape(-1, 1) - places[:, 1]) ** 2
    nearest = np.argpartition(away, 1, 1)[:, :2]
    two = np.sqrt(np.take_along_axis(away, nearest, 1))
    first = nearest[np.arange(len(two)), two.argmin(1)]
    joint = np.abs(two[:, 0] - two[:, 1]) < 1.6
    picture = np.where(joint[:, None], (48, 44, 42), colours[first]).reshape(SIDE, SIDE, 3)
    return Image.fromarray(picture.clip(0, 255).astype(np.uint8)).filter(ImageFilter.GaussianBlur(0.4))


def pencil(random):
    """Graphite: fine strokes in two directions on white paper, denser where it is dark."""
    tone = equalised(field(random, 44))
    paper = random.normal(0, 1, (SIDE, SIDE)).astype(np.float32)
    first = equalised(along(np.full((SIDE, SIDE), 0.9, np.float32) + 0.1 * field(random, 60), paper, 12))
    second = equalised(along(np.full((SIDE, SIDE), 2.4, np.float32) + 0.1 * field(random, 60), paper[::-1].copy(), 12))
    dark = 0.75 * (first < 0.95 - tone) + 0.55 * (second < 0.55 - tone)
    outline = np.abs((tone * 5) % 1 - 0.5) > 0.47
    light = 1 - np.clip(0.8 * dark * (0.6 + 0.4 * (1 - tone)) + 0.5 * outline, 0, 0.9)
    picture = coloured(light, [(40, 40, 46), (250, 249, 245)])
    return Image.fromarray(picture.astype(np.uint8)).filter(ImageFilter.GaussianBlur(0.6))


def swirls(random):
    """Flowing lines of blue and yellow that curl about a few centres."""
    y, x = np.mgrid[:SIDE, :SIDE].astype(np.float32)
    turn = 0.6 * field(random, 90)
    for _ in range(9):
        cx, cy, reach = random.uniform(0, SIDE, 1), random.uniform(0, SIDE, 1), random.uniform(22, 48)
        pull = np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * reach**2))
        around = np.arctan2(y - cy, x - cx) + np.pi / 2
        turn = np.arctan2((1 - pull) * np.sin(turn) + pull * np.sin(around), (1 - pull) * np.cos(turn) + pull * np.cos(around))
    noise = np.asarray(Image.fromarray(random.normal(0, 1, (SIDE // 2, SIDE // 2)).astype(np.float32)).resize((SIDE, SIDE), Image.BICUBIC))
    lines = equalised(along(turn, noise, 14))
    hue = equalised(field(random, 60) + 0.5 * (lines - 0.5))
    picture = coloured(hue, [(12, 22, 70), (28, 62, 140), (70, 130, 190), (190, 200, 150), (245, 205, 80), (230, 150, 40)])
    picture = picture * (0.62 + 0.6 * lines[:, :, None])
    return Image.fromarray(picture.clip(0, 255).astype(np.uint8))


STYLES = {"brush": brush, "dots": dots, "ink": ink, "mosaic": mosaic, "pencil": pencil, "swirls": swirls}


def pictures(seed):
    """The picture of each style as (count, 3, height, width) of bytes."""
    drawn = [np.asarray(draw(np.random.default_rng([seed, number]))) for number, draw in enumerate(STYLES.values())]
    return torch.from_numpy(np.stack(drawn)).permute(0, 3, 1, 2)


class Filters(nn.Module):
    """Random filters of five sizes on three scales. The smallest see colours; of the others half see brightness, a quarter red
    against green and a quarter yellow against blue, most of them its contrasts alone."""

    SIZES = (1, 3, 5, 7, 11)

    def __init__(self, seed, each=12, scales=3):
        super().__init__()
        random = torch.Generator().manual_seed(seed)
        self.scales = scales
        self.weights = []
        for size in self.SIZES:
            weight = torch.randn(each, 3, size, size, generator=random)
            window = torch.hann_window(size + 2, periodic=False)[1:-1]
            weight = weight * window[:, None] * window
            if size > 1:
                sees = torch.tensor([0, 0, 1, 2])[torch.arange(each) % 4]
                weight = weight * functional.one_hot(sees, 3)[:, :, None, None]
                weight = weight - weight.mean((2, 3), keepdim=True) * (torch.rand(each, 1, 1, 1, generator=random) < 0.8) * (weight != 0)
            self.weights.append(weight / weight.flatten(1).norm(dim=1)[:, None, None, None])

    def forward(self, image, random, draws=1):
        """For each size and scale, how often filters answer together, (batch, filters, filters), and how strongly at random
        places, in order, (batch, filters, places); the mean of this many draws."""
        red, green, blue = (image / 64).chunk(3, 1)
        x, found = torch.cat([(red + green + blue) / 3 - 2, 2 * (red - green), red + green - 2 * blue], 1), []
        for scale in range(self.scales):
            if scale:
                x = functional.avg_pool2d(x, 2)
            for weight in self.weights:
                with torch.autocast("cpu", torch.bfloat16):
                    y = functional.conv2d(x, weight, stride=1 if scale else 2)
                y = y.flatten(2).float()
                signed = functional.relu(torch.cat([y, -y], 1))
                together = signed @ signed.transpose(1, 2) / y.shape[2]
                places = torch.randint(y.shape[2], (draws, PLACES), generator=random)
                found.append((together, sum(y[:, :, them].sort(2).values for them in places) / draws))
        return found


def unlike(found, wanted, style):
    """How far painted pictures are from their styles; each filter counts as much as any other."""
    total = 0
    for (together, strength), (wanted_together, wanted_strength) in zip(found, wanted):
        goal = wanted_together[style]
        usual = goal.diagonal(dim1=1, dim2=2).sqrt() + 0.05
        apart = (together - goal) / (usual[:, :, None] * usual[:, None, :])
        goal = wanted_strength[style]
        away = (strength - goal) ** 2 / ((goal**2).mean(2, keepdim=True) + 0.01)
        total = total + (apart**2).mean((1, 2)) + 2 * away.mean((1, 2))
    return total / len(found)


def content(image):
    """Brightness on coarser scales, and its edges, each with no mean and a deviation of one in every picture."""
    luma = (image * torch.tensor([0.3, 0.59, 0.11])[None, :, None, None]).sum(1, keepdim=True)
    found = []
    for size in (4, 8):
        small = functional.avg_pool2d(luma, size)
        small = small - small.mean((2, 3), keepdim=True)
        small = small / (small.std((2, 3), keepdim=True) + 4)
        found += [small, 2 * (small[:, :, 1:] - small[:, :, :-1]), 2 * (small[:, :, :, 1:] - small[:, :, :, :-1])]
    return found


def train(images, steps, seed, likeness=1.0, structure=2.0, crop=112, margin=16, show=None):
    """A painter with all styles, from pictures as (count, 3, height, width) of bytes."""
    torch.manual_seed(seed)
    random = torch.Generator().manual_seed(seed)
    count = len(STYLES)
    painter, filters = Painter(styles=count, detail=12), Filters(seed)
    average = copy.deepcopy(painter)
    with torch.no_grad():
        wanted = filters(pictures(seed).float(), random, draws=16)
    rate = 3e-3
    optimiser = torch.optim.Adam(painter.parameters(), rate, (0.9, 0.99))
    everything = torch.arange(count)
    sums, began = torch.zeros(2), time.process_time()
    for step in range(steps):
        painter.exact = step >= 0.8 * steps
        optimiser.param_groups[0]["lr"] = rate * min(1, (step + 1) / 50, 1.5 * (1 - step / steps) + 0.02)
        found = []
        for _ in range(count):
            frame = images[torch.randint(len(images), (), generator=random)]
            top, left = (torch.randint(side - crop + 1, (), generator=random) for side in frame.shape[1:])
            found.append(frame[:, top:top + crop, left:left + crop].float())
        original = torch.stack(found).contiguous(memory_format=torch.channels_last)
        # Half the digits, until it comes to all of them: faster on processors that can.
        with torch.autocast("cpu", torch.bfloat16, enabled=not painter.exact):
            painted = painter(original, everything).float()
        # What a painter does at the edge of a picture, where it sees less, is not to be its way to please.
        inside = slice(margin, crop - margin)
        original, painted = original[:, :, inside, inside], painted[:, :, inside, inside]
        of_style = unlike(filters(painted, random), wanted, everything).mean()
        of_content = sum(functional.mse_loss(a, b) for a, b in zip(content(painted), content(original))) / 6
        optimiser.zero_grad()
        (likeness * of_style + structure * of_content).backward()
        torch.nn.utils.clip_grad_norm_(painter.parameters(), 1.0)
        optimiser.step()
        with torch.no_grad():
            for mean, now in zip(average.parameters(), painter.parameters()):
                mean.lerp_(now, 1 - min(0.99, step / (step + 10)))
            sums += torch.tensor([of_style, of_content])
        if (step + 1) % 100 == 0:
            print(f"step {step + 1}: style {sums[0] / 100:.3f}, content {sums[1] / 100:.3f}; "
                  f"{time.process_time() - began:.0f} s of processor time", flush=True)
            sums.zero_()
            if show:
                show(average, step + 1)
    return average
