"""Drivers in another process, without a process of pdk."""

import fcntl

import pytest


class Enough(Exception):
    """Ends what would go on without an end."""


@pytest.mark.parametrize("owned", [True, False])
def test_an_exchange_that_cannot_be_opened_is_reported_once_if_pdk_is_there(tmp_path, monkeypatch, capsys, owned):
    pytest.importorskip("iceoryx2", reason="iceoryx2 is missing; `pip install iceoryx2`")
    import pdk_driver

    folder = tmp_path / "driver-pilot" / "1-2"
    folder.mkdir(parents=True)
    (folder / "iceoryx2.toml").write_text("")
    monkeypatch.setenv("PDK_BUS_DIR", str(tmp_path))
    clock, tries = [0.0], []

    def sleep(seconds):
        clock[0] += seconds
        if clock[0] > 5:
            raise Enough

    def link(folder):
        tries.append(folder)
        raise RuntimeError("another version")

    monkeypatch.setattr(pdk_driver.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(pdk_driver.time, "sleep", sleep)
    with open(folder / "lock", "wb") as lock, pytest.raises(Enough):
        if owned:
            fcntl.flock(lock, fcntl.LOCK_EX)
        pdk_driver.attend("driver", link, "pilot")
    said = capsys.readouterr().err
    assert len(tries) > 20
    assert said.count("RuntimeError: another version") == said.count(str(folder)) == int(owned)
