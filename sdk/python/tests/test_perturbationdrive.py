"""Scripts of PerturbationDrive run with another import."""

import numpy
import pytest

import pdk_perturb as pdk
from pdk_perturb import perturbationdrive

#: The two scripts of the published documentation, with `pdk_perturb.` before `perturbationdrive`, and Pillow where they read with OpenCV.
SCRIPT = """
from pdk_perturb.perturbationdrive import ImagePerturbation, gaussian_noise, fog_filter

perturbed = gaussian_noise(3, image.copy())
save("gaussian", perturbed)

perturbation_names = ["gaussian_noise", "snow_filter"]
controller = ImagePerturbation(funcs=perturbation_names)
for p in perturbation_names:
    out = controller.perturbation(image.copy(), p, intensity=2)
    save(p, out)
"""


def test_the_published_scripts_run(image):
    saved = {}
    exec(SCRIPT, {"image": image, "save": saved.__setitem__})
    assert numpy.array_equal(saved["gaussian"], pdk.perturb(image, "gaussian_noise@3"))
    assert numpy.array_equal(saved["snow_filter"], pdk.perturb(image, "snow_filter@2"))


def test_every_perturbation_is_a_function(image):
    for name in ["poisson_noise", "dynamic_snow_filter", "object_overlay", "imagenet_c_fog"]:
        function = getattr(perturbationdrive, name)
        assert name in dir(perturbationdrive) and function.__name__ == name
        assert numpy.array_equal(function(1, image), function(image, 1))
    with pytest.raises(AttributeError, match="there is no perturbation"):
        perturbationdrive.power_equalisation


def test_what_moves_moves_from_call_to_call(image):
    controller = perturbationdrive.ImagePerturbation(funcs=["dynamic_rain_filter", "splatter_mapping"], image_size=(97, 131))
    first, second = (controller.perturbation(image, "dynamic_rain_filter", 3) for _ in range(2))
    assert not numpy.array_equal(first, second)
    first, second = (controller.perturbation(image, "splatter_mapping", 3) for _ in range(2))
    assert numpy.array_equal(first, second)
    assert numpy.array_equal(controller.perturbation(image, "", 0), image)


def test_another_intensity_does_not_begin_again(image):
    controller = perturbationdrive.ImagePerturbation(seed=3)
    levels = [1, 3, 3, 1.5, *(number / 10 for number in range(20)), 3]
    for number, level in enumerate(levels):
        out = controller.perturbation(image, "dynamic_rain_filter", level)
        expected = pdk.Perturbation("dynamic_rain_filter", level=level, seed=3)(image, frame=number)
        assert numpy.array_equal(out, expected), number
        # Others have calls of their own.
        assert number or numpy.array_equal(
            controller.perturbation(image, "dynamic_snow_filter", 2), pdk.Perturbation("dynamic_snow_filter@2", seed=3)(image)
        )
    assert list(controller._kept) == ["dynamic_snow_filter", "dynamic_rain_filter"]


def test_late_frames_are_those_of_the_drive_whatever_the_intensity(image):
    frames = [numpy.roll(image, shift, axis=1) for shift in range(12)]
    steady = {level: list(map(pdk.Perturbation("delayed_frames", level=level), frames)) for level in (1, 4)}
    controller = perturbationdrive.ImagePerturbation(funcs=["delayed_frames"])
    for number, frame in enumerate(frames):
        level = 1 if number % 3 else 4
        assert numpy.array_equal(controller.perturbation(frame, "delayed_frames", level), steady[level][number]), number
        # Many others in between do not drop what it remembers.
        for other in pdk.names(default=True)[number : number + 9]:
            controller.perturbation(image, other, 1)


def test_functions_of_ones_own_are_called(image):
    def invert(intensity, image):
        return 255 - image

    controller = perturbationdrive.ImagePerturbation(funcs=[invert, "contrast"])
    assert controller.funcs == ["invert", "contrast"]
    assert numpy.array_equal(controller.perturbation(image, "invert", 1), 255 - image)


def test_mistakes_are_said(image):
    with pytest.raises(pdk.Error, match="ONNX"):
        perturbationdrive.ImagePerturbation(attention_map={"map": "grad_cam"})
    controller = perturbationdrive.ImagePerturbation(funcs=["contrast"])
    with pytest.raises(pdk.Error, match="there is no perturbation"):
        controller.perturbation(image, "contrst", 1)
    with pytest.raises(pdk.Error, match="from 0 to 4"):
        controller.perturbation(image, "contrast", 5)
