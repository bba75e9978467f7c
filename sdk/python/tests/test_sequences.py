"""Sequences: frames one after the other, at one place or on the way to another process."""

import pickle

import numpy
import pytest

import pdk_perturb as pdk


def test_a_sequence_is_its_frames_one_after_the_other(image):
    sequence = pdk.Perturbation(["dynamic_rain_filter@3", "gaussian_noise@1"], seed=7, fps=10)
    assert (sequence.seed, sequence.fps, sequence.frame) == (7, 10.0, 0)
    assert sequence.perturbations == ["dynamic_rain_filter@3", "gaussian_noise@1"]
    frames = [sequence(image) for _ in range(4)]
    assert sequence.frame == 4
    for number, frame in enumerate(frames):
        alone = pdk.perturb(image, sequence.perturbations, seed=7, frame=number, time=number / 10)
        assert numpy.array_equal(frame, alone), number
    # Any frame again, on its own.
    assert numpy.array_equal(sequence(image, frame=2), frames[2]) and sequence.frame == 3
    assert not numpy.array_equal(sequence(image, frame=2, time=5.0), frames[2])
    sequence.reset()
    assert numpy.array_equal(sequence(image), frames[0])
    sequence.reset(seed=8)
    assert not numpy.array_equal(sequence(image), frames[0])


def test_what_is_drawn_once_stays_for_the_sequence(image):
    black = numpy.zeros_like(image) + 200
    sequence = pdk.Perturbation("splatter_mapping@3", seed=1)
    first = sequence(black)
    assert numpy.array_equal(first, sequence(black))
    sequence.reset(seed=2)
    assert not numpy.array_equal(first, sequence(black))


def test_a_sequence_goes_on_in_another_process(image):
    sequence = pdk.Perturbation("gaussian_noise@2", seed=3, fps=15)
    sequence(image)
    twin = pickle.loads(pickle.dumps(sequence))
    assert repr(twin) == repr(sequence) and twin.frame == 1
    assert numpy.array_equal(twin(image), sequence(image))


def test_a_sequence_that_shows_earlier_frames_begins_in_one_process(image):
    sequence = pdk.Perturbation("reordered_frames@4", seed=3)
    twin = pickle.loads(pickle.dumps(sequence))
    frames = [numpy.roll(image, shift, axis=1) for shift in range(9)]
    shown = [sequence(frame) for frame in frames]
    assert all(any(numpy.array_equal(one, frame) for frame in frames[: at + 1]) for at, one in enumerate(shown))
    assert not all(map(numpy.array_equal, shown, frames))
    assert all(map(numpy.array_equal, shown, map(twin, frames)))
    with pytest.raises(pdk.Error, match="shows earlier frames"):
        pickle.dumps(sequence)
    sequence.reset()
    assert pickle.loads(pickle.dumps(sequence)).frame == 0


def test_a_sequence_knows_labels_and_distances(image):
    height, width = image.shape[:2]
    labels = numpy.zeros((height, width), numpy.uint8)
    labels[height // 2 :] = 1
    blacken = "increase_brightness@4,factor=0"
    painted = pdk.Perturbation(blacken, where={"label": "road"})(image, labels=(["sky", "road"], labels))
    assert numpy.array_equal(painted[: height // 2], image[: height // 2]) and not painted[height // 2 :].any()
    distances = numpy.linspace(0, 100, width)[None].repeat(height, 0)
    far = pdk.perturb(image, blacken, where={"farther": 50}, distances=distances)
    assert numpy.array_equal(far[:, : width // 2], image[:, : width // 2]) and not far[:, width // 2 + 1 :].any()
    with pytest.raises(pdk.Error, match="`distances` has to be an array of 97 x 131"):
        pdk.perturb(image, blacken, where={"farther": 50}, distances=distances[:5])
    with pytest.raises(pdk.Error, match="come without"):
        pdk.perturb(image, blacken, where={"label": "road"})


def test_an_error_leaves_the_sequence_usable(image):
    sequence = pdk.Perturbation("contrast@2,where={\"label\":[\"road\"]}")
    with pytest.raises(pdk.Error, match="perturbation `contrast"):
        sequence(image)
    labels = numpy.zeros(image.shape[:2], numpy.uint8)
    assert numpy.array_equal(sequence(image, labels=(["road"], labels)), pdk.perturb(image, "contrast@2"))


def test_the_same_frame_again_is_masked_by_the_labels_of_the_call(image):
    sequence = pdk.Perturbation("increase_brightness@4,factor=0", where={"label": "road"})
    for shown in (0, 1, 0):
        labels = numpy.full(image.shape[:2], shown, numpy.uint8)
        painted = sequence(image, frame=7, labels=(["sky", "road"], labels))
        assert numpy.array_equal(painted, image * (1 - shown)), shown


def test_a_refused_call_leaves_a_sequence_as_it_was(image):
    frames = [numpy.roll(image, shift, axis=1) for shift in range(6)]
    expected = list(map(pdk.Perturbation("delayed_frames@4"), frames))
    assert not numpy.array_equal(expected[-1], pdk.Perturbation("delayed_frames@4")(frames[-1], frame=5))
    sequence = pdk.Perturbation("delayed_frames@4")
    for frame, shown in zip(frames, expected):
        for wrong in ({"time": float("nan")}, {"out": image[:5]}, {"level": 7}):
            with pytest.raises(pdk.Error, match="`time` is|`out` has to be|from 0 to 4"):
                sequence(frame, **wrong)
        assert numpy.array_equal(sequence(frame), shown)


def test_a_sequence_that_failed_in_its_middle_cannot_be_copied_either(image):
    sequence = pdk.Perturbation('delayed_frames@4,where={"label":"road"}')
    labels = (["road"], numpy.zeros(image.shape[:2], numpy.uint8))
    sequence(image, labels=labels)
    with pytest.raises(pdk.Error, match="come without"):
        sequence(image)
    with pytest.raises(pdk.Error, match="shows earlier frames"):
        pickle.dumps(sequence)


def test_the_level_of_one_frame_leaves_the_sequence_as_it_is(image):
    frames = [numpy.roll(image, shift, axis=1) for shift in range(12)]
    assert pdk.Perturbation("contrast@2").history == 0 < pdk.Perturbation("delayed_frames@2").history
    steady = {level: list(map(pdk.Perturbation("delayed_frames", level=level), frames)) for level in (1, 4)}
    assert not numpy.array_equal(steady[1][-1], steady[4][-1])
    sequence = pdk.Perturbation("delayed_frames@4")
    for number, frame in enumerate(frames):
        level = 1 if number % 2 else 4
        shown = sequence(frame, level=level) if level == 1 else sequence(frame)
        assert numpy.array_equal(shown, steady[level][number]), number
    assert sequence.perturbations == ["delayed_frames@4"]


class Numbered(pdk.Perturbation):
    """A sequence with a number."""


def test_a_class_made_from_a_sequence_stays_itself_in_another_process(image):
    sequence = Numbered("gaussian_noise@2", seed=3)
    sequence.number = 5
    sequence(image)
    twin = pickle.loads(pickle.dumps(sequence))
    assert type(twin) is Numbered and (twin.number, twin.frame, twin.seed) == (5, 1, 3)
    assert numpy.array_equal(twin(image), sequence(image))
