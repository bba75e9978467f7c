"""Trains the driving networks that come with pdk.

    pip install -r scripts/training/requirements.txt
    pdk run collect --out training-data
    python scripts/training/train.py training-data --out scripts/models --tub TUB

What they learn is not what the vehicle did, which swung about its lane on purpose, but what would have been right at each
place: to steer by pure pursuit towards the middle of the lane, to slow down for bends, and to keep a time gap to the vehicle
ahead. Position, course and the vehicle ahead are in the record. On easy roads, which look like a drawing, they learn to drive
at 8 m/s; on the others at up to 16 m/s, and to allow for the time that controls take to have their effect.

`dave2`             sees the recorded images as they are.
`dave2_augmented`   sees them with random noise, blur, brightness and contrast.
`dave2_hardened`    sees, beside them, images through perturbations of pdk that made `dave2` fail (`--perturbed`).
`dave2_temporal`    sees them as they are, and remembers features of what it saw 0.3 and 0.6 seconds before.
`dave2_tub`         sees, beside them, real images: a recording of a DonkeyCar, with what its human driver did.
`transformer`       sees them as they are. It is a small vision transformer.
`waypoint_planner`  sees them as they are, and plans where to be in the next two seconds. It is a residual network.

docs/drivers.md says what the networks that come with pdk saw and how well they drive. `dave2_hardened` and `waypoint_planner` were trained with
torch 2.11.0 on a GPU, `transformer` with torch 2.11.0 and the others with torch 2.15.0 on one thread of a processor. Another version of torch or
another processor gives networks that differ a little; every record names the network by its hash.
"""

import argparse
import multiprocessing
import pathlib

import torch
from torch.nn import functional

import networks
import records
from networks import WINDOW

SEED = 1
# What they are, and for how many epochs they learn if nothing else is said.
NETWORKS = {
    "dave2": (networks.Dave2, 8),
    "dave2_augmented": (networks.Dave2, 8),
    "dave2_hardened": (networks.Dave2, 8),
    "dave2_temporal": (networks.Dave2Temporal, 8),
    "dave2_tub": (networks.Dave2, 8),
    "transformer": (networks.Transformer, 24),
    "waypoint_planner": (networks.WaypointPlanner, 20),
}
# What a network needs besides records, by the option that gives it.
NEEDS = {"dave2_tub": "tub", "dave2_hardened": "perturbed"}


def augmented(images, random):
    """Images with random brightness, contrast, noise and blur."""
    count, device = len(images), images.device

    def draw(low, high):
        return low + (high - low) * torch.rand(count, 1, 1, 1, generator=random).to(device)

    images = (images - 128) * draw(0.4, 1.5) + 128 + draw(-50, 50)
    sigma = draw(0, 1) ** 2 * 45
    images = images + sigma * torch.randn(images.shape, generator=random).to(device)
    chosen = torch.rand(count, generator=random) < 0.5
    for size in (3, 5):
        blurred = functional.avg_pool2d(images, size, 1, size // 2, count_include_pad=False)
        here = chosen & (torch.randint(0, 2, (count,), generator=random) == (size == 5))
        images = torch.where(here[:, None, None, None].to(device), blurred, images)
    return images.clamp(0, 255)


def windows(drives, chosen, random):
    """Places of successive samples of one drive each, WINDOW in a row; they begin at another one of its images every time."""
    rows = []
    for drive in torch.unique(drives[chosen]):
        places = torch.nonzero((drives == drive) & chosen)[:, 0]
        begin = int(torch.randint(0, WINDOW, (), generator=random))
        rows += [places[i:i + WINDOW] for i in range(begin, len(places) - WINDOW + 1, WINDOW)]
    return torch.stack(rows)


def train(name, network, data, epochs, device, real=None):
    """Trains a network on samples, and on real images among them if there are any."""
    images, speeds, labels, drives = data
    plans = network.outputs == ["waypoints"]
    labels = labels[:, 2:] if plans else labels[:, :2]
    images, speeds, labels = (of.to(device) for of in (images, speeds, labels))
    random = torch.Generator().manual_seed(SEED)
    network.to(device, memory_format=torch.channels_last)
    # Whole drives, because neighbouring frames look alike.
    all_drives = torch.randperm(int(drives.max()) + 1, generator=random)
    held_out = torch.isin(drives, all_drives[:max(len(all_drives) // 20, 1)])
    batch = 64
    steps = int((~held_out).sum()) // batch
    if steps == 0:
        raise SystemExit(f"{len(images)} images are too few to train on: record more roads, or set images_every lower")
    optimiser = torch.optim.Adam(network.parameters(), 1e-3)
    highest = 5e-4 if name == "transformer" else 2e-3
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, highest, epochs * steps)
    weights = torch.tensor(network.costs, device=device)

    def error(predicted, wanted):
        return (functional.smooth_l1_loss(predicted, wanted, beta=network.beta, reduction="none") * weights).mean()

    def batches():
        """Places of samples: single ones, or windows if the network has a memory."""
        if remembers:
            rows = windows(drives, ~held_out, random)
            return rows[torch.randperm(len(rows), generator=random)].flatten().split(batch)
        places = torch.nonzero(~held_out)[:, 0]
        return places[torch.randperm(len(places), generator=random)].split(batch)

    def with_real(image, speed, control):
        """A batch with eight real images of the first four fifths. No one recorded their speed: it may be any."""
        places = torch.randint(0, len(real[0]) * 4 // 5, (8,), generator=random)
        return (torch.cat([image, real[0][places].float().to(device)]),
                torch.cat([speed, torch.rand(8, 1, generator=random).to(device) * 16]),
                torch.cat([control, real[1][places].to(device)]))

    def errors(images, speeds, wanted):
        """Mean error of each number; the samples are windows if the network has a memory."""
        with torch.no_grad():
            predicted = [network.in_windows(i.float(), s) for i, s in zip(images.split(256), speeds.split(256))]
        return (torch.cat(predicted) - wanted).abs().mean(0)

    def said(mean):
        if plans:
            return f"mean error of waypoints {mean[0::2].mean():.3f} m to the right, {mean[1::2].mean():.3f} m ahead"
        return f"mean error of steering {mean[0]:.4f}, of throttle {mean[1]:.4f}"

    remembers = isinstance(network, networks.Dave2Temporal)
    test = windows(drives, held_out, random).flatten() if remembers else torch.nonzero(held_out)[:, 0]
    for epoch in range(epochs):
        network.train()
        total, count = torch.zeros((), device=device), 0
        for chosen in batches():
            if count == steps:
                break
            chosen = chosen.to(device)
            image, speed, wanted = images[chosen].float(), speeds[chosen], labels[chosen].clone()
            # A mirrored world drives on the other side: the network would not learn to keep right. So no mirroring.
            if name == "dave2_augmented":
                image = augmented(image, random)
            if real:
                image, speed, wanted = with_real(image, speed, wanted)
            # Half the digits: several times faster on processors that can, and enough to learn by.
            with torch.autocast(device, torch.bfloat16):
                predicted = network.in_windows(image.contiguous(memory_format=torch.channels_last), speed)
            loss = error(predicted.float(), wanted)
            optimiser.zero_grad()
            loss.backward()
            if name == "transformer":
                torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
            optimiser.step()
            schedule.step()
            total += loss.detach()
            count += 1
        network.eval()
        mean = errors(images[test], speeds[test], labels[test])
        print(f"{name}, epoch {epoch + 1}: loss {total / count:.5f}, held out: {said(mean)}", flush=True)
    if real:
        last = len(real[0]) * 4 // 5
        mean = errors(real[0][last:].to(device), torch.full((len(real[0]) - last, 1), 8.0, device=device), real[1][last:].to(device))
        print(f"real images held out: {said(mean)}")
    return network.cpu().to(memory_format=torch.contiguous_format)


def export(network, path):
    torch.onnx.export(
        network.eval(), tuple(torch.zeros(shape) for shape in network.inputs.values()), path,
        input_names=list(network.inputs), output_names=network.outputs, opset_version=17, dynamo=False,
    )
    print(f"{path}: {path.stat().st_size / 1e6:.2f} MB", flush=True)


def joined(parts):
    """Samples of several records, each of which counts its drives from 0."""
    for before, part in zip(parts, parts[1:]):
        part[3] += before[3].max() + 1
    return [torch.cat(tensors) for tensors in zip(*parts)]


def make(name, data, perturbed, arguments):
    """Trains one of the networks and writes it."""
    torch.manual_seed(SEED)
    # One thread adds in the same order every time; and it is hardly slower than two, for images this small.
    torch.set_num_threads(1)
    kind, epochs = NETWORKS[name]
    data = joined([[of.clone() for of in part] for part in (data, perturbed)]) if name == "dave2_hardened" else data
    real = records.tub(arguments.tub) if name == "dave2_tub" else None
    network = train(name, kind(), data, arguments.epochs or epochs, arguments.device, real)
    export(network, arguments.out / f"{name}.onnx")


def main():
    parser = argparse.ArgumentParser(description="Trains driving networks on records of the embedded simulator.")
    parser.add_argument("record", type=pathlib.Path, nargs="+")
    parser.add_argument("--out", type=pathlib.Path, required=True, help="the folder for the networks")
    parser.add_argument("--epochs", type=int, help="how often each image is seen; each network has a number of its own")
    parser.add_argument("--device", default="cpu", help="what trains: cpu or cuda, which trains all networks at once")
    parser.add_argument("--tub", type=pathlib.Path, help="a recording of a DonkeyCar, for dave2_tub")
    parser.add_argument("--perturbed", type=pathlib.Path, nargs="*", help="records through perturbations, for dave2_hardened")
    parser.add_argument("--only", choices=NETWORKS, nargs="+")
    arguments = parser.parse_args()
    chosen = arguments.only or list(NETWORKS)
    for name, option in NEEDS.items():
        if name in chosen and not getattr(arguments, option):
            if arguments.only:
                raise SystemExit(f"{name} needs --{option}: see --help")
            print(f"{name} is left out, because it needs --{option}")
            chosen.remove(name)
    data = joined([records.samples(folder) for folder in arguments.record])
    perturbed = joined([records.samples(folder, "/perturbed") for folder in arguments.perturbed]) if "dave2_hardened" in chosen else None
    print(f"{len(data[0])} images{f' and {len(perturbed[0])} through perturbations' if perturbed else ''}; deviation of steering "
          f"{data[2][:, 0].std():.3f}, of throttle {data[2][:, 1].std():.3f}", flush=True)
    arguments.out.mkdir(parents=True, exist_ok=True)
    if arguments.device == "cpu":
        for name in chosen:
            make(name, data, perturbed, arguments)
        return
    processes = [multiprocessing.Process(target=make, args=(name, data, perturbed, arguments)) for name in chosen]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    if any(process.exitcode for process in processes):
        raise SystemExit("a network could not be trained; see above")


if __name__ == "__main__":
    main()
