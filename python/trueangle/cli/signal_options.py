"""Options that state which column holds what, and of sources that are read as they arrive."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError
from .parser import Input, declare
from .values import track_periods

if TYPE_CHECKING:
    from ..recording.sources import SourceOptions

#: The roles, as every help names them.
ROLES = (
    "reference, indicated, error, reference_offset, time, velocity, direction, temperature, "
    "torque, current, mount, run, unit, when, motor, head1, head2 ..., shift, sine, cosine, "
    "sine2, cosine2, excitation, coupled_JOINT"
)

#: What a source may be, as every help names it.
SOURCES = (
    "a serial port (/dev/ttyUSB0, COM3), can:vcan0, - (standard input), tcp://HOST:PORT, "
    "udp://:PORT"
)


def add_signals(
    parser: argparse.ArgumentParser,
    counts: bool = True,
    runs: bool = True,
    reference: bool = True,
    topic: bool = True,
    channels: bool = True,
) -> None:
    """Declare ``--signal`` and what belongs to it; of ``runs``, what their reference is made of."""
    add = partial(declare, parser)
    signal = add(
        "--signal [JOINT.]ROLE=NAME[:UNIT]",
        signal_option,
        f"column that holds a role, and its unit (deg, rad, turn, count, arcsec, "
        f"arcmin; s, ms, us, ns; deg/s, rad/s, turn/s). Repeatable. -NAME is a reversed sensor. "
        f"Roles: {ROLES}. Without it "
        "columns are found by their names: reference_deg, time_s, 'pos act [rad]'",
        many=True,
    )
    signal.words = tuple(  # type: ignore[attr-defined]  # what a shell completes
        f"{role.removesuffix(' ...')}=" for role in ROLES.split(", ")
    )
    if counts:
        add("--counts-per-turn N", float, "counts per turn of an indicated angle in counts")
    if reference:
        add("--counts-per-turn-reference N", float, "counts per turn of a reference in counts")
    if channels:
        add(
            "--periods-per-turn P[,P2]",
            track_periods,
            "periods per turn of the channels sine and cosine; of two tracks (sine2, cosine2) both "
            "numbers, as 32,31",
        )
    if topic:
        add(
            "--topic NAME",
            str,
            "JointState topic of a ROS bag (default: the only one); join takes two, A,B",
        )
    if runs:
        add(
            "--facets FILE",
            Input,
            "calibrated deviations of a polygon's facets, added to the reference at its "
            "nominal angles: columns reference_deg and deviation_arcsec",
        )
        add(
            "--unit-from REGEX",
            str,
            "what this finds in the path of a file (its first group) is the unit that its "
            "runs belong to",
        )


class _Entry(tuple[str | None, str, str, str | None]):
    """Joint, role, column and unit of one ``--signal``; ``text`` is what was typed."""

    text: str


def signal_option(text: str) -> _Entry:
    """What argparse makes of one ``[JOINT.]ROLE=NAME[:UNIT]``; mistakes are of usage.

    Examples
    --------
    >>> signal_option("arm.torque=tau"), signal_option("reference=IOC:m1.RBV")
    (('arm', 'torque', 'tau', None), (None, 'reference', 'IOC:m1.RBV', None))
    """
    from ..support.roles import role_kind, wanted_unit  # takes numpy, which a help does without

    left, equals, name = text.partition("=")
    joint, _, role = left.rpartition(".")
    if not equals or not name or not role:
        raise argparse.ArgumentTypeError(f"[JOINT.]ROLE=NAME[:UNIT] is needed, got {text!r}")
    try:
        role_kind(role)
    except ArgumentError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    column, colon, ending = name.rpartition(":")
    unit = wanted_unit(ending, role) if colon and column else None
    entry = _Entry((joint or None, role, column if unit else name, unit))
    entry.text = text
    return entry


def signals_of_both(entries: Sequence[_Entry] | None) -> dict[str, Any]:
    """Columns of either of two logs or sources, and of ``a`` and ``b`` alone."""
    plain = signals_by_joint([e for e in entries or () if e[0] is None]) or {}
    own = signals_by_joint([e for e in entries or () if e[0] is not None], single=False) or {}
    return {**plain, **own}


def signals_by_joint(
    entries: Sequence[_Entry] | None, single: bool = True
) -> dict[str, Any] | None:
    """Columns by role of the one joint, or such mappings by joint.

    Raises
    ------
    ArgumentError
        A joint is named where there is one, or missing where there are several; a role twice.
    """
    found: dict[str, Any] = {}
    for joint, role, name, unit in entries or ():
        if single == (joint is not None):
            wanted = "ROLE=NAME" if single else "JOINT.ROLE=NAME"
            given = f"{joint}.{role}" if joint else role
            raise ArgumentError(f"--signal: {wanted} is needed, got {given}={name}")
        roles = found if joint is None else found.setdefault(joint, {})
        if role == "reference_offset":
            roles.setdefault(role, []).append((name, unit))
            continue
        if role in roles:
            raise ArgumentError(f"--signal: {role} is named twice, {roles[role][0]!r} and {name!r}")
        roles[role] = (name, unit)
    return found or None


def of_joint(text: str, joint: str | None) -> str:
    """A message whose columns are those of a joint, or of a simulator's log: options name it.

    Examples
    --------
    >>> of_joint("give `signals={'torque': 'tau'}`", "arm")
    "give `signals={'arm': {'torque': 'tau'}}`"
    """
    if joint is None:
        return text
    return re.sub(r"`signals=\{([^`]+)\}`", rf"`signals={{{joint!r}: {{\1}}}}`", text)


def reading_options(args: argparse.Namespace) -> dict[str, Any]:
    """Keywords of `trueangle.read_runs` from the options of a command."""
    return {
        "counts_per_turn": args.counts_per_turn,
        "counts_per_turn_reference": args.counts_per_turn_reference,
        "signals": signals_by_joint(args.signal),
        "topic": args.topic,
        "periods_per_turn": getattr(args, "periods_per_turn", None),
        **({"facets": args.facets, "unit_from": args.unit_from} if "facets" in args else {}),
    }


def source_argument(text: str) -> str:
    """A source as it is typed: an input where it is a file that is there."""
    from ..recording.sources import kind_of

    is_live = kind_of(text) not in ("file", "")
    return Input(text) if os.path.exists(text) and not is_live else text


def add_source_options(parser: argparse.ArgumentParser) -> None:
    """Declare what sources are opened with, and how their lines are read."""
    add = partial(declare, parser)
    add("--baud N", int, "baud rate of a serial port (default: 115200)")
    add(
        "--dbc FILE",
        Input,
        "description of a CAN bus; without one signals are ID:byte:length:scale, as "
        "--signal indicated=0x101:0:2:0.02197:deg (length 2s is signed, 2b big-endian)",
    )
    add(
        "--pattern REGEX",
        str,
        "a row's columns as named groups, as 'S(?P<step>\\d+) R(?P<raw>\\d+)' "
        "(default: CSV, name:value pairs, numbers or JSON, found by the first lines)",
    )
    add(
        "--send TEXT",
        str,
        "line to send to the device at the start (a frame ID#DATA on CAN); without it "
        "nothing is sent",
    )


def source_options(args: argparse.Namespace, addresses: Sequence[str]) -> SourceOptions:
    """What the sources at some addresses are opened with.

    Raises
    ------
    ArgumentError
        An option of another kind of source, or a baud rate that is none.
    """
    from ..recording.sources import SourceOptions, kind_of

    kinds = {*map(kind_of, addresses)}
    for name, kind, of in (("baud", "port", "a serial port"), ("dbc", "can", "a CAN bus")):
        # An unknown source is refused by itself.
        if getattr(args, name) is not None and kinds.isdisjoint((kind, "")):
            raise ArgumentError(f"--{name} is for {of}; SOURCE is {addresses[0]}")
    baud = 115200 if args.baud is None else args.baud
    if baud < 1:
        raise ArgumentError(f"--baud must be positive, got {baud}")
    fields = tuple(name.lstrip("-") for _joint, _role, name, _unit in args.signal or ())
    return SourceOptions(baud, args.dbc, fields, args.pattern, args.send)
