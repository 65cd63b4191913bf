# Copyright 2026 The rt_robot_os authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""
Faults of simulated devices, by schedule or on demand.

A schedule is a string such as ``unplug at 5 for 2``: seconds since the start, and the duration.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping
from dataclasses import dataclass
import math
import random
import re
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.units import NS_PER_S

FAULTS: Final = {
    'silent': 'sends nothing',
    'garbage': 'sends random bytes instead of its own',
    'corrupt': 'bits flip on the line',
    'short': 'its bytes arrive in fragments of one to three bytes',
    'unplug': 'the port disappears, and returns under the same path',
    'stuck': 'repeats its last sample',
    'wrong': 'sends the bytes of another device',
    'baud': 'is received at half of its speed, as with a wrong baud rate',
}

# Faults of chips on an I2C bus.
I2C_FAULTS: Final = {
    'silent': 'answers, but measures no more',
    'garbage': 'returns random bytes',
    'corrupt': 'bits flip in the bytes that are read',
    'nack': 'does not acknowledge, and keeps its settings',
    'unplug': 'has no power: does not acknowledge, and returns without its settings',
    'stuck': 'repeats its last measurement',
    'wrong': 'answers like another chip',
    'hold': 'holds the data line low: no transfer on the whole bus is possible',
    'vanish': 'the whole bus disappears, as with a USB adapter, and returns under its path',
}

# Faults of motor boards, in addition to those of every serial device.
MOTOR_FAULTS: Final = {
    **FAULTS,
    'reset': 'has no power: its counters and settings are reset',
    'loss': 'single bytes are lost on the line, in both directions',
    'left_encoder': 'the counter of the left wheel stands still',
    'right_encoder': 'the counter of the right wheel stands still',
    'overcurrent': 'reports that a motor draws too much',
}

# Faults of localisers that detect marks.
LOCALISER_FAULTS: Final = {
    **FAULTS,
    'blind': 'sees no mark',
    'misread': 'confuses each mark with another one, or sees it elsewhere if there is no other',
}

# Faults of sinks of sensor networks.
SINK_FAULTS: Final = {
    **FAULTS,
    'reset': 'has no power: its queue is lost, and its routing restarts',
}

# Faults of pulse oximeters.
OXIMETER_FAULTS: Final = {
    **FAULTS,
    'off': 'no finger is in it',
    'disconnect': 'its sensor is not plugged in',
    'artefact': 'the finger moves: its pulses are artefacts, then the signal is lost',
    'battery': 'its batteries are low',
}


def _besides(known: Mapping[str, str]) -> str:
    return ', '.join(fault for fault in known if fault not in FAULTS)


# All of them, for messages.
FAULT_HELP: Final = (
    f'{", ".join(FAULTS)}; on I2C {", ".join(I2C_FAULTS)}; motor boards {_besides(MOTOR_FAULTS)}; '
    f'localisers {_besides(LOCALISER_FAULTS)}; sinks {_besides(SINK_FAULTS)}; '
    f'pulse oximeters {_besides(OXIMETER_FAULTS)}')

_MAX_S: Final = 1e6
_MAX_EVENTS: Final = 256
_EVENT: Final = re.compile(r'(\S+)\s+at\s+(\S+)\s+for\s+(\S+)').fullmatch


@dataclass(frozen=True)
class FaultEvent:
    """
    One fault.

    :ivar start_ns: since the start of the device, or on CLOCK_MONOTONIC once it runs.
    """

    fault: str
    start_ns: int
    duration_ns: int

    def covers(self, moment_ns: int) -> bool:
        """Return whether it is active."""
        return self.start_ns <= moment_ns < self.start_ns + self.duration_ns


class FaultPlan:
    """The faults of one device: those of the schedule and those injected while it runs."""

    def __init__(
        self, events: Iterable[FaultEvent], known: Mapping[str, str] = FAULTS,
    ) -> None:
        """
        Store the schedule.

        :param events: with times since the start of the device.
        :param known: the possible faults.
        """
        self._known = known
        self._scheduled = tuple(events)
        self._events: list[FaultEvent] = []

    def start(self, now_ns: int) -> None:
        """Start: the schedule counts from now."""
        self._events = [FaultEvent(e.fault, now_ns + e.start_ns, e.duration_ns)
                        for e in self._scheduled]

    def inject(self, fault: str, duration_s: float, now_ns: int) -> None:
        """
        Start a fault now.

        :raises ConfigError: the fault or the duration is invalid.
        """
        self._events = [e for e in self._events if e.start_ns + e.duration_ns > now_ns]
        self._events = self._events[-_MAX_EVENTS:]
        self._events.append(FaultEvent(fault, now_ns, check(fault, duration_s, self._known)))

    def active(self, moment_ns: int) -> frozenset[str]:
        """Return the faults that are active."""
        return frozenset(e.fault for e in self._events if e.covers(moment_ns))

    def next_ns(self, after_ns: int) -> int | None:
        """Return when a fault begins or ends next; None if none will."""
        edges = [edge for e in self._events for edge in (e.start_ns, e.start_ns + e.duration_ns)]
        return min((edge for edge in edges if edge > after_ns), default=None)


def check(fault: str, duration_s: float, known: Mapping[str, str] = FAULTS) -> int:
    """
    Check a fault and its duration.

    :param known: the possible faults.
    :return: the duration in nanoseconds.
    :raises ConfigError: the fault or the duration is invalid.
    """
    if fault not in known:
        raise ConfigError([f'there is no fault {fault!r}: use one of {", ".join(known)}'])
    if not 0 < duration_s <= _MAX_S:
        raise ConfigError([
            f'fault {fault} for {duration_s:g} s: the duration must be above 0 and at most '
            f'{_MAX_S:g} s'])
    return round(duration_s * NS_PER_S)


def parse_schedule(
    texts: Iterable[str], known: Mapping[str, str] = FAULTS,
) -> tuple[FaultEvent, ...]:
    """
    Parse a schedule.

    :param known: the possible faults.
    :param texts: such as ``unplug at 5 for 2``; several in one text are separated by ``;``.
    :raises ConfigError: with every problem found.
    """
    events = []
    problems: list[str] = []
    for part in (p.strip() for text in texts for p in text.split(';')):
        if not part:
            continue
        try:
            events.append(_parse(part, known))
        except ConfigError as error:
            problems.extend(error.problems)
    if len(events) > _MAX_EVENTS:
        problems.append(f'{len(events)} faults: at most {_MAX_EVENTS} can be scheduled')
    if problems:
        raise ConfigError(problems)
    return tuple(events)


def _parse(part: str, known: Mapping[str, str]) -> FaultEvent:
    match = _EVENT(part)
    if match is None:
        raise ConfigError([
            f'fault {part!r} is not understood: write it like "unplug at 5 for 2" (seconds)'])
    fault, at_s, for_s = match[1], _seconds(match[2], part), _seconds(match[3], part)
    if not 0 <= at_s <= _MAX_S:
        raise ConfigError([
            f'fault {part!r}: it must begin at 0 to {_MAX_S:g} seconds after the start'])
    return FaultEvent(fault, round(at_s * NS_PER_S), check(fault, for_s, known))


def _seconds(text: str, part: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ConfigError([f'fault {part!r}: {text!r} is not a number of seconds'])
    return value


def fault_settings(known: Mapping[str, str]) -> tuple[Field, ...]:
    """
    Declare the settings of a simulated device for faults and random numbers.

    :param known: the possible faults, and their descriptions.
    """
    return (
        Field('faults', list, (), 'Faults such as "unplug at 5 for 2" (seconds after the start): '
              + '; '.join(f'{name} {what}' for name, what in known.items()) + '.'),
        Field('corrupt_probability', float, 0.01, 'Probability that a bit of a byte flips while '
              'the fault corrupt is active.', minimum=0.0, maximum=1.0),
        Field('seed', int, 1, 'Seed of noise and faults; equal seeds give equal bytes.'),
    )


def plan_of(name: str, texts: Iterable[str], known: Mapping[str, str]) -> FaultPlan:
    """
    Return the faults that the settings of a device schedule.

    :raises ConfigError: with every problem found, with the name of the device.
    """
    try:
        return FaultPlan(parse_schedule(texts, known), known)
    except ConfigError as error:
        raise ConfigError([f'{name}: {problem}' for problem in error.problems]) from error


def corrupted(data: bytes, probability: float, chance: random.Random) -> bytes:
    """Return the bytes with random bit errors."""
    return bytes(byte ^ 1 << chance.randrange(8) if chance.random() < probability else byte
                 for byte in data)
