"""Bad input of every kind that others write, from a seed: accepted and used as it says, or refused
with the error of its reader. Anything else (another exception, a hang, motion) ends with 1.

    make bad-input                             a million cases
    python test/bad_input.py --cases 20000 --seed 3 --only packets
    python test/bad_input.py --again "HTTP headers" 5017 --seed 3      one case, with its traceback

Kinds that are cheap carry the number; files of a few hundred kilobytes get some hundred each. A
million cases take seven minutes of one core. A run of all kinds writes docs/results/bad_input.md.
"""

from __future__ import annotations

import argparse
import json
import math
import string
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import edfio
import ezc3d
import nptdms
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet
import yaml
from scipy.io import savemat

from ankle_actuator_driver.link.protocol.driver_end import DriverEnd
from ankle_actuator_driver.link.protocol.packet import (
    Heartbeat,
    Reference,
    StateReport,
    build,
    sealed,
)
from ankle_actuator_driver.safety.bridge import Bridge
from ankle_actuator_driver.safety.interpolated_path import path_through
from ankle_actuator_driver.safety.limits import Limits
from ankle_actuator_driver.safety.rig import DeviceFault, DeviceState, RigReport, Status, Wanted
from ankle_actuator_driver.safety.states import State
from ankle_interfaces.block import Block, pack, unpack
from ankle_interfaces.continuity import Continuity
from ankle_interfaces.errors import BlockError
from ankle_node import session_event
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from ankle_physics.scenario import Scenario
from biofeedback.errors import CommandError, MalformedMessageError, ProtocolError
from biofeedback.session import commands, saved_session
from biofeedback.session.course import load_course
from biofeedback.session.protocol import load_protocol
from biofeedback.session.session_program import Session
from biofeedback.web.access import Access
from emg_driver.errors import StreamRefused
from emg_driver.stream_description import StreamDescription, map_channels
from rig_emulator.emulated_device import EmulatedDevice
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError, ImportRefused
from session_recorder.importing import propose, read_table
from session_recorder.loss import account_of_bag

PAGE = Path(__file__).resolve().parents[1] / "docs" / "results" / "bad_input.md"
HEAD = """# Bad input

`make bad-input CASES={cases} SEED={seed}`: input of every kind that others write, from a seed. A
case is *accepted* where its reader took it and everything that it then states holds (values finite
and within bounds, no motion beyond a limit, samples complete or reported as missing), *refused*
where the reader refused it by its own error, and *anything else* otherwise: another exception, more
than {longest:g} s, motion, or content that is silently wrong.

| input | cases | accepted | refused | anything else |
| --- | --- | --- | --- | --- |
"""
Case = Callable[[np.random.Generator], bool]
LONGEST = 20.0  # s; what takes longer hangs
LEAST_CASES = 200  # of an expensive kind, in a run of a million
ROS = 1.76e9  # s
NUMBERS = (0, 1, -1, 2**31, 2**63, -(2**63), 10**30, 0.5, 1e-300, 1e300, math.inf, -math.inf)
NUMBERS += (math.nan, True, False, None)
TEXTS = ("", "nan", "-", "1e999", "°", "\0", "a" * 5000, "../../etc/passwd", "2026-13-45", "{", "[")
TEXTS += ("&a [*a]", "!!python/object:os.system {}", "1,5", "0x1f", "\ud800", "=1+1", "~", "<<: 1")
WORDS = string.printable + "äµ°\u2028\U0001f9b6"


class Kind(NamedTuple):
    """A kind of input.

    Attributes
    ----------
    name
        For the table.
    share
        Of all cases; 0 for kinds that get few.
    prepare
        Makes the case in a folder: true where the input was accepted, false where its reader
        refused it.
    """

    name: str
    share: float
    prepare: Callable[[Path], Case]


def damaged(data: bytes, random: np.random.Generator) -> bytes:
    """Bytes flipped, cut out, doubled or put in."""
    found = bytearray(data)
    for _ in range(int(random.integers(1, 6))):
        at, size = int(random.integers(0, len(found) + 1)), int(random.integers(1, 40))
        what = int(random.integers(5))
        if what == 0 and found:
            found[at % len(found)] = int(random.integers(256))
        elif what == 1:
            del found[at : at + size]
        elif what == 2:
            found[at:at] = found[at : at + size]
        elif what == 3:
            found[at:at] = random.bytes(size)
        else:
            found[at:at] = str(random.choice(TEXTS)).encode("utf-8", "surrogatepass")[:60]
    return bytes(found)


def strange(random: np.random.Generator, depth: int = 0) -> Any:
    """A value that does not belong here."""
    what = int(random.integers(4 if depth < 3 else 2))
    if what == 0:
        return NUMBERS[int(random.integers(len(NUMBERS)))]
    if what == 1:
        return TEXTS[int(random.integers(len(TEXTS)))]
    if what == 2:
        return [strange(random, depth + 1) for _ in range(int(random.integers(0, 3)))]
    return {word(random): strange(random, depth + 1) for _ in range(int(random.integers(0, 3)))}


def word(random: np.random.Generator) -> str:
    """Some characters."""
    return "".join(WORDS[int(i)] for i in random.integers(0, len(WORDS), random.integers(0, 20)))


def altered(content: Any, random: np.random.Generator) -> Any:
    """Another value, key or length somewhere in lists and mappings."""
    if not isinstance(content, (dict, list)) or not content or random.random() < 0.15:
        return strange(random)
    if isinstance(content, list):
        place = int(random.integers(len(content)))
        if random.random() < 0.2:
            return content[:place] + content[place + 1 :]
        return [altered(v, random) if k == place else v for k, v in enumerate(content)]
    key = list(content)[int(random.integers(len(content)))]
    what = random.random()
    if what < 0.15:
        return {k: v for k, v in content.items() if k != key}
    if what < 0.3:
        return {(word(random) if k == key else k): v for k, v in content.items()}
    return {k: altered(v, random) if k == key else v for k, v in content.items()}


def text_of(content: Any, random: np.random.Generator, write: Callable[[Any], str]) -> bytes:
    """An altered content as a file, or a file that is damaged."""
    if random.random() < 0.5:
        return damaged(write(content).encode("utf-8", "surrogatepass"), random)
    return write(altered(content, random)).encode("utf-8", "surrogatepass")


def number(random: np.random.Generator, *usual: float) -> float:
    """A usual number, or one at the edges of what fits."""
    edges = (0.0, -1.0, 1e9, 1e18, 1e300, -1e300, math.nan, math.inf, 5e-324)
    return float((usual + edges)[int(random.integers(len(usual) + len(edges)))])


def integer(random: np.random.Generator, bits: int, signed: bool = False) -> int:
    """An integer that fits, at the edges mostly."""
    low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    choices = (low, low + 1, 0, 1, high - 1, high, int(random.integers(low, high, endpoint=True)))
    if signed:
        choices += (int(ROS * 1e9) + int(random.integers(-(10**10), 10**10)),)
    return choices[int(random.integers(len(choices)))]


# The line


class Still:
    """A plate that rests."""

    def run(self, command: np.ndarray) -> np.ndarray:
        """Zeros."""
        return np.zeros((len(command), 3))


def _heartbeat(random: np.random.Generator, session: int, rig: int) -> tuple:
    return (
        session if random.random() < 0.5 else integer(random, 32),
        integer(random, 32),
        integer(random, 64, signed=True),
        Wanted(int(random.integers(3))),
        integer(random, 8),
        integer(random, 32),
        rig if random.random() < 0.5 else integer(random, 32),
    )


def packets_to_the_rig(folder: Path) -> Case:
    """Valid digests with extreme contents, and damaged packets."""
    device = EmulatedDevice(Still(), Limits(), 2048.0, 77, 1000.0)
    clock = [1000.0]

    def case(random: np.random.Generator) -> bool:
        head = _heartbeat(random, 5, 77)
        if random.random() < 0.5:
            data = build(Heartbeat(*head))
        else:
            motion = np.array([[number(random, 0.01, 0.17) for _ in range(3)] for _ in range(4)])
            first = round(1e9 * (clock[0] + float(random.uniform(-1, 1))))
            data = build(Reference(*head, first, number(random, 1 / 2048), motion))
        if random.random() < 0.3:
            data = damaged(data, random)
        elif random.random() < 0.1:
            data = sealed(random.bytes(int(random.integers(0, 80))))
        clock[0] += 2e-4
        accepted = isinstance(device.receive(data, clock[0]), Heartbeat)
        device.advance(clock[0])
        position, velocity, acceleration = device.command
        assert abs(position) <= 0.175
        assert abs(velocity) <= 5.0
        assert abs(acceleration) <= 2000.0 * (1 + 1e-5)
        return accepted

    return case


def packets_to_the_driver(folder: Path) -> Case:
    """State reports with extreme contents, and damaged ones."""
    end, bridge, clock = DriverEnd(5), Bridge(Limits(), 0.5, 0.0), [10.0]

    def case(random: np.random.Generator) -> bool:
        samples = np.array([[number(random, 0.01) for _ in range(3)] for _ in range(8)])
        report = StateReport(
            77 if random.random() < 0.8 else integer(random, 32),
            integer(random, 32),
            integer(random, 64, signed=True),
            DeviceState(int(random.integers(5))),
            DeviceFault(int(random.integers(8))),
            Status(int(random.integers(16))),
            integer(random, 32),
            5 if random.random() < 0.5 else integer(random, 32),
            integer(random, 32),
            *(integer(random, 64, signed=True) for _ in range(3)),
            number(random, 1 / 2048),
            number(random, 0.01),
            samples,
        )
        data = build(report)
        if random.random() < 0.3:
            data = damaged(data, random)
        clock[0] += float(random.choice([0.0, 0.004, 0.2]))
        events = end.take(data, clock[0], ROS + clock[0])
        for event in events:
            bridge.take(event, clock[0])
        bridge.advance(clock[0], ROS + clock[0])
        orders = bridge.take_orders(clock[0])
        assert all(order.wanted is Wanted.OFF for order in orders)
        for order in orders:
            end.packets(order, clock[0], ROS + clock[0])
        bridge.samples, bridge.notes, bridge.states.changes = [], [], []
        return bool(events)

    return case


def references(folder: Path) -> Case:
    """Blocks of the reference to a driver whose plate runs."""
    bridge = Bridge(Limits(), 0.5, 0.0)
    held = RigReport(
        DeviceState.OFF, DeviceFault.NONE, Status(0), True, True, True, 0.0, received=1
    )

    def case(random: np.random.Generator) -> bool:
        bridge.take(held, 0.0)
        bridge.states.state = State.RUNNING
        bridge._begin(0.0)
        bridge.orders = []
        count = int(random.choice([0, 1, 2, 8, 32, 100]))
        with np.errstate(all="ignore"):
            steps = np.arange(count) * number(random, *(1 / 2048,) * 20, 1 / 1000)
        start = ROS + float(random.choice([-1.0, 0.0, 0.02, 0.1, 1.0, 5.0]))
        motion = np.zeros((count, 3))
        if random.random() < 0.5:
            motion[:, 0] = 0.02 * np.sin(2 * np.pi * 5.0 * steps) if count else 0.0
            motion[:, 1] = np.gradient(motion[:, 0], 1 / 2048) if count > 2 else 0.0
            motion[:, 2] = np.gradient(motion[:, 1], 1 / 2048) if count > 2 else 0.0
        for column, usual in enumerate((0.05, 1.0, 200.0) if random.random() < 0.3 else ()):
            motion[:, column] = number(random, usual, usual, -usual)
        if count > 2 and random.random() < 0.3:
            motion[int(random.integers(count)), int(random.integers(3))] = number(random, 0.1)
        with np.errstate(all="ignore"):
            bridge.reference(start + steps, motion, 0.0, ROS)
        sent = [order.stretch for order in bridge.orders if order.stretch is not None]
        for stretch in sent:
            path = path_through(stretch.time, stretch.motion)
            assert np.abs(path.position).max() <= 0.175 * (1 + 1e-5)
            assert np.abs(path.velocity).max() <= 5.0 * (1 + 1e-5)
            assert path.largest_acceleration <= 2000.0 * (1 + 1e-5)
        bridge.notes, bridge.states.changes = [], []
        return bool(sent)

    return case


# The graph


def blocks(folder: Path) -> Case:
    """Messages of a topic of samples."""
    continuity, count = Continuity(), [0]

    def case(random: np.random.Generator) -> bool:
        count[0] += 1
        t = ROS + (32 * count[0] + np.arange(32)) / 2048
        data = np.column_stack([t, np.sin(t)])
        if random.random() < 0.2:
            data[int(random.integers(32)), int(random.integers(2))] = number(random)
        message = pack(Block(("t[s]", "torque[N.m]"), data))
        if random.random() < 0.8:
            message = damaged(message, random)
        try:
            block = unpack(message)
        except BlockError:
            return False
        assert block.data.ndim == 2
        assert block.data.shape[1] == len(block.columns)
        with np.errstate(all="ignore"):
            continuity.check(block.data)
        return True

    return case


def session_events(folder: Path) -> Case:
    """Lines on session/event."""
    good = {"event": "hold started", "t[s]": ROS, "hold": 3, "torque_target[N.m]": -5.0}

    def case(random: np.random.Generator) -> bool:
        text = text_of(good, random, lambda c: yaml.safe_dump(c, default_flow_style=True))
        try:
            found = session_event.parse(text.decode("utf-8", "replace"))
        except session_event.SessionEventError:
            return False
        assert math.isfinite(found.time)
        return True

    return case


def stream_descriptions(folder: Path) -> Case:
    """What an amplifier says of itself over LSL."""
    labels, units = ("SOL", "TA", "GL", "GM"), ("uV", "mV", "V", "nV")

    def case(random: np.random.Generator) -> bool:
        count = int(random.integers(0, 7))
        pick = [
            labels[int(random.integers(4))] if random.random() < 0.8 else word(random)
            for _ in range(count)
        ]
        names = labels if random.random() < 0.5 else tuple(pick)
        unit = tuple(
            units[int(random.integers(4))] if random.random() < 0.9 else word(random) for _ in names
        )
        stream = StreamDescription(
            word(random),
            "EMG",
            word(random),
            word(random),
            number(random, 2048.0, 2048.0, 2000.0, 1000.0),
            names,
            unit,
        )
        channels = "SOL=SOL,TA=TA,GL=GL,GM=GM"
        if random.random() < 0.4:
            channels = damaged(channels.encode(), random).decode("utf-8", "replace")
        try:
            found = map_channels(stream, channels, "" if random.random() < 0.7 else word(random))
        except StreamRefused:
            return False
        assert found.index.min() >= 0
        assert found.index.max() < len(names)
        assert np.all((found.to_volts > 0) & (found.to_volts <= 1))
        return True

    return case


# The pages


def page_messages(folder: Path) -> Case:
    """Messages on the WebSocket."""
    good = [
        {"id": 1, "command": "set_target", "torque[N.m]": -5.0, "lower": 1.0, "upper": 2.0},
        {"id": 2, "command": "note", "text": "calm"},
        {"id": 3, "command": "stop"},
    ]

    def case(random: np.random.Generator) -> bool:
        content = good[int(random.integers(len(good)))]
        text = text_of(content, random, json.dumps).decode("utf-8", "replace")
        try:
            command = commands.parse(text)
        except (CommandError, MalformedMessageError):
            return False
        for value in command.values.values():
            assert not isinstance(value, float) or math.isfinite(value)
        return True

    return case


def http_headers(folder: Path) -> Case:
    """Host, origin and cookie of a request."""
    access = Access("127.0.0.1", "a long and secret token")
    parts = (
        "127.0.0.1",
        "localhost",
        "[::1]",
        ":",
        "8080",
        "//",
        "http",
        "@",
        "[",
        "]",
        "evil.org",
    )

    def header(random: np.random.Generator) -> str:
        if random.random() < 0.3:
            return "127.0.0.1:8080"
        chosen = [parts[int(i)] for i in random.integers(0, len(parts), random.integers(0, 6))]
        return "".join(chosen) + (word(random) if random.random() < 0.3 else "")

    def case(random: np.random.Generator) -> bool:
        host, origin = header(random), None if random.random() < 0.2 else header(random)
        if origin is not None and random.random() < 0.5:
            origin = f"http://{host}"
        assert access.roles(word(random)) == ()
        assert access.enter(word(random)) is None
        if access.refusal(host, origin, None) is not None:
            return False
        assert any(name in host for name in ("127.0.0.1", "localhost", "::1"))
        assert origin is None or origin.endswith(host)
        return True

    return case


def saved_sessions(folder: Path) -> Case:
    """The file with a session's progress."""
    session = Session(load_protocol("van_t_veld_2018"))
    good = {"saved_at[s]": ROS, **session.saved()}
    path = folder / "progress.json"

    def case(random: np.random.Generator) -> bool:
        path.write_bytes(text_of(good, random, json.dumps))
        try:
            found = saved_session.load(path, ROS + 1.0, 3600.0)
            if found is None:
                return False
            resumed = Session(session.protocol)
            resumed.resume(found, ROS)
        except CommandError:
            return False
        assert resumed.state != "armed"
        assert math.isfinite(resumed.elapsed)
        resumed.saved()
        return True

    return case


# Files


def yaml_files(
    good: Any, suffix: str, read: Callable[[Path], Any], refusals: tuple[type[Exception], ...]
) -> Callable[[Path], Case]:
    """Files of YAML with a reader of their own."""

    def prepare(folder: Path) -> Case:
        path = folder / suffix

        def case(random: np.random.Generator) -> bool:
            path.write_bytes(text_of(good, random, lambda c: yaml.safe_dump(c, sort_keys=False)))
            try:
                read(path)
            except refusals:
                return False
            return True

        return case

    return prepare


def read_model(path: Path) -> None:
    """A model file; every value is within its bounds."""
    for entry in Model.load(path).entries:
        for parameter in entry.term.parameters:
            value = entry.values[parameter.symbol]
            assert parameter.lower <= value <= parameter.upper


MODEL = {
    "model": "subject 3",
    "terms": [
        {"term": "inertia", "I[kg.m^2]": {"value": 0.0137, "standard_error": 0.0002}},
        {"term": "viscosity", "B[N.m.s/rad]": 1.0},
        {"term": "stiffness", "K[N.m/rad]": 100.0},
        {"term": "reflex", "G[N.m.s/rad]": 10.0, "delay[s]": 0.04},
    ],
}
SCENARIO = {
    "scenario": "all kinds",
    "changes": [
        {"at[s]": 1, "stiffness.K[N.m/rad]": 50},
        {"at[s]": 2, "over[s]": 2, "stiffness.K[N.m/rad]": 150},
        {
            "at[s]": 5,
            "stiffness.K[N.m/rad]": {"mean": 100, "amplitude": 30, "frequency[Hz]": 0.5},
        },
    ],
}
RIG = {
    "rig": "laboratory 2",
    "calibrated": "2026-11-20T14:02:11Z",
    "bag": "rig_20261120",
    "torque_delay[s]": {"value": 0.00049, "standard_error": 0.00002},
    "zero": {"position[rad]": 0.012, "torque[N.m]": -0.31},
    "noise": {"position[rad]": 4.5e-5, "velocity[rad/s]": 6.5e-3, "torque[N.m]": 0.14},
    "terms": [{"term": "footplate_inertia", "Ip[kg.m^2]": 0.0042}],
}


def of_package(*parts: str) -> Any:
    """A YAML file of the package of the pages."""
    folder = Path(saved_session.__file__).parents[1] / "config"
    return yaml.safe_load(folder.joinpath(*parts).read_text())


def bags(folder: Path) -> Case:
    """Bags whose data or metadata are damaged: what is missing is told."""
    good, bad, total = folder / "good", folder / "bad", 40 * 32
    with BagWriter(good, overwrite=True) as writer:
        writer.add_topic("/ankle/samples")
        for count in range(40):
            t = ROS + count * 0.032 + np.arange(32) / 1000
            writer.write_block(
                "/ankle/samples", Block(("t[s]", "torque[N.m]"), np.column_stack([t, t]))
            )
            if count % 10 == 9:
                writer.flush()
    mcap, meta = (next(good.glob(name)).read_bytes() for name in ("*.mcap", "metadata.yaml"))
    bad.mkdir(exist_ok=True)

    def case(random: np.random.Generator) -> bool:
        in_data = random.random() < 0.7
        (bad / "good_0.mcap").write_bytes(damaged(mcap, random) if in_data else mcap)
        (bad / "metadata.yaml").write_bytes(meta if in_data else damaged(meta, random))
        try:
            held = account_of_bag(BagReader(bad))
        except BagError:
            return False
        samples = sum(one.samples for one in held.topics.values())
        assert samples <= total
        assert samples == total or held.sentences()
        return True

    return case


def tables(write: Callable[[Path, np.ndarray], Path]) -> Callable[[Path], Case]:
    """Recordings in files of other programs."""

    def prepare(folder: Path) -> Case:
        t = np.arange(60) / 1000
        path = write(folder / "file", np.column_stack([t, np.sin(40 * t), np.cos(30 * t)]))
        good = path.read_bytes()

        def case(random: np.random.Generator) -> bool:
            path.write_bytes(damaged(good, random))
            try:
                found = read_table(path)
                propose(found)
            except ImportRefused:
                return False
            for name, values in found.columns.items():
                assert values.ndim == 1, name
                assert values.dtype == float
            return True

        return case

    return prepare


NAMES = ("Time (s)", "Angle (deg)", "Torque (Nm)")


def as_csv(path: Path, table: np.ndarray) -> Path:
    """Text."""
    np.savetxt(path.with_suffix(".csv"), table, delimiter=",", header=",".join(NAMES), comments="")
    return path.with_suffix(".csv")


def as_mat(path: Path, table: np.ndarray) -> Path:
    """MATLAB."""
    savemat(path.with_suffix(".mat"), {"trial": {"time": table[:, 0], "torque": table[:, 1]}})
    return path.with_suffix(".mat")


def as_edf(path: Path, table: np.ndarray) -> Path:
    """European Data Format."""
    signal = edfio.EdfSignal(np.tile(table[:, 1], 10), 600, label="SOL")
    edfio.Edf([signal]).write(path.with_suffix(".edf"))
    return path.with_suffix(".edf")


def as_xlsx(path: Path, table: np.ndarray) -> Path:
    """Excel."""
    book = openpyxl.Workbook()
    for row in (NAMES, *table.tolist()):
        book.active.append(list(row))
    book.save(path.with_suffix(".xlsx"))
    return path.with_suffix(".xlsx")


def as_parquet(path: Path, table: np.ndarray) -> Path:
    """Parquet."""
    content = pa.table({name: table[:, k] for k, name in enumerate(NAMES)})
    pyarrow.parquet.write_table(content, path.with_suffix(".parquet"))
    return path.with_suffix(".parquet")


def as_c3d(path: Path, table: np.ndarray) -> Path:
    """Motion capture."""
    file = ezc3d.c3d()
    file["parameters"]["ANALOG"]["RATE"]["value"] = [1000.0]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = list(NAMES)
    file["parameters"]["POINT"]["RATE"]["value"] = [1000.0]
    file["data"]["analogs"] = table.T[np.newaxis]
    file["data"]["points"] = np.zeros((4, 0, len(table)))
    file.write(str(path.with_suffix(".c3d")))
    return path.with_suffix(".c3d")


def as_tdms(path: Path, table: np.ndarray) -> Path:
    """LabVIEW."""
    with nptdms.TdmsWriter(path.with_suffix(".tdms")) as writer:
        writer.write_segment(
            [nptdms.ChannelObject("rig", name, table[:, k]) for k, name in enumerate(NAMES)]
        )
    return path.with_suffix(".tdms")


KINDS = (
    Kind("packets to the rig", 0.28, packets_to_the_rig),
    Kind("packets to the driver", 0.22, packets_to_the_driver),
    Kind("blocks of the reference", 0.1, references),
    Kind("messages of samples", 0.2, blocks),
    Kind("messages of a page", 0.1, page_messages),
    Kind("HTTP headers", 0.08, http_headers),
    Kind("LSL descriptions", 0.018, stream_descriptions),
    Kind("session events", 0.002, session_events),
    Kind("saved sessions", 0.0, saved_sessions),
    Kind("models", 0.0, yaml_files(MODEL, "model.yaml", read_model, (ModelError,))),
    Kind("scenarios", 0.0, yaml_files(SCENARIO, "scenario.yaml", Scenario.load, (ModelError,))),
    Kind("rig files", 0.0, yaml_files(RIG, "rig.yaml", RigFile.load, (ModelError,))),
    Kind(
        "protocols",
        0.0,
        yaml_files(
            of_package("demonstration.yaml"),
            "protocol.yaml",
            lambda path: load_protocol(str(path)),
            (ProtocolError,),
        ),
    ),
    Kind(
        "courses",
        0.0,
        yaml_files(
            of_package("courses", "down_training.yaml"),
            "course.yaml",
            lambda path: load_course(str(path)),
            (ProtocolError,),
        ),
    ),
    Kind("bags", 0.0, bags),
    *(
        Kind(f"files {write.__name__[3:].upper()}", 0.0, tables(write))
        for write in (as_csv, as_mat, as_edf, as_xlsx, as_parquet, as_c3d, as_tdms)
    ),
)


def seeded(seed: int, kind: Kind, case: int) -> np.random.Generator:
    """The numbers of one case, which does not depend on any other."""
    return np.random.default_rng([seed, *kind.name.encode(), case])


class Found(NamedTuple):
    """What became of a kind's cases."""

    counts: Counter[str]
    problems: list[str]


def examine(kind: Kind, cases: int, seed: int, progress: Callable[[int], None]) -> Found:
    """So many cases of one kind."""
    counts: Counter[str] = Counter()
    problems: list[str] = []
    with tempfile.TemporaryDirectory() as folder:
        case = kind.prepare(Path(folder))
        for index in range(cases):
            begin = time.monotonic()
            try:
                counts["accepted" if case(seeded(seed, kind, index)) else "refused"] += 1
            except Exception as error:
                counts["failed"] += 1
                last = traceback.extract_tb(error.__traceback__)[-1]
                where = f"{Path(last.filename).name}:{last.lineno}"
                problems.append(f"{kind.name} {index}: {type(error).__name__} ({where}): {error}")
            if time.monotonic() - begin > LONGEST:
                problems.append(f"{kind.name} {index}: took {time.monotonic() - begin:.0f} s")
            progress(index)
    return Found(counts, problems)


def number_of(kind: Kind, cases: int) -> int:
    """How many cases of a kind a run of so many in all has."""
    few = LEAST_CASES * cases // 1_000_000
    return max(int(kind.share * cases), few, 5)


def show_progress(name: str, cases: int) -> Callable[[int], None]:
    """Return what shows the number of the present case every two seconds."""
    shown = [time.monotonic()]

    def show(index: int) -> None:
        if time.monotonic() - shown[0] > 2.0:
            shown[0] = time.monotonic()
            print(f"\r{name}: {index} of {cases}   ", end="", file=sys.stderr, flush=True)

    return show


def main() -> int:
    """Run the cases, print the table and write it into the page."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--cases", type=int, default=1_000_000)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--only", default="", help="kinds with these words in their name")
    options.add_argument("--again", nargs=2, metavar=("KIND", "CASE"))
    given = options.parse_args()
    if given.again:
        kind = next(kind for kind in KINDS if kind.name == given.again[0])
        with tempfile.TemporaryDirectory() as folder:
            print(kind.prepare(Path(folder))(seeded(given.seed, kind, int(given.again[1]))))
        return 0
    problems, rows, total = [], [], 0
    for kind in [kind for kind in KINDS if given.only in kind.name]:
        cases = number_of(kind, given.cases)
        found = examine(kind, cases, given.seed, show_progress(kind.name, cases))
        problems += found.problems
        total += cases
        counts = [found.counts[fate] for fate in ("accepted", "refused", "failed")]
        rows.append(f"| {kind.name} | {cases} | {' | '.join(map(str, counts))} |")
        print(rows[-1], flush=True)
    closing = f"{total} cases, seed {given.seed}: {len(problems)} neither accepted nor refused."
    if not given.only:
        head = HEAD.format(cases=given.cases, seed=given.seed, longest=LONGEST)
        PAGE.write_text(f"{head}{chr(10).join(rows)}\n\n{closing}\n")
    print("\n".join([closing, *problems[:50]]))
    return int(bool(problems))


if __name__ == "__main__":
    raise SystemExit(main())
