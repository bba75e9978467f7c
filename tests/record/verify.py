"""Verifies records of pdk without pdk, as an example for docs/record.md.

    pip install blake3 mcap
    python3 tests/record/verify.py RECORD...

It computes the id, the checksum and the digest of every line, reads every trace to its end, compares the hashes of what the manifest
quotes, and computes the root of a gate's verdict and the checksums of its drives. If anything differs, it prints a sentence and ends with exit code 1.
"""

import json
import struct
import sys
from decimal import Decimal
from pathlib import Path

from blake3 import blake3
from mcap.exceptions import McapError
from mcap.stream_reader import StreamReader
from mcap.records import Channel, DataEnd, Footer, Message


class Refused(Exception):
    """What is wrong, in a sentence."""


def expect(true, what):
    if not true:
        raise Refused(what)


def number(value):
    """The canonical spelling of a number."""
    if isinstance(value, int) and -(2**63) <= value < 2**64:
        return str(value)
    value = float(value)
    if value.is_integer() and abs(value) < 2.0**64:
        return str(int(value))
    return format(Decimal(repr(value)), "f")


def quoted(text):
    def escaped(c):
        if c in '"\\':
            return "\\" + c
        return f"\\u{ord(c):04x}" if c < " " else c

    return '"' + "".join(map(escaped, text)) + '"'


def canonical(value):
    """The canonical text of a JSON value."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return number(value)
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, list):
        return "[" + ",".join(map(canonical, value)) + "]"
    # Python compares texts by code points, which is the order of their UTF-8.
    fields = sorted((key, item) for key, item in value.items() if item is not None)
    return "{" + ",".join(f"{quoted(key)}:{canonical(item)}" for key, item in fields) + "}"


def by_content(value, files):
    """A part of a scenario with the hashes of files in the places of their names."""
    if isinstance(value, str):
        return f"blake3:{files[value]}" if value in files else value
    if isinstance(value, list):
        return [by_content(item, files) for item in value]
    if isinstance(value, dict):
        return {key: by_content(item, files) for key, item in value.items()}
    return value


def scenario_id(scenario):
    scenario = dict(scenario)
    files = scenario.pop("files", {})
    for part in ("simulator", "driver", "perturbations"):
        if part in scenario:
            scenario[part] = by_content(scenario[part], files)
    text = canonical(scenario).encode()
    return blake3(text, derive_key_context="pdk scenario, version 1").hexdigest()[:32]


def seed_of(run_seed, road, repeat):
    """The seed of a scenario for which the pipeline sets none."""
    road = canonical(road).encode()
    data = struct.pack("<QQ", run_seed, len(road)) + road + struct.pack("<Q", repeat)
    key = blake3(data, derive_key_context="pdk scenario seed, version 1").digest()
    return int.from_bytes(key[:8], "little") >> 11


def lines(path):
    """The lines of a ledger by id. Of several lines with the same id the last one counts."""
    found = {}
    *whole, _cut_off = path.read_bytes().split(b"\n")
    for place, line in enumerate(whole, 1):
        body, mark, end = line[:-31], line[-31:-18], line[-18:]
        expect(mark == b',"checksum":"' and end[16:] == b'"}', f"line {place} has no checksum at its end")
        expect(end[:16].decode("latin-1") == blake3(body).hexdigest()[:16], f"the checksum of line {place} is wrong")
        fields = json.loads(body + b"}")
        own = scenario_id(fields["scenario"])
        expect(fields["id"] == own, f"line {place} has the id {fields['id']}, but its scenario has {own}")
        found.pop(own, None)
        found[own] = fields
    return found


def fields_of(message):
    """The fields of a Protocol Buffers message by number: whole numbers, or the bytes of the other types."""

    def varint(at):
        value = shift = 0
        while True:
            byte = message[at]
            value, at, shift = value | (byte & 0x7F) << shift, at + 1, shift + 7
            if byte < 0x80:
                return value, at

    found, at = {}, 0
    while at < len(message):
        tag, at = varint(at)
        if tag & 7 == 0:
            found[tag >> 3], at = varint(at)
        else:
            length, at = varint(at) if tag & 7 == 2 else ({1: 8, 5: 4}[tag & 7], at)
            found[tag >> 3], at = message[at : at + length], at + length
    return found


def check_trace(path, line):
    """Compares a trace with its line."""
    digest, steps, states, scenario, ended = blake3(), 0, {}, None, False
    topics = {}
    with open(path, "rb") as file:
        for record in StreamReader(file, validate_crcs=True).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
                if record.topic == "/event":
                    scenario = record.metadata.get("scenario")
            elif isinstance(record, Message) and topics[record.channel_id] == "/state":
                states[record.sequence] = fields_of(record.data).get(13, 0)
            elif isinstance(record, Message) and topics[record.channel_id] == "/control":
                control = fields_of(record.data)
                digest.update(struct.pack("<Q", states.pop(record.sequence)) + control[1] + control[2])
                steps += 1
            ended |= isinstance(record, (DataEnd, Footer))
    expect(ended and not states, "it is cut off")
    expect(scenario == line["id"], f"it is the trace of {scenario}")
    if line["digest"]:
        own = digest.hexdigest()[:32]
        expect(own == line["digest"], f"its steps have the digest {own}, but the line has {line['digest']}")
        expect(steps == line["frames"], f"it has {steps} steps, but the line has {line['frames']} frames")


# The fields of a line that are not its outcome.
NOT_OUTCOME = ("id", "name", "scenario", "images_every", "checksum")


def derived(context, data):
    return blake3(data, derive_key_context=context).digest()


def check_verdict(path, found):
    """The verdict of a gate: its root, and the checksums of the drives that are in this record."""
    verdict = json.loads(path.read_bytes())
    head = {key: value for key, value in verdict.items() if key not in ("entries", "root")}
    texts = [canonical(head)] + [canonical(entry) for entry in verdict["entries"]]
    level = [derived("pdk verdict leaf, version 1", text.encode()) for text in texts]
    while len(level) > 1:
        pairs = [level[at : at + 2] for at in range(0, len(level), 2)]
        level = [derived("pdk verdict node, version 1", b"".join(pair)) if len(pair) == 2 else pair[0] for pair in pairs]
    expect(level[0].hex() == verdict["root"], "the root of the verdict is not that of its contents")
    for entry in verdict["entries"]:
        line = found.get(entry["id"])
        if line is not None:
            outcome = {key: value for key, value in line.items() if key not in NOT_OUTCOME}
            text = canonical({"id": entry["id"], "outcome": outcome})
            own = derived("pdk verdict outcome, version 1", text.encode()).hex()[:32]
            expect(own == entry["checksum"], f"the verdict has another outcome of the scenario {entry['id']}")


def verify(record):
    manifest = json.loads((record / "manifest.json").read_bytes())
    for module in manifest["pipeline"].get("modules", []):
        own = blake3(module["source"].encode()).hexdigest()
        expect(module["blake3"] == own, f"the text of the module {module['name']} is not the one that ran")
    ledger = record / "scenarios.jsonl"
    found = lines(ledger) if ledger.exists() else {}
    for name, line in found.items():
        trace = record / "traces" / f"{name}.mcap"
        try:
            check_trace(trace, line)
        except (McapError, OSError, KeyError, IndexError, struct.error, Refused) as error:
            raise Refused(f"the trace {trace} does not fit its line: {str(error) or type(error).__name__}") from error
    if (record / "shard.json").exists():
        part = json.loads((record / "shard.json").read_bytes())
        index, of = part["shard"]["index"], part["shard"]["of"]
        missing = [name for name in part["scenarios"][index - 1 :: of] if name not in found]
        expect(not missing, f"part {index}/{of} has no line of the scenario {', '.join(missing)}")
    if (record / "verdict.json").exists():
        check_verdict(record / "verdict.json", found)
    from_run = sum(
        line["scenario"]["seed"]
        == seed_of(manifest["seed"], line["scenario"].get("road"), line["scenario"].get("repeat", 0))
        for line in found.values()
    )
    print(f"{record}: {len(found)} scenarios and their traces are as they were written; {from_run} seeds come from the run's seed")


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        try:
            verify(Path(argument))
        except (Refused, OSError, ValueError, KeyError) as error:
            sys.exit(f"{argument}: {error}")
