"""Arrays in, the bytes of the command line out."""

import inspect
import os
import pickle
import subprocess
import sys
import threading
import time

import numpy
import pytest

import pdk_perturb as pdk
from pdk_perturb import perturbations

#: What needs a file of the user's.
WITH_FILES = {"overlay", "repaint"}
#: The first example of each perturbation that has one.
EXAMPLES = {
    entry["description"]["name"]: entry["description"]["examples"][0]
    for entry in pdk.catalog()
    if entry["description"].get("examples")
}
#: What changes frames, and not controls or what a driver gets besides.
OF_FRAMES = [
    entry["description"]["name"] for entry in pdk.catalog() if entry["description"].get("acts_on", "frames") == "frames"
]


@pytest.mark.parametrize("name", [name for name in OF_FRAMES if name not in WITH_FILES])
def test_every_perturbation_has_the_bytes_of_the_command_line(name, image, command):
    # What some need, such as a network.
    needs = EXAMPLES.get(name, {})
    expected = command(*pdk.written(name, level=2.5, **needs), seed=7)
    assert numpy.array_equal(pdk.perturb(image, f"{name}@2.5", seed=7, **needs), expected)
    # Again by the chain that was kept, after another seed and another level.
    pdk.perturb(image, f"{name}@1", seed=3, **needs)
    assert numpy.array_equal(pdk.perturb(image, f"{name}@2.5", seed=7, **needs), expected)


@pytest.mark.parametrize(
    "chain",
    [
        ["fog_filter@1", "gaussian_noise@3"],
        ["gaussian_noise@2", "gaussian_noise@2"],
        ['contrast@3,region={"box":[0,0.5,1,1]}'],
        ["impulse_noise@4,probability=0.5"],
        ['fog_filter,level={"ramp":{"from":0,"to":4,"end":10}}'],
        ['gaussian_blur@4,where={"random":20}'],
        ["gaussian_noise@2,draws=per_sequence", "translate_image@3,variant=corrected"],
        ["rotate_image@2.5,degrees=[2,5,10,20,45]"],
    ],
)
def test_chains_and_modifiers_are_those_of_the_command_line(chain, image, command):
    expected = command(*chain, seed=11)
    assert numpy.array_equal(pdk.perturb(image, chain, seed=11), expected)


def test_a_perturbation_can_be_written_in_several_ways(image):
    expected = pdk.perturb(image, 'fog_mapping@2,strength=0.3,region={"box":[0,0,1,0.5]}', seed=1)
    box = {"box": [0, 0, 1, 0.5]}
    for written, given in [
        ({"name": "fog_mapping", "level": 2, "strength": 0.3, "region": box}, {}),
        ("fog_mapping", {"level": 2, "strength": numpy.float64(0.3), "region": {"box": (0, 0, 1, 0.5)}}),
        (perturbations.fog_mapping(2, strength=0.3, region=box), {}),
        ([perturbations.fog_mapping(strength=0.3, region=box)], {}),
        (['fog_mapping@4,strength=0.3,region={"box":[0,0,1,0.5]}'], {"level": 2}),
    ]:
        assert numpy.array_equal(pdk.perturb(image, written, seed=1, **given), expected), written
    assert pdk.written("fog_mapping", level=2, strength=0.3) == ["fog_mapping@2,strength=0.3"]


def test_frame_and_time_are_those_of_the_command_line(tmp_path, image, command):
    from PIL import Image

    source, out = tmp_path / "image.png", tmp_path / "out.png"
    Image.fromarray(image).save(source)
    line = [pdk.executable(), "perturb", source, "--with", "dynamic_rain_filter@3", "--frame", "30", "--time", "1.5", "-o", out]
    subprocess.run(line, check=True)
    found = pdk.perturb(image, "dynamic_rain_filter@3", frame=30, time=1.5)
    assert numpy.array_equal(found, numpy.asarray(Image.open(out)))


def test_images_are_read_in_place_or_copied_and_never_written_to(image):
    before = image.copy()
    expected = pdk.perturb(image, "gaussian_blur@3")
    large = numpy.zeros((200, 300, 3), numpy.uint8)
    window = large[50 : 50 + image.shape[0], 70 : 70 + image.shape[1]]
    window[:] = image
    for view in [window, image[::-1][::-1], numpy.asfortranarray(image), image.transpose(2, 0, 1).copy().transpose(1, 2, 0)]:
        assert numpy.array_equal(pdk.perturb(view, "gaussian_blur@3"), expected)
    image.flags.writeable = False
    try:
        assert numpy.array_equal(pdk.perturb(image, "gaussian_blur@3"), expected)
    finally:
        image.flags.writeable = True
    assert numpy.array_equal(image, before)


def test_out_is_written_to_where_it_fits(image):
    out = numpy.empty_like(image)
    assert pdk.perturb(image, "contrast@2", out=out) is out
    assert numpy.array_equal(out, pdk.perturb(image, "contrast@2"))
    for wrong in [image, out[:10], out[:, ::-1], out.astype(float), [1, 2]]:
        with pytest.raises(pdk.Error, match="`out` has to be|being written to"):
            pdk.perturb(image, "contrast@2", out=wrong)


def test_the_images_of_a_batch_have_seeds_of_their_own(image):
    batch = numpy.stack([image, image[::-1], image[:, ::-1], image])
    single = [pdk.perturb(each, "gaussian_noise@2", seed=5 + number) for number, each in enumerate(batch)]
    for threads in [1, 2, 8]:
        assert numpy.array_equal(pdk.perturb(batch, "gaussian_noise@2", seed=5, threads=threads), numpy.stack(single))
    chosen = pdk.perturb(batch, "gaussian_noise@2", seed=[8, 5, 5, 5])
    assert numpy.array_equal(chosen[0], single[3]) and not numpy.array_equal(chosen[3], single[3])
    out = numpy.empty_like(batch)
    assert pdk.perturb(batch, "gaussian_noise@2", seed=5, out=out) is out and numpy.array_equal(out, numpy.stack(single))
    assert pdk.perturb(batch[:0], "gaussian_noise@2").shape == (0, *image.shape)
    with pytest.raises(pdk.Error, match="2 seeds for 4 images"):
        pdk.perturb(batch, "gaussian_noise@2", seed=[1, 2])


@pytest.mark.parametrize(
    ("value", "says"),
    [
        (numpy.zeros((9, 9)), "dtype float64"),
        (numpy.zeros((9, 9), numpy.uint8), "numpy.repeat"),
        (numpy.zeros((9, 9, 4), numpy.uint8), "leave its fourth channel out"),
        (numpy.zeros((3, 9, 9), numpy.uint8), "transpose"),
        (numpy.zeros((9, 0, 3), numpy.uint8), "0 bytes|RGB frame"),
        (numpy.zeros((2, 9, 0, 3), numpy.uint8), "2 x 9 x 0 x 3"),
        (numpy.zeros((2, 9, 9, 4), numpy.uint8), "2 x 9 x 9 x 4"),
        ("image.png", "a str: make one with numpy.asarray"),
    ],
)
def test_what_is_no_image_is_said_with_the_remedy(value, says):
    with pytest.raises(pdk.Error, match=says):
        pdk.perturb(value, "contrast@2")


@pytest.mark.parametrize(
    ("written", "given", "says"),
    [
        ("fog_maping@2", {}, "there is no perturbation `fog_maping`.*fog_mapping"),
        ("fog_mapping@9", {}, "from 0 to 4"),
        ("fog_mapping@2", {"strenght": 1}, "has no parameter `strenght`"),
        ("fog_mapping@2", {"strength": 7.0}, "from 0 to 1"),
        ("fog_mapping@2", {"strength": float("nan")}, "finite"),
        (["contrast", "fog_filter"], {"probability": 0.5}, "could mean any of them"),
        ("fog_mapping@2", {"strength": object()}, "a object cannot be set"),
        (3, {}, "is not a perturbation"),
        ("contrast", {"time": 1e300}, "`time` is"),
    ],
)
def test_mistakes_are_exceptions_with_a_sentence(written, given, says, image):
    with pytest.raises(pdk.Error, match=says) as raised:
        pdk.perturb(image, written, **given)
    assert "\n" not in str(raised.value)
    assert isinstance(raised.value, RuntimeError) and raised.value.kind in ("configuration", "failed")


def test_no_parameter_has_the_name_of_an_argument():
    arguments = {"image", "perturbation", "seed", "frame", "time", "labels", "distances", "out", "threads", "fps"}
    for entry in pdk.catalog():
        assert not arguments & {parameter["name"] for parameter in entry["description"]["parameters"]}


def test_functions_have_the_signatures_of_the_catalog():
    assert "contrast" in dir(perturbations)
    signature = inspect.signature(perturbations.contrast)
    assert list(signature.parameters) == ["level", "factor", *perturbations.MODIFIERS]
    assert "Spreads all values" in perturbations.contrast.__doc__
    assert perturbations.contrast(1, factor=2.0, region=None) == {"name": "contrast", "level": 1, "factor": 2.0}
    with pytest.raises(TypeError, match="has no parameter `factors`"):
        perturbations.contrast(1, factors=2.0)
    with pytest.raises(AttributeError, match="there is no perturbation `contrasts`"):
        perturbations.contrasts
    # The package declares the same for editors.
    declared = (os.path.dirname(pdk.__file__), "perturbations.pyi")
    with open(os.path.join(*declared)) as file:
        text = file.read()
    for entry in pdk.catalog():
        assert f"def {entry['description']['name']}(" in text


def test_other_threads_go_on_meanwhile():
    large = numpy.zeros((1080, 1920, 3), numpy.uint8)
    counted, done = [0], threading.Event()

    def count():
        while not done.is_set():
            counted[0] += 1
            time.sleep(0)

    counter = threading.Thread(target=count)
    counter.start()
    before = counted[0]
    for seed in range(3):
        pdk.perturb(large, "phase_scrambling@4", seed=seed)
    done.set()
    counter.join()
    assert counted[0] - before > 20


def test_threads_get_the_same_bytes(image):
    expected = [pdk.perturb(image, "raindrops_on_lens@2", seed=seed) for seed in range(6)]
    found = [None] * 6

    def work(seed):
        found[seed] = pdk.perturb(image, "raindrops_on_lens@2", seed=seed)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(6)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert all(map(numpy.array_equal, found, expected))


# ---------------------------------------------------------------------------------------------------------------------
# What users bring along

SCRIPT = """
return {
    doc = "Blackens the upper rows",
    parameters = { { name = "rows", levels = { 1, 2, 3, 4, 5 }, doc = "how many" } },
    apply = function(image, cx)
        if cx.rows > 90 then error("too many rows") end
        if cx.rows > 80 then while true do end end
        image:rectangle(0, 0, image.width, cx.rows, 0, 0, 0)
    end,
}
"""


@pytest.fixture
def searched():
    yield
    pdk.search()


def test_scripts_are_found_and_their_errors_are_exceptions(tmp_path, image, searched, command):
    folder = tmp_path / "perturbations"
    folder.mkdir()
    (folder / "blacken.lua").write_text(SCRIPT)
    with pytest.raises(pdk.Error, match="there is no perturbation `blacken`"):
        pdk.perturb(image, "blacken")
    pdk.search(plugins=[folder])
    assert "blacken" in pdk.names()
    found = pdk.perturb(image, perturbations.blacken(3))
    assert numpy.array_equal(found, command("blacken@3", options=["--plugins", folder]))
    assert not found[:4].any() and found[5:].any()
    with pytest.raises(pdk.Error, match="too many rows"):
        pdk.perturb(image, "blacken", rows=91)
    # In another process too.
    sequence = pickle.dumps(pdk.Perturbation("blacken@3"))
    code = "import pickle, sys, numpy, pdk_perturb; f = pickle.load(sys.stdin.buffer); print(f(numpy.full((9, 9, 3), 7, numpy.uint8)).sum())"
    done = subprocess.run([sys.executable, "-c", code], input=sequence, capture_output=True)
    assert int(done.stdout) == 7 * 3 * 9 * 5, done.stderr


def test_a_script_is_ended_in_time_in_a_forked_process_as_well(tmp_path, image, searched, monkeypatch):
    folder = tmp_path / "perturbations"
    folder.mkdir()
    (folder / "blacken.lua").write_text(SCRIPT)
    monkeypatch.setenv("PDK_SCRIPT_SECONDS", "0.3")
    pdk.search(plugins=[folder])
    pdk.perturb(image, "blacken")
    child = os.fork()
    if child == 0:
        try:
            # An instance of before the fork, and a new one.
            for rows in (2, 2, 85):
                try:
                    pdk.perturb(image, "blacken", rows=rows)
                except pdk.Error as error:
                    os._exit(0 if rows == 85 and "0.3 s" in str(error) else 3)
        finally:
            os._exit(4)
    for _ in range(200):
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            break
        time.sleep(0.05)
    else:
        os.kill(child, 9)
        os.waitpid(child, 0)
        pytest.fail("the script was not ended")
    assert os.waitstatus_to_exitcode(status) == 0


def test_clips_are_found_by_folder_and_by_parameter(tmp_path, image, searched, command):
    from PIL import Image

    folder = tmp_path / "clips"
    folder.mkdir()
    frames = []
    for number in range(4):
        frame = numpy.zeros((40, 60, 3), numpy.uint8)
        frame[:] = (0, 255, 0)
        frame[10:20, 10 * number : 10 * number + 10] = (250, 10, 10)
        frames.append(Image.fromarray(frame))
    clip = folder / "square.png"
    frames[0].save(clip, save_all=True, append_images=frames[1:], duration=250)
    by_parameter = pdk.perturb(image, perturbations.overlay(4, clip=clip))
    assert not numpy.array_equal(by_parameter, image)
    assert numpy.array_equal(by_parameter, command(f"overlay@4,clip={clip}"))
    pdk.search(drop_ins=[folder])
    assert numpy.array_equal(pdk.perturb(image, "square@4"), command("square@4", options=["--drop-ins", folder]))


MASK = "return { doc = 'A part', mask = function(image) image:fill(0, 0, 0) image:rectangle(0, 0, image.width, ROWS, 255, 255, 255) end }"


def test_files_that_have_changed_are_read_again(tmp_path, image, searched):
    from PIL import Image

    def replace(name, write):
        # Another file at the same place, so that nothing depends on the clock of the file system.
        write(tmp_path / f"new-{name}")
        os.replace(tmp_path / f"new-{name}", tmp_path / name)

    def region(rows):
        weights = numpy.zeros(image.shape[:2], numpy.uint8)
        weights[:rows] = 255
        replace("region.png", Image.fromarray(weights).save)

    def mask(rows):
        replace("part.lua", lambda path: path.write_text(MASK.replace("ROWS", str(rows))))

    def picture(rows):
        shown = numpy.zeros((*image.shape[:2], 3), numpy.uint8)
        shown[:rows] = 255
        replace("picture.png", Image.fromarray(shown).save)

    def script(color):
        replace("blacken.lua", lambda path: path.write_text(SCRIPT.replace("0, 0, 0)", f"{color}, {color}, {color})")))

    blacken = "increase_brightness@4,factor=0"
    for write, perturbation, given in (
        (region, blacken, {"region": {"mask": str(tmp_path / "region.png")}}),
        (mask, blacken, {"where": {"mask": str(tmp_path / "part.lua")}}),
        (picture, "adversarial_patch@4", {"picture": tmp_path / "picture.png", "on": "frame"}),
    ):
        write(10)
        first = pdk.perturb(image, perturbation, **given)
        assert numpy.array_equal(first, pdk.perturb(image, perturbation, **given))
        write(40)
        second = pdk.perturb(image, perturbation, **given)
        assert not numpy.array_equal(first, second), perturbation
        write(10)
        assert numpy.array_equal(first, pdk.perturb(image, perturbation, **given)), perturbation
    script(7)
    pdk.search(plugins=[tmp_path / "blacken.lua"])
    for color in (7, 9):
        script(color)
        assert (pdk.perturb(image, "blacken")[:3] == color).all()
    os.remove(tmp_path / "region.png")
    with pytest.raises(pdk.Error, match="region.png"):
        pdk.perturb(image, blacken, region={"mask": str(tmp_path / "region.png")})


def test_a_search_during_a_call_leaves_nothing_of_the_search_before(tmp_path, image, searched):
    for color in (10, 20):
        folder = tmp_path / str(color)
        folder.mkdir()
        # It takes its time.
        fill = f"{color}, {color}, {color}) for number = 1, 1e7 do end"
        (folder / "blacken.lua").write_text(SCRIPT.replace("0, 0, 0)", fill))
    batch = numpy.broadcast_to(image, (40, *image.shape))
    pdk.search(plugins=[tmp_path / "10"])
    thread = threading.Thread(target=lambda: pdk.perturb(batch, "blacken@0"))
    thread.start()
    time.sleep(0.2)
    pdk.search(plugins=[tmp_path / "20"])
    thread.join()
    assert (pdk.perturb(image, "blacken@0")[0] == 20).all()


def test_what_cannot_be_used_is_a_warning(tmp_path, image, searched):
    folder = tmp_path / "perturbations"
    folder.mkdir()
    (folder / "broken.lua").write_text("return {")
    with pytest.warns(RuntimeWarning, match="broken.lua"):
        pdk.search(plugins=[folder])
    with pytest.raises(pdk.Error, match="does not exist"):
        pdk.search(plugins=[tmp_path / "nowhere"])
    # The folders of before still count.
    assert "contrast" in pdk.names()


def test_the_command_of_the_package_finds_everything():
    alone = {"PATH": os.environ["PATH"]}
    done = subprocess.run([pdk.executable(), "doctor"], env=alone, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    done = subprocess.run([sys.executable, "-m", "pdk_perturb", "--version"], capture_output=True, text=True)
    assert done.stdout.splitlines()[0] == f"pdk {pdk.__version__}", done.stderr
