"""Trains a painter to turn pictures of one kind into another, from pictures of both that show different places.

This is contrastive unpaired translation (Park et al., "Contrastive Learning for Unpaired Image-to-Image Translation", 2020): a
discriminator learns to tell painted pictures from true ones of the other kind, and the painter to pass for true (least squares: Mao
et al., 2017), while each place of the painted picture has to be recognised among others of the same picture by what the painter's own
first half sees there. So the light changes, and the road stays where it is. It does what the cycle of CycleGAN (Zhu et al., 2017)
does with half the networks. A discriminator that always knows teaches nothing, as where one kind is bright and the other dark: so
the painter is also told what colours there are at each height, and how they vary, and the discriminator sees pictures with noise.
"""

import copy
import time

import torch
from torch import nn
from torch.nn import functional

from painter import Painter

CROP = 128  # pixels of a frame's width; the whole height is seen, since the sky is above
BATCH = 2
PLACES = 96  # of each picture that have to be recognised
TEMPERATURE = 0.07
BANDS = 8  # of the height, in which colours are compared
NOISE = 10.0  # deviation of what is added before the discriminator, in levels of 255, at the beginning; none at half of the steps
AVERAGE = 0.995  # of the weights over the steps, which is what is kept
EXACT_FROM = 0.8  # of the steps, with the rounding of the exported network


class Discriminator(nn.Module):
    """Says of patches of 37 x 37 pixels whether they are true."""

    def __init__(self, width=24):
        super().__init__()
        self.layers = nn.Sequential(
            nn.Conv2d(3, width, 4, 2, 1), nn.LeakyReLU(0.2),
            nn.Conv2d(width, 2 * width, 4, 2, 1), nn.LeakyReLU(0.2),
            nn.Conv2d(2 * width, 2 * width, 3, 1, 1), nn.LeakyReLU(0.2),
            nn.Conv2d(2 * width, 2 * width, 3, 1, 1), nn.LeakyReLU(0.2),
            nn.Conv2d(2 * width, 1, 3, 1, 1),
        )

    def forward(self, image):
        return self.layers(image / 127.5 - 1)


class Recognition(nn.Module):
    """How well places of a painted picture are recognised among those of the original."""

    def __init__(self, channels, size=32):
        super().__init__()
        self.heads = nn.ModuleList([
            nn.Sequential(nn.Linear(count, size), nn.ReLU(), nn.Linear(size, size)) for count in channels
        ])

    def forward(self, painted, original, random):
        total = 0
        for head, here, there in zip(self.heads, painted, original):
            batch, _, height, width = here.shape
            chosen = torch.randperm(height * width, generator=random)[:PLACES]
            here, there = (
                functional.normalize(head(f.flatten(2)[:, :, chosen].transpose(1, 2).float()), dim=2) for f in (here, there.detach())
            )
            alike = here @ there.transpose(1, 2) / TEMPERATURE
            right = torch.arange(len(chosen)).expand(batch, -1)
            total = total + functional.cross_entropy(alike.flatten(0, 1), right.flatten())
        return total / len(self.heads)


def colours(images):
    """Mean and covariance of the colours in each band of the pictures together: (bands, 3) and (bands, 3, 3)."""
    bands = (images / 64).permute(2, 0, 3, 1).reshape(BANDS, -1, 3)
    mean = bands.mean(1, keepdim=True)
    return mean[:, 0], (bands - mean).transpose(1, 2) @ (bands - mean) / bands.shape[1]


def crops(images, random, count=BATCH):
    """Random crops of random frames, every other one mirrored."""
    found = []
    for _ in range(count):
        frame = images[torch.randint(len(images), (), generator=random)]
        left = torch.randint(images.shape[3] - CROP + 1, (), generator=random)
        crop = frame[:, :, left:left + CROP].float()
        found.append(crop.flip(2) if torch.rand((), generator=random) < 0.5 else crop)
    return torch.stack(found).contiguous(memory_format=torch.channels_last)


def train(before, after, steps, seed, recognition=1.0, identity=0.05, tone=4.0, memory=1.0, show=None):
    """A painter that turns the first kind of pictures into the second; both as (count, 3, height, width) of bytes.

    `recognition`, `identity` and `tone` say how much what is recognised, what is kept and the colours count. Colours are those of the
    pictures painted last, of which the newest count for `memory`: the less, the less do they follow what a few pictures happen to show.
    """
    torch.manual_seed(seed)
    random = torch.Generator().manual_seed(seed)
    painter, judge = (network.to(memory_format=torch.channels_last) for network in (Painter(), Discriminator()))
    places = Recognition([3, 16, 32, 32])
    average = copy.deepcopy(painter)
    rate = 1e-3
    painting = torch.optim.Adam([*painter.parameters(), *places.parameters()], rate, (0.5, 0.99))
    judging = torch.optim.Adam(judge.parameters(), rate / 4, (0.5, 0.99))
    wanted, lately = colours(after.float()), colours(before.float())
    sums, began = torch.zeros(5), time.process_time()
    for step in range(steps):
        painter.exact = step >= EXACT_FROM * steps
        for optimiser, full in ((painting, rate), (judging, rate / 4)):
            optimiser.param_groups[0]["lr"] = full * min(1, 2 * (1 - step / steps))
        original, true = crops(before, random), crops(after, random)
        # Half the digits, until it comes to all of them: faster on processors that can.
        with torch.autocast("cpu", torch.bfloat16, enabled=not painter.exact):
            painted = painter(original).float()

        judge.requires_grad_(True)
        noise = max(0, 1 - 2 * step / steps) * NOISE
        both = torch.cat([true, painted.detach()])
        with torch.autocast("cpu", torch.bfloat16):
            of_true, of_painted = judge(both + noise * torch.randn(both.shape, generator=random)).float().chunk(2)
        judged = ((of_true - 1) ** 2).mean() + (of_painted**2).mean()
        judging.zero_grad()
        judged.backward()
        judging.step()

        judge.requires_grad_(False)
        with torch.autocast("cpu", torch.bfloat16, enabled=not painter.exact):
            passes = ((judge(painted + noise * torch.randn(painted.shape, generator=random)) - 1) ** 2).mean()
            there = painter.features(painted)
            with torch.no_grad():
                here = painter.features(original)
            # A picture that is of the second kind already has nothing to change.
            kept = (painter(true[:1]) - true[:1]).abs().mean()
        known = places(there, here, random)
        lately = [(1 - memory) * old + memory * new for old, new in zip(lately, colours(painted))]
        apart = sum((found - goal).abs().mean() for found, goal in zip(lately, wanted))
        painting.zero_grad()
        (passes + recognition * known + identity * kept + tone / memory * apart).backward()
        painting.step()
        with torch.no_grad():
            for mean, now in zip(average.parameters(), painter.parameters()):
                mean.lerp_(now, 1 - min(AVERAGE, step / (step + 10)))
            lately = [now.detach() for now in lately]
            sums += torch.tensor([judged, passes, known, kept, apart])
        if (step + 1) % 200 == 0:
            means = ", ".join(f"{name} {value:.3f}" for name, value in zip(("judged", "passes", "known", "kept", "apart"), sums / 200))
            print(f"step {step + 1}: {means}; {time.process_time() - began:.0f} s of processor time", flush=True)
            sums.zero_()
            if show:
                show(average, step + 1)
    return average.to(memory_format=torch.contiguous_format)
