"""Trains a painter to turn the picture of a place in one weather into that of the same place in another.

The simulator drives each road in all weather, so each frame has a counterpart, and the painter learns from the difference to it: in
levels, in their square roots, which count dark places as eyes do, and in edges. What cannot be known from the picture, such as how far
away something is, comes out as the mean of what it may be. Two consecutive frames of a drive are painted at once. The second
painting, moved to where its places were in the first, has to be like the first (Ruder et al., "Artistic Style Transfer for Videos", 2016), but
for places that are to be seen in one of them only.
"""

import copy
import time

import torch
from torch.nn import functional

from painter import Painter
from scenes import warped

RATE = 2e-3
AVERAGE = 0.995  # of the weights over the steps, which is what is kept
EXACT_FROM = 0.85  # of the steps, with the rounding of the exported network
CLOSEST = 0.75  # of a frame's sides: the smallest part that is seen enlarged, so that the horizon is not always in the same place


def windows(pictures, random):
    """A random part of the pictures, enlarged to their size, in every other call; and mirrored in every other one."""
    whole, mirrored = (torch.rand(2, generator=random) < 0.5).tolist()
    share, left, top = torch.rand(3, generator=random).tolist()
    share = 1.0 if whole else CLOSEST + (1 - CLOSEST) * share
    left, top = ((1 - share) * (2 * at - 1) for at in (left, top))
    across = share * (-1 if mirrored else 1)
    affine = torch.tensor([[across, 0, left], [0, share, top]]).expand(1, 2, 3)
    grid = functional.affine_grid(affine, (1, 1, *pictures[0].shape[2:]), align_corners=False)
    found = [warped(picture, grid.expand(len(picture), -1, -1, -1)) for picture in pictures]
    return found, affine[0]


def moved(places, affine):
    """Places in the next frame as those in its window, for the pixels of the window."""
    return (places.permute(0, 2, 3, 1) - affine[:, 2]) / torch.stack([affine[0, 0], affine[1, 1]])


def edges(image):
    return image[:, :, 1:] - image[:, :, :-1], image[:, :, :, 1:] - image[:, :, :, :-1]


def apart(painted, wanted):
    """How far pictures of 0 to 255 are from what they are to be."""
    roots = [(picture.clamp(0, 255) / 255 + 0.002).sqrt() for picture in (painted, wanted)]
    found = (painted - wanted).abs().mean() / 64 + 2 * (roots[0] - roots[1]).abs().mean()
    for a, b in zip(edges(painted), edges(wanted)):
        found = found + (a - b).abs().mean() / 64
    return found


def shaken(painted, places, seen):
    """How far the second painting, moved onto the first, is from it."""
    return ((warped(painted[1:], places) - painted[:1]).abs() * seen).sum() / (3 * seen.sum() + 1) / 64


def train(drives, before, after, steps, seed, steady=1.0, show=None):
    """A painter that turns frames in each weather of a list into those of another. `steady` says how much time counts."""
    torch.manual_seed(seed)
    random = torch.Generator().manual_seed(seed)
    painter = Painter(halvings=3).to(memory_format=torch.channels_last)
    average = copy.deepcopy(painter)
    optimiser = torch.optim.Adam(painter.parameters(), RATE, (0.9, 0.99))
    sums, began = torch.zeros(2), time.process_time()
    for step in range(steps):
        painter.exact = step >= EXACT_FROM * steps
        optimiser.param_groups[0]["lr"] = RATE * min(1, (step + 1) / 50, 1.6 * (1 - step / steps) + 0.01)
        first = drives.first[torch.randint(len(drives.first), (), generator=random)].item()
        weather = before[torch.randint(len(before), (), generator=random)]
        pair = slice(first, first + 2)
        (original, wanted, places, seen), affine = windows(
            [drives.images[weather][pair].float(), drives.images[after][pair].float(),
             drives.places[first:first + 1].permute(0, 3, 1, 2), drives.seen[first:first + 1]], random,
        )
        painted = painter(original.contiguous(memory_format=torch.channels_last))
        places = moved(places, affine)
        seen = (seen > 0.99) & (places.abs() < 1).all(3)[:, None]
        unlike, unsteady = apart(painted, wanted), shaken(painted, places, seen)
        optimiser.zero_grad()
        (unlike + steady * unsteady).backward()
        optimiser.step()
        with torch.no_grad():
            for mean, now in zip(average.parameters(), painter.parameters()):
                mean.lerp_(now, 1 - min(AVERAGE, step / (step + 10)))
            sums += torch.tensor([unlike, unsteady])
        if (step + 1) % 200 == 0:
            print(f"step {step + 1}: unlike {sums[0] / 200:.3f}, unsteady {sums[1] / 200:.3f}; "
                  f"{time.process_time() - began:.0f} s of processor time", flush=True)
            sums.zero_()
            if show:
                show(average, step + 1)
    return average.to(memory_format=torch.contiguous_format)
