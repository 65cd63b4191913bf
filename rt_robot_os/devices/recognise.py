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
Whose bytes are these: for the diagnostics of a device that sends, but nothing valid.

The commonest mistakes are a wrong speed and two ports that are swapped. For the second the bytes
tell which device it is, as far as a driver here knows it, or one that another package has added to
the entry-point group of the drivers (``FRAMES`` and ``recognises`` of its class).
"""

from __future__ import annotations

from collections.abc import Callable
import re
from typing import Final

from rt_robot_os.devices.device import Device
from rt_robot_os.devices.hokuyo.wire import checksum
from rt_robot_os.devices.hokuyo.wire import LINE_CHARACTERS
from rt_robot_os.devices.maxbotix.wire import MaxBotixDecoder
from rt_robot_os.devices.nmea.wire import NmeaDecoder
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.ublox.wire import UbxDecoder
from rt_robot_os.devices.witmotion.wire import WitMotionDecoder
from rt_robot_os.devices.xsens.wire import XbusDecoder
from rt_robot_os.errors import ConfigError
from rt_robot_os.plugins import PluginRegistry


# What satellite receivers send; other devices, such as VectorNav's, speak in sentences too.
_OF_RECEIVERS: Final = frozenset(('GGA', 'GNS', 'RMC', 'GLL', 'GSA', 'GSV', 'GST', 'VTG', 'ZDA',
                                  'TXT', 'GBS', 'DTM'))
# Three packets of 20 bytes, one behind the other.
_BLUETOOTH_WITMOTION: Final = re.compile(rb'(?:\x55[\x61\x71].{18}){2}\x55[\x61\x71]',
                                         re.DOTALL).search


def _is_sentences(data: bytes) -> bool:
    return bool(NmeaDecoder().feed(data))


def _is_nmea(data: bytes) -> bool:
    return any(frame.address[2:] in _OF_RECEIVERS for frame in NmeaDecoder().feed(data))


def _is_bluetooth_witmotion(data: bytes) -> bool:
    return _BLUETOOTH_WITMOTION(data) is not None


def _is_ubx(data: bytes) -> bool:
    return any(frame.kind for frame in UbxDecoder().feed(data))


def _is_witmotion(data: bytes) -> bool:
    # One in 256 headers has a good sum by chance: ask for two frames that touch.
    return any(not frame.skipped for frame in WitMotionDecoder().feed(data)[1:])


def _is_xbus(data: bytes) -> bool:
    return any(frame.payload for frame in XbusDecoder().feed(data))


def _is_maxbotix(data: bytes) -> bool:
    decoder = MaxBotixDecoder()
    return len(decoder.feed(data)) > 1 and decoder.rejected_bytes < len(data) // 4


def _is_scip(data: bytes) -> bool:
    # A scan is longer than what is kept: look for its lines.
    lines = [line for line in data.split(b'\n')[1:-1] if len(line) == LINE_CHARACTERS + 1]
    return len(lines) > 2 and all(checksum(line[:-1]) == line[-1] for line in lines)


# What is asked for sure, with the driver's name; the surest first.
_KNOWN: Final[tuple[tuple[str, str, Callable[[bytes], bool]], ...]] = (
    ('UBX messages', 'ublox', _is_ubx),
    ('NMEA 0183 sentences', 'nmea', _is_nmea),
    ('Xbus messages', 'xsens', _is_xbus),
    ('SCIP scans', 'hokuyo', _is_scip),
    ('WitMotion frames', 'witmotion', _is_witmotion),
    ('MaxBotix readings', 'maxbotix', _is_maxbotix),
)
# What no driver here reads, and what to do.
_STRANGERS: Final[tuple[tuple[str, str, Callable[[bytes], bool]], ...]] = (
    ("packets of WitMotion's Bluetooth models (55 61)",
     'type: witmotion reads the serial models (55 51 to 55 5a): use one of those, or write a '
     'driver (docs/writing_a_driver.md)', _is_bluetooth_witmotion),
    ('sentences with a checksum, but none of a satellite receiver',
     'choose the driver of the device, or write one (docs/writing_a_driver.md)', _is_sentences),
)


_Recogniser = tuple[str, str, Callable[[bytes], bool]]


class ForeignRecognisers:
    """What the drivers of other packages know of their own bytes."""

    def __init__(self, registry: PluginRegistry[Device]) -> None:
        self._registry = registry
        self._found: tuple[_Recogniser, ...] | None = None

    def prepare(self) -> None:
        """Import them, once; not for the loop. One that is broken disturbs no other."""
        if self._found is not None:
            return
        found = []
        for name in self._registry.foreign_names():
            try:
                driver = self._registry.load(name)
            except ConfigError:
                continue  # it is told to who names it
            what, fits = getattr(driver, 'FRAMES', ''), getattr(driver, 'recognises', None)
            if isinstance(what, str) and what and callable(fits):
                found.append((what, name, fits))
        self._found = tuple(found)

    def all(self) -> tuple[_Recogniser, ...]:  # noqa: A003
        """Give those that were prepared."""
        return self._found or ()


FOREIGN: Final = ForeignRecognisers(DRIVERS)


def prepare_recognisers() -> None:
    """Import the drivers of other packages; not for the loop."""
    FOREIGN.prepare()


def recognised(data: bytes, baud: int) -> str:
    """
    Say whose bytes they are, and what to do; empty when that is not known.

    Other packages are asked first: their devices often speak a dialect of what is known here.

    :param data: what came last, some hundred bytes.
    :param baud: speed of the line.
    """
    for what, driver, fits in (*FOREIGN.all(), *_KNOWN):
        if _fits(fits, data):
            speed = f' at {baud} baud' if baud else ''
            return f'these are {what}{speed}: set type: {driver}, or swap the ports'
    return next((f'these are {what}: {remedy}' for what, remedy, fits in _STRANGERS if fits(data)),
                '')


def _fits(recognises: Callable[[bytes], bool], data: bytes) -> bool:
    try:
        return bool(recognises(data))
    except Exception:  # of another package, and the diagnosis of a device goes on without it
        return False
