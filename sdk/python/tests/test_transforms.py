"""Transforms: draws by seed, epoch and sample alone. What needs torch, torchvision or albumentations is skipped without them."""

import copy
import hashlib
import pickle

import numpy
import pytest

import pdk_perturb as pdk
from pdk_perturb.transforms import Indexed, OneOf, Transform

NOISE = OneOf("fog_filter", "gaussian_noise", "motion_blur", None)


def test_draws_follow_from_seed_epoch_and_sample(image):
    def draw(seed=1, epoch=0, sample=5):
        transform = Transform(NOISE, level=(0, 4), seed=seed)
        transform.set_epoch(epoch)
        return transform(image, sample=sample)

    assert numpy.array_equal(draw(), draw())
    others = [draw(seed=2), draw(epoch=1), draw(sample=6), draw(sample=7), draw(sample=8)]
    assert sum(numpy.array_equal(draw(), other) for other in others) <= 2


def test_two_transforms_one_behind_the_other_draw_independently(image):
    small = image[:8, :8].copy()
    first, second = Transform("contrast@4,factor=0", p=0.5), Transform("rotate_image@4", p=0.5)
    both = [0, 0, 0, 0]
    for sample in range(2000):
        one, other = (not numpy.array_equal(each(small, sample=sample), small) for each in (first, second))
        both[2 * one + other] += 1
    assert all(420 < count < 580 for count in both), both
    # Of the same perturbation, those with other seeds.
    noise = [Transform("gaussian_noise@2", seed=seed)(small, sample=0) for seed in (0, 0, 1)]
    assert numpy.array_equal(noise[0], noise[1]) and not numpy.array_equal(noise[0], noise[2])


def test_alternatives_and_levels_are_drawn_evenly(image):
    small = image[:8, :8].copy()
    transform = Transform(OneOf("contrast@4,factor=0", "rotate_image@4", weights=[3, 1]), p=0.5, seed=4)
    grey = rotated = 0
    for sample in range(2000):
        out = transform(small, sample=sample)
        grey += bool((numpy.abs(out.astype(int) - 127) <= 1).all())
        rotated += bool(numpy.array_equal(out, pdk.perturb(small, "rotate_image@4")))
    assert 680 < grey < 820 and 200 < rotated < 300
    levels = []
    transform = Transform("increase_brightness", level=(1, 3), seed=4)
    bright = {level: pdk.perturb(small, "increase_brightness", level=level).mean() for level in (1, 3)}
    for sample in range(200):
        levels.append(transform(small, sample=sample).mean())
    assert min(levels) >= bright[1] and max(levels) <= bright[3] and numpy.std(levels) > 0.2 * (bright[3] - bright[1])


def test_without_a_sample_the_image_itself_counts(image):
    transform = Transform("gaussian_noise@2", seed=1)
    assert numpy.array_equal(transform(image), transform(image.copy()))
    assert not numpy.array_equal(transform(image), transform(image, sample=1))
    assert pdk.identity(image) != pdk.identity(image[:, ::-1]) != pdk.identity(image.reshape(-1, 97, 3))


def test_it_is_called_as_transforms_of_albumentations_are(image):
    transform = Transform("contrast@2")
    mask = numpy.zeros(image.shape[:2])
    done = transform(image=image, mask=mask)
    assert numpy.array_equal(done["image"], pdk.perturb(image, "contrast@2")) and numpy.array_equal(done["mask"], mask)
    with pytest.raises(TypeError, match="there is no image"):
        transform(mask=mask)
    with pytest.raises(TypeError, match="one image"):
        transform(image, mask)


def test_mistakes_are_said_when_it_is_made():
    for wrong in ["contrst@2", "contrast@7"]:
        with pytest.raises(pdk.Error):
            Transform(wrong)(numpy.zeros((8, 8, 3), numpy.uint8))
    for level in [(0, 9), (-1, 2), -1, (2, float("nan")), (float("nan"), 2), float("inf")]:
        with pytest.raises(pdk.Error, match="from 0 to 4|finite"):
            Transform(OneOf(None, "contrast@2"), level=level)
    for level in [(), (1, 2, 3), (3, 1), "2", (1, "2"), {"frames": 2}]:
        with pytest.raises(ValueError, match="lowest and the highest"):
            Transform("contrast@2", level=level)
    with pytest.raises(ValueError, match="from 0 to 1"):
        Transform("contrast@2", p=2)
    with pytest.raises(ValueError, match="weights"):
        OneOf("contrast", weights=[0])


def test_pictures_come_back_as_they_came(image):
    from PIL import Image

    expected = pdk.perturb(image, "contrast@2")
    picture = Transform("contrast@2")(Image.fromarray(image))
    assert isinstance(picture, Image.Image) and numpy.array_equal(numpy.asarray(picture), expected)


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA"])
def test_pictures_keep_their_mode_perturbed_or_not(image, mode):
    from PIL import Image

    picture = Image.fromarray(image).convert(mode)
    if "A" in mode:
        picture.putalpha(Image.fromarray(numpy.arange(131 * 97, dtype=numpy.uint8).reshape(97, 131)))
    expected = Image.fromarray(pdk.perturb(numpy.asarray(picture.convert("RGB")), "contrast@4")).convert(mode.removesuffix("A"))
    transform = Transform("contrast@4", p=0.5, seed=1)
    changed = 0
    for sample in range(20):
        out = transform(picture, sample=sample)
        assert (out.mode, out.size) == (mode, picture.size)
        if out.tobytes() != picture.tobytes():
            changed += 1
            assert numpy.array_equal(numpy.asarray(out.convert(expected.mode)), numpy.asarray(expected))
        if "A" in mode:
            assert out.getchannel("A").tobytes() == picture.getchannel("A").tobytes()
    assert 3 < changed < 17


def test_pictures_that_have_no_colours_of_their_own_are_refused(image):
    from PIL import Image

    for mode in ("P", "1", "CMYK", "I", "F"):
        with pytest.raises(ValueError, match=f"of mode {mode} cannot be perturbed.*convert"):
            Transform("contrast@2", p=0)(Image.fromarray(image).convert(mode))


def test_tensors_come_back_as_they_came(image):
    torch = pytest.importorskip("torch")
    expected = pdk.perturb(image, "contrast@2")
    whole = torch.from_numpy(image).permute(2, 0, 1)
    out = Transform("contrast@2")(whole)
    assert out.dtype == torch.uint8 and numpy.array_equal(out.permute(1, 2, 0).numpy(), expected)
    out = Transform("contrast@2")(whole.float() / 255)
    assert out.dtype == torch.float32 and numpy.array_equal((out * 255).round().byte().permute(1, 2, 0).numpy(), expected)


def test_tensors_that_are_not_images_are_refused(image):
    torch = pytest.importorskip("torch")
    whole = torch.from_numpy(image).permute(2, 0, 1)
    share = whole.double() / 255
    for wrong in (whole.long(), whole > 9):
        with pytest.raises(ValueError, match=f"a tensor of {wrong.dtype} is not an image; give one of torch.uint8"):
            Transform("contrast@2")(wrong)
    for wrong in (whole.float(), share - 0.5, share * float("nan"), share.where(share < 0.9, float("inf"))):
        with pytest.raises(ValueError, match="divide it by 255"):
            Transform("contrast@2")(wrong)
    assert Transform("contrast@2")(share).dtype == torch.float64


def test_it_stands_in_a_pipeline_of_albumentations(image):
    albumentations = pytest.importorskip("albumentations")
    transform = Transform("contrast@2")
    step = albumentations.Lambda(image=lambda image, **_: transform(image), p=1)
    done = albumentations.Compose([step])(image=image)
    assert numpy.array_equal(done["image"], pdk.perturb(image, "contrast@2"))


class Frames:
    """A dataset of 12 pictures, each with its place and the hash of what became of it."""

    classes = ("left", "right")

    def __init__(self, transform):
        self.transform = transform

    def __len__(self):
        return 12

    def __getitem__(self, index):
        if index >= len(self):
            raise IndexError(index)
        picture = numpy.full((24, 32, 3), 100 + index // 2, numpy.uint8)
        out = self.transform(picture)
        return index, hashlib.sha256(out.tobytes()).hexdigest()


def test_an_indexed_dataset_is_that_dataset(image):
    dataset = Indexed(Frames(Transform(NOISE, level=(0, 4), seed=1)))
    assert len(dataset) == 12 and dataset.classes == ("left", "right") and [index for index, _ in dataset] == list(range(12))
    # Two samples that look the same have draws of their own.
    hashes = [hash for _, hash in dataset]
    assert len(set(hashes)) > 6
    dataset.set_epoch(1)
    assert [hash for _, hash in dataset] != hashes


def test_copies_draw_the_same_and_have_epochs_of_their_own(image):
    dataset = Indexed(Frames(Transform(NOISE, level=(0, 4), seed=1)))
    dataset.set_epoch(2)
    expected = list(dataset)
    for copied in (copy.deepcopy(dataset), pickle.loads(pickle.dumps(dataset))):
        assert list(copied) == expected
        copied.set_epoch(3)
        assert list(copied) != expected and list(dataset) == expected


@pytest.mark.parametrize("indexed", [True, False])
def test_workers_do_not_change_the_draws(indexed):
    torch = pytest.importorskip("torch")
    from torch.utils.data import DataLoader

    def epochs(workers, persistent=False, context=None):
        transform = Transform(NOISE, level=(0, 4), seed=1)
        dataset = Indexed(Frames(transform)) if indexed else Frames(transform)
        loader = DataLoader(
            dataset,
            batch_size=3,
            num_workers=workers,
            shuffle=True,
            generator=torch.Generator().manual_seed(workers),
            persistent_workers=persistent,
            multiprocessing_context=context,
        )
        found = []
        for epoch in range(3):
            (dataset if indexed else transform).set_epoch(epoch)
            drawn = {}
            for indices, hashes in loader:
                drawn.update(zip(indices.tolist(), hashes))
            assert len(drawn) == 12
            found.append(drawn)
        return found

    expected = epochs(0)
    assert expected[0] != expected[1] != expected[2]
    for workers in (1, 4):
        for persistent in (False, True):
            assert epochs(workers, persistent) == expected, (workers, persistent)
    assert epochs(2, True, "spawn") == expected
