"""Pictures to learn from: frames of the embedded simulator, and what night and rain make of them."""

import io

import numpy as np
import torch
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from PIL import Image
from torch.nn import functional

HORIZON = 51 / 160  # from the top, of the simulator's camera on a level road, as a share of the height


def frames(record):
    """The images of a record as (count, 3, height, width) of bytes."""
    found = []
    for trace in sorted((record / "traces").glob("*.mcap")):
        with open(trace, "rb") as file:
            decoder = DecoderFactory()
            for schema, channel, message in make_reader(file).iter_messages(topics=["/raw"]):
                frame = decoder.decoder_for(message_encoding=channel.message_encoding, schema=schema)(message.data)
                found.append(np.asarray(Image.open(io.BytesIO(frame.data)).convert("RGB")))
    if not found:
        raise SystemExit(f"{record}: there are no images in it; record some with `images_every`")
    return torch.from_numpy(np.stack(found)).permute(0, 3, 1, 2).contiguous()


def smooth_step(x, low, high):
    t = ((x - low) / (high - low)).clamp(0, 1)
    return t * t * (3 - 2 * t)


def rows(images):
    return torch.arange(images.shape[2])[None, None, :, None] / images.shape[2]


def night(images):
    """Dusk with headlights goes on to night: the sky goes out, lamps and what they shine on stay."""
    v = images.float()
    brightest, least = v.amax(1, keepdim=True), v.amin(1, keepdim=True)
    lamps = smooth_step(least, 125, 185)
    lamps = torch.maximum(lamps, smooth_step(v[:, :1] - v[:, 1:2], 95, 150) * (rows(v) > HORIZON - 0.03))
    sky = smooth_step(brightest, 58, 84) * (1 - smooth_step(rows(v), HORIZON + 0.02, HORIZON + 0.08)) * (1 - lamps)
    light = v.mean(1, keepdim=True)
    dark_sky = light * torch.tensor([0.11, 0.14, 0.25])[None, :, None, None] + torch.tensor([2.0, 3.0, 8.0])[None, :, None, None]
    ground = 255 * (v / 255) ** 1.55 * torch.tensor([1.32, 1.3, 1.4])[None, :, None, None]
    ground = lamps * v + (1 - lamps) * ground
    return (sky * dark_sky + (1 - sky) * ground).round().clamp(0, 255).to(torch.uint8)


def rain(images):
    """An overcast day turns to rain: the air is thick, colours are pale and dark, and the wet road mirrors what stands behind it."""
    v = images.float()
    height = v.shape[2]
    horizon = round(HORIZON * height)
    y = torch.arange(height).float()
    # The road is grey and lies below the horizon.
    grey = 1 - smooth_step(v.amax(1, keepdim=True) - v.amin(1, keepdim=True), 14, 26)
    dark = 1 - smooth_step(v.mean(1, keepdim=True), 105, 135)
    road = functional.avg_pool2d(grey * dark, 3, 1, 1) * (rows(v) > HORIZON)
    luma = (v * torch.tensor([0.3, 0.59, 0.11])[None, :, None, None]).sum(1, keepdim=True)
    wet = (0.45 * luma + 0.55 * v) * (0.76 - 0.14 * road)
    # The rough surface mirrors the clouds, and what stands upright as wide dark bands that are drawn out towards the camera.
    mirrored = v[:, :, (2 * horizon - y).clamp(0, height - 1).long()]
    drawn_out = functional.avg_pool2d(functional.pad(mirrored, (12, 12, 20, 20), mode="replicate"), (41, 25), 1)
    air = torch.tensor([146.0, 152.0, 160.0])[None, :, None, None]
    fresnel = 0.05 + 0.6 * torch.exp(-(y - horizon).clamp(min=0) / (0.2 * height))
    wet = wet + road * fresnel[None, None, :, None] * (0.5 * drawn_out + 0.42 * air - wet)
    # Drops between the camera and what is far away.
    near = torch.exp(-(y - horizon).clamp(min=0) / (0.06 * height)) * torch.where(y < horizon, 0.5, 0.62)
    wet = wet + near[None, None, :, None] * (air - wet)
    return wet.round().clamp(0, 255).to(torch.uint8)
