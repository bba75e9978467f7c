"""Runs from Python: pipelines, sessions, drivers and simulators that are classes, records."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import numpy
import pytest

import pdk_perturb as pdk
from pdk_perturb import _pdk

PIPELINE = """
local scenarios = {}
for number = 1, 8 do
    table.insert(scenarios, {
        road = { angles = { 0, number, -number }, segment = 20 }, perturbations = { "gaussian_noise@" .. number / 3 },
    })
end
table.insert(scenarios, { perturbations = { { name = "fog_filter", level = function(t) return 2 * t end } } })
pdk.show(pdk.drive({
    simulator = { name = "lane", width = 160, height = 120 }, driver = "lane_keeper", duration = 2, images_every = 10,
    scenarios = scenarios,
}))
"""

SHARED = {
    "simulator": {"name": "lane", "width": 160, "height": 120},
    "driver": "lane_keeper",
    "duration": 2,
    "images_every": 10,
}


def scenarios():
    """Those of the pipeline."""
    for number in range(1, 9):
        yield {
            "road": {"angles": [0, number, -number], "segment": 20},
            "perturbations": [f"gaussian_noise@{number / 3}"],
        }
    yield {"perturbations": [{"name": "fog_filter", "level": lambda t: 2 * t}]}


def ledger(folder):
    """The lines of a record as a set: each is bound to its scenario by a checksum."""
    return set((folder / "scenarios.jsonl").read_text().splitlines())


@pytest.fixture(scope="module")
def pipeline(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pipeline")
    (folder / "study.lua").write_text(PIPELINE)
    record = pdk.run(folder / "study.lua", out=folder / "out", seed=5, workers=2)
    return folder, record


def test_a_session_records_what_the_same_pipeline_in_lua_records(pipeline, tmp_path):
    folder, record = pipeline
    assert len(ledger(folder / "out")) == 9
    for workers, out in ((1, tmp_path / "one"), (2, tmp_path / "two")):
        with pdk.Session(**SHARED, out=out, seed=5, workers=workers) as session:
            outcomes = session.drive(scenarios())
        assert ledger(out) == ledger(folder / "out")
        assert [outcome["digest"] for outcome in outcomes] == [row["digest"] for row in record.summary["outcomes"]]
        for trace in (folder / "out/traces").iterdir():
            assert (out / "traces" / trace.name).read_bytes() == trace.read_bytes()


def test_outcomes_come_as_they_are_done_and_each_once(tmp_path):
    with pdk.Session(**SHARED, out=tmp_path / "out", workers=2) as session:
        assert session.slots == 2
        tickets = [session.submit(scenario, name=f"drive {place}") for place, scenario in enumerate(scenarios())]
        assert tickets == list(range(1, 10)) and session.pending == 9
        first = session.next()
        assert first["name"] == f"drive {first['ticket'] - 1}"
        rest = list(session)
        assert sorted(outcome["ticket"] for outcome in [first, *rest]) == tickets
        assert session.next() is None and session.pending == 0
        with pytest.raises(pdk.Error, match="`driver` is missing|there is no driver `absent`"):
            session.submit(driver="absent")
        with pytest.raises(pdk.Error, match="scenario 0: there is no field `lenght`"):
            session.submit(lenght=3)
        with pytest.raises(pdk.Error, match="finite|compliant"):
            session.submit(duration=float("nan"))
        # What was wrong was not driven, and the session goes on.
        road = session.road(angles=[0, numpy.int64(10), numpy.float32(-10)])
        assert session.drive([{"road": road["road"] if "road" in road else road}])[0]["cause"] == "time_out"
        session.save("notes.json", {"mean": numpy.arange(3)})
        assert any(entry["description"]["name"] == "lane" for entry in session.catalog("simulator"))
        # The script does not wait for this one, and it is driven all the same.
        session.submit(name="last", seed=2**53 - 1)
    assert session.record.lines()[-1]["scenario"]["seed"] == 2**53 - 1
    assert json.loads((tmp_path / "out/notes.json").read_text()) == {"mean": [0, 1, 2]}
    with pytest.raises(pdk.Error, match="the session is over"):
        session.submit()


def test_a_ticket_is_pending_until_its_outcome_is_taken(tmp_path):
    with pdk.Session(**{**SHARED, "duration": 0.1}, out=tmp_path / "out") as session:
        first, second = (session.submit(seed=seed) for seed in (1, 2))
        assert session.pending == 2
        outcome = session.wait(first)
        assert session.pending == 1
        # Again, and one that there is not.
        for ticket in (first, 99, -1, None, "1"):
            try:
                assert session.wait(ticket) == outcome and ticket == first
            except pdk.Error:
                assert ticket != first
            assert session.pending == 1
        assert session.next()["ticket"] == second and session.pending == 0
        assert session.next() is None and session.pending == 0


def test_a_session_goes_on_where_an_earlier_one_ended(tmp_path):
    for _ in range(2):
        progress = []
        with pdk.Session(**SHARED, out=tmp_path / "out", progress=lambda *told: progress.append(told)) as session:
            session.drive(scenarios())
    assert progress[-1][0] == progress[-1][1] > 0
    assert session.record.performance["drive"] is not None
    with pytest.raises(pdk.Error, match="the seed was 0 and is 1"):
        with pdk.Session(**SHARED, out=tmp_path / "out", seed=1) as session:
            session.drive(scenarios())


def test_an_exception_in_a_block_ends_the_session_and_keeps_the_record(tmp_path):
    with pytest.raises(ZeroDivisionError):
        with pdk.Session(**SHARED, out=tmp_path / "out", workers=1) as session:
            session.submit(name="first")
            session.next()
            session.submit(name="long", mode="realtime", duration=600)
            began = time.monotonic()
            raise ZeroDivisionError
    assert time.monotonic() - began < 10
    assert [line["name"] for line in pdk.Record(tmp_path / "out").lines()] == ["first"]


def test_a_run_is_shown_and_fails_with_one_exception(tmp_path, capsys):
    script = tmp_path / "p.lua"
    script.write_text("local s = pdk.settings({ level = 1, names = {} }) print(s.level, #s.names) pdk.table({ 'a' }, { { 'table' } })")
    with pytest.raises(pdk.Error, match="drove no scenario and evaluated no dataset, so there is no record"):
        pdk.run(script, {"level": 2.5, "names": ["x", "y"]})
    shown = capsys.readouterr()
    assert "table" in shown.out and "2.5\t2" in shown.err
    with pytest.raises(pdk.Error, match="there is no `levle`|has no setting `levle`; did you mean `level`"):
        pdk.run(script, {"levle": 1})
    with pytest.raises(pdk.Error, match="no built-in pipeline `quickstrat`.*quickstart") as raised:
        pdk.run("quickstrat")
    assert raised.value.record is None
    script.write_text("pdk.drive({ simulator = 'lane', driver = 'lane_keeper', duration = 1, scenarios = { {} } }) error('no more')")
    with pytest.raises(pdk.Error, match="no more") as raised:
        pdk.run(script, out=tmp_path / "out")
    assert len(pdk.Record(raised.value.record).lines()) == 1


def test_ctrl_c_finishes_what_is_under_way(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent(
            f"""
            import pdk_perturb as pdk
            with pdk.Session(simulator="lane", driver="lane_keeper", mode="realtime", out={str(tmp_path / "out")!r}, workers=1) as session:
                for number in range(20):
                    session.submit(duration=3, repeat=number)
                print(session.next()["name"], flush=True)
                list(session)
            """
        )
    )
    child = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "nominal\n"
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    _, said = child.communicate(timeout=30)
    assert "KeyboardInterrupt" in said and "finishing what is in flight" in said
    assert len(pdk.Record(tmp_path / "out").lines()) == 2


def test_a_killed_interpreter_leaves_no_process_behind(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent(
            f"""
            import pdk_perturb as pdk
            session = pdk.Session(simulator="lane", driver="lane_keeper", mode="realtime", out={str(tmp_path / "out")!r}, workers=2)
            session.submit(duration=600)
            print(session._program._child.pid, flush=True)
            session.next()
            """
        )
    )
    child = subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True)
    other = int(child.stdout.readline())
    time.sleep(0.5)
    child.kill()
    child.wait()
    until = time.monotonic() + 20
    while time.monotonic() < until and os.path.exists(f"/proc/{other}"):
        time.sleep(0.05)
    assert not os.path.exists(f"/proc/{other}")


def test_several_threads_may_share_a_session(tmp_path):
    found = []
    with pdk.Session(**SHARED, out=tmp_path / "out", workers=2) as session:

        def drive(number):
            found.append(session.drive([{"repeat": number}, {"repeat": number + 10}]))

        threads = [threading.Thread(target=drive, args=[number]) for number in range(4)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
    assert sum(map(len, found)) == 8 and len(session.record.lines()) == 8


def test_records_are_read(pipeline):
    folder, record = pipeline
    lines = record.lines()
    assert [line["scenario"]["perturbations"][0]["name"] for line in lines] == ["gaussian_noise"] * 8 + ["fog_filter"]
    steps = record.steps(0)
    assert list(steps["frame"]) == list(range(lines[0]["frames"])) and steps["time"][1] == pytest.approx(0.05)
    assert steps["collision"].dtype == bool and abs(steps["steering"]).max() <= 1
    numbers, frames = record.frames(lines[0]["id"])
    assert frames.dtype == numpy.uint8 and frames.shape == (len(numbers), 120, 160, 3)
    assert list(numbers[:2]) == [0, 10]
    _, raw = record.frames(0, "raw")
    # The noise is in one and not in the other.
    assert numpy.abs(frames.astype(int) - raw).mean() > 1
    assert any("time-out" in text or "time_out" in text or "time" in text for _, text in record.events(0))
    with pytest.raises(pdk.Error, match="several|no scenario"):
        record.trace("nothing of this name")
    with pytest.raises(pdk.Error, match="holds no record"):
        pdk.Record(folder)
    damaged = folder / "damaged"
    damaged.mkdir()
    (damaged / "manifest.json").write_text((folder / "out/manifest.json").read_text())
    text = (folder / "out/scenarios.jsonl").read_text()
    (damaged / "scenarios.jsonl").write_text(text.replace('"success":false', '"success":true ', 1))
    with pytest.raises(pdk.Error, match="is damaged or was edited"):
        pdk.Record(damaged).lines()


def test_a_ledger_is_read_again_only_where_it_has_changed(pipeline, tmp_path, monkeypatch):
    folder, _ = pipeline
    shutil.copytree(folder / "out", tmp_path / "out")
    record = pdk.Record(tmp_path / "out")
    reads = []
    lines = pdk.Record.lines
    monkeypatch.setattr(pdk.Record, "lines", lambda self: reads.append(self) or lines(self))
    first = record.trace(0)
    for number in range(9):
        assert len(record.steps(number)["frame"]) > 0 and record.trace(number - 9) == record.trace(number)
    assert record.trace(first.stem) == first and len(reads) == 1
    ledger = tmp_path / "out/scenarios.jsonl"
    ledger.write_text("".join(reversed(ledger.read_text().splitlines(keepends=True))))
    assert record.trace(8) == first and len(reads) == 2
    ledger.write_text(ledger.read_text().replace('"success":false', '"success":true ', 1))
    with pytest.raises(pdk.Error, match="is damaged or was edited"):
        record.trace(0)


def test_every_cause_has_a_verdict(pipeline):
    pytest.importorskip("pandas")
    _, record = pipeline
    scenarios = record.scenarios()
    assert list(scenarios.verdict) == [_pdk.verdict(cause) for cause in scenarios.cause]
    documents = Path(__file__).parents[3] / "docs/record.md"
    if documents.is_file():
        told = next(line for line in documents.read_text().splitlines() if line.startswith("| `cause` "))
        causes = re.findall("`([a-z_]+)`", told.split("|")[2])
        assert {_pdk.verdict(cause) for cause in causes} == {"passed", "unsafe", "stopped", "late", "void"}
    with pytest.raises(pdk.Error, match="`abducted` is not the cause"):
        _pdk.verdict("abducted")


def test_records_are_frames_of_pandas(pipeline):
    pandas = pytest.importorskip("pandas")
    _, record = pipeline
    table = record.scenarios()
    assert isinstance(table, pandas.DataFrame) and len(table) == 9
    assert list(table.perturbation[:2]) == ["gaussian_noise"] * 2
    assert table.level[2] == 1.0 and numpy.isnan(table.level[8]) and table.perturbations[8] == ["fog_filter over time"]
    assert set(table.verdict) == {"late"} and (table.max_lateral_acceleration >= 0).all()
    telemetry = record.telemetry(3)
    assert len(telemetry) == table.frames[3] and telemetry.time.is_monotonic_increasing


def test_without_pandas_it_is_said_what_is_missing(pipeline, monkeypatch):
    _, record = pipeline
    monkeypatch.setitem(sys.modules, "pandas", None)
    for read in (record.scenarios, record.results, lambda: record.telemetry(0)):
        with pytest.raises(pdk.Error, match="needs pandas; install it with `pip install pandas`"):
            read()
    assert len(record.steps(0)["time"]) > 0


def test_parts_are_put_together(pipeline, tmp_path):
    folder, _ = pipeline
    parts = [tmp_path / f"part{number}" for number in (1, 2)]
    for number, part in enumerate(parts, 1):
        pdk.run(folder / "study.lua", out=part, seed=5, shard=f"{number}/2")
    merged = tmp_path / "merged"
    subprocess.run([pdk.executable(), "merge", *parts, "--out", merged], check=True, stdout=subprocess.DEVNULL)
    assert ledger(merged) == ledger(folder / "out")


PILOT = """
import os
import numpy

class Pilot:
    def __init__(self, gain=1.0, fault=None):
        self.gain, self.fault = gain, fault

    def reset(self):
        self.seen = 0

    def drive(self, frame, context):
        assert self.seen == context.frame_index
        self.seen += 1
        if self.fault == "die" and context.frame_index == 5:
            os._exit(3)
        if self.fault == "raise" and context.frame_index == 5:
            raise RuntimeError("no such layer")
        half = frame.shape[1] // 2
        return self.gain * (float(frame[:, half:].mean()) - float(frame[:, :half].mean())) / 255, 0.3


class Straight:
    '''A straight road that darkens with the distance from its middle.'''

    def __init__(self, camera, drift=0.0, fault=None):
        self.camera, self.drift, self.fault = camera, drift, fault
        assert (camera.width, camera.height, camera.rate) == (64, 48, 10.0)

    def reset(self, scenario, waypoints, slot):
        assert scenario["driver"]["name"]
        self.x, self.z, self.heading = 0.0, 0.0, 0.0
        if self.fault == "reset":
            raise ValueError("no such town")
        return self.state()

    def state(self):
        return {"position": numpy.array([self.x, 0, self.z]), "speed": 8.0, "heading": self.heading}

    def act(self, control):
        self.heading += control.steering * 0.05
        self.x += self.heading * 0.8 + self.drift
        self.z += 0.8
        if self.fault == "act" and self.z > 4:
            os._exit(4)
        return self.state()

    def frame(self, into):
        columns = numpy.arange(self.camera.width) - self.camera.width / 2
        into[:] = (128 - columns * self.x).clip(0, 255).astype(numpy.uint8)[None, :, None]
"""


@pytest.fixture
def classes(tmp_path, monkeypatch):
    pytest.importorskip("iceoryx2")
    (tmp_path / "classes_for_tests.py").write_text(PILOT)
    monkeypatch.syspath_prepend(tmp_path)
    sys.modules.pop("classes_for_tests", None)
    import classes_for_tests

    return classes_for_tests


def test_a_driver_and_a_simulator_are_classes(classes, tmp_path):
    simulator = pdk.simulator(classes.Straight, {"drift": 0.01}, width=64, height=48, rate=10)
    road = {"waypoints": [[0, 0, 0], [0, 0, 40]]}
    digests = []
    for out in (tmp_path / "a", tmp_path / "b"):
        driver = pdk.driver(classes.Pilot, {"gain": 2})
        with pdk.Session(simulator=simulator, driver=driver, duration=10, out=out, workers=2) as session:
            outcomes = session.drive([{"road": road}, {"road": road, "perturbations": ["gaussian_noise@2"]}])
        digests.append([outcome["digest"] for outcome in outcomes])
        assert [outcome["cause"] for outcome in outcomes] == ["finished", "finished"], outcomes
        assert outcomes[0]["frames"] == pytest.approx(51, abs=2)
    assert digests[0] == digests[1] and digests[0][0] != digests[0][1]
    files = [file["path"] for file in session.record.manifest["files"]]
    assert str(tmp_path / "classes_for_tests.py") in files
    steps = session.record.steps(0)
    assert abs(steps["cross_track_error"][-1]) > 0 and steps["progress"][-1] == 1.0


def test_a_trace_of_another_scenario_is_refused(tmp_path):
    with pdk.Session(simulator={"name": "lane", "width": 64, "height": 48}, driver="lane_keeper", duration=0.5, out=tmp_path / "r") as session:
        session.drive([{"seed": 1}, {"seed": 2}])
    record = pdk.Record(tmp_path / "r")
    one, two = record.trace(0), record.trace(1)
    assert len(record.steps(0)["time"]) == len(record.steps(1)["time"])
    between = tmp_path / "between"
    one.rename(between)
    two.rename(one)
    between.rename(two)
    for read in (record.steps, record.events, record.frames):
        with pytest.raises(pdk.Error, match="does not belong to its line in scenarios.jsonl"):
            read(0)


@pytest.mark.parametrize(
    ("who", "fault", "says"),
    [
        ("driver", "die", "ended (exit status: 3)"),
        ("driver", "raise", "no such layer"),
        ("simulator", "reset", "ValueError: no such town"),
        ("simulator", "act", "ended (exit status: 4)"),
    ],
)
def test_one_that_fails_is_the_error_of_its_scenario(classes, tmp_path, who, fault, says):
    def session(**arguments):
        make = {"driver": classes.Pilot, "simulator": classes.Straight}
        given = {kind: {"fault": fault} if arguments.get(kind) else {} for kind in make}
        simulator = pdk.simulator(make["simulator"], given["simulator"], width=64, height=48, rate=10)
        return {"simulator": simulator, "driver": pdk.driver(make["driver"], given["driver"]), "duration": 1}

    road = {"waypoints": [[0, 0, 0], [0, 0, 40]]}
    with pdk.Session(out=tmp_path / "out", workers=1) as running:
        outcomes = running.drive([{**session(**{who: True}), "road": road}, {**session(), "road": road}])
        assert [outcome["cause"] for outcome in outcomes] == ["error", "time_out"], outcomes
        assert says in outcomes[0]["error"]
    assert len(running.record.lines()) == 2
    # The outcome is not taken here, although it is there.
    with pytest.raises(pdk.Error, match="1 of 2 scenarios could not be driven because a component failed"):
        with pdk.Session(out=tmp_path / "out", workers=1) as running:
            running.submit({**session(**{who: True}), "road": road})
            assert running.drive([{**session(), "road": road}])[0]["cause"] == "time_out"
    assert len(running.record.lines()) == 2


def test_a_session_has_a_record_when_it_is_over(tmp_path):
    with pdk.Session(**SHARED, out=tmp_path / "out") as session:
        with pytest.raises(pdk.Error, match="has no record: it is not over; leave its block first"):
            session.record  # noqa: B018
        session.drive([{}])
    assert session.record.path == tmp_path / "out"
    with pdk.Session(**SHARED) as session:
        pass
    with pytest.raises(pdk.Error, match="has no record: it drove no scenario and evaluated no dataset"):
        session.record  # noqa: B018


def test_perturbations_of_a_record_are_taken_again(tmp_path, image):
    applied = [
        {"name": "contrast", "level": 1, "factor": 1.3, "region": {"box": [0, 0.5, 1, 1]}},
        {"name": "gaussian_noise", "level": 2, "probability": 0.5, "draws": "per_sequence"},
        {"name": "fog_filter", "level": {"ramp": {"from": 0, "to": 4, "end": 2}}},
    ]
    with pdk.Session(**SHARED, seed=7, out=tmp_path / "out") as session:
        first = session.drive([{"perturbations": applied}])[0]
    recorded = session.record.lines()[0]["scenario"]
    assert recorded["perturbations"][0]["parameters"] == {"factor": 1.3}
    assert pdk.written(recorded["perturbations"]) == pdk.written(applied)
    assert (pdk.perturb(image, recorded["perturbations"], seed=7) == pdk.perturb(image, applied, seed=7)).all()
    # Parameters beside it count more than those in it.
    wanted = pdk.perturb(image, {**applied[0], "factor": 0.5})
    assert (pdk.perturb(image, recorded["perturbations"][0], factor=0.5) == wanted).all()
    # A whole scenario of a record is driven again, and is the same one.
    with pdk.Session(seed=7, out=tmp_path / "again") as session:
        again = session.drive([recorded])[0]
    assert (again["id"], again["digest"]) == (first["id"], first["digest"])
    with pytest.raises(pdk.Error, match="`factor` of `contrast` is set twice"):
        pdk.perturb(image, {"name": "contrast", "factor": 1, "parameters": {"factor": 2}})


def test_a_class_that_other_processes_cannot_find_is_refused():
    class Local:
        pass

    with pytest.raises(pdk.Error, match="is made inside of a function"):
        pdk.driver(Local)
    made = type("Made", (), {})
    made.__module__ = "nowhere"
    with pytest.raises(pdk.Error, match="is not a class in a file"):
        pdk.driver(made)


def test_a_metric_is_a_function(tmp_path):
    examples = Path(__file__).parents[3] / "docs/examples"
    request = {
        "dataset": {"name": "pictures", "path": str(examples / "signs")},
        "predictor": {"name": "network", "model": str(examples / "signs.onnx")},
        "perturbations": ["gaussian_noise"],
        "levels": [1, 4],
    }
    names = set()

    def certainty(seen):
        (scores,) = seen["outputs"].values()
        assert scores.dtype == numpy.float32 and scores.shape[-1] == 5 and seen["recorded"] == {}
        names.add(seen["name"])
        return {"top": scores.argmax(), "known": int(seen["label"] == "a stop sign")}

    with pdk.Session(out=tmp_path / "record", workers=2) as session:
        stop = sorted(str(path.relative_to(examples / "signs")) for path in (examples / "signs/stop").iterdir())
        task = {"labels": dict.fromkeys(stop, "a stop sign")}
        result = session.evaluate(**request, task=task, metric=certainty)
        alone = session.evaluate(**{**request, "perturbations": [], "levels": []}, metric=lambda seen: len(seen["name"]))
        built_in = session.evaluate(**request, task={"kind": "classification"})
        with pytest.raises(pdk.Error, match="has to be a number, or a table of numbers"):
            session.evaluate(**request, metric=lambda seen: "good")
        with pytest.raises(ZeroDivisionError):
            session.evaluate(**request, metric=lambda seen: 1 / 0)
        after = session.evaluate(**{**request, "frames": 2}, metric=lambda seen: 1)
    totals = {total["name"]: total["value"] for total in result["original"]}
    assert totals["known"] == pytest.approx(len(stop) / result["frames"]) and len(result["rows"]) == 2
    assert len(names) == result["frames"] == built_in["frames"]
    assert [total["name"] for total in alone["original"]] == ["score"] and alone["rows"] == []
    assert built_in["task"] == "classification" and after["original"][0]["value"] == 1


def test_what_was_applied_and_what_the_driver_got_are_in_the_steps(tmp_path):
    simulator = {"name": "lane", "width": 80, "height": 60, "rate": 20}
    late = {"name": "late_controls", "level": 0, "delay": 0.1}
    slow = {"name": "biased_speed", "level": 0, "share": -0.5}
    with pdk.Session(simulator=simulator, driver="lane_keeper", duration=1, out=tmp_path / "out") as session:
        session.drive([{"perturbations": [late, slow]}, {}])
    steps = session.record.steps(0)
    assert (steps["applied_steering"][2:] == steps["steering"][:-2]).all()
    assert (steps["observed_speed"] == 0.5 * steps["speed"]).all() and (steps["observed_time"] == steps["time"]).all()
    plain = session.record.steps(1)
    for name in ("observed_time", "observed_speed", "applied_steering", "applied_throttle"):
        assert numpy.isnan(plain[name]).all()
