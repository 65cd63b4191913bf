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
Identify devices by their bytes: for the diagnosis of a device that sends no valid frame.

The most common mistakes are a wrong baud rate and two swapped ports. In the second case the bytes
identify the device, if a device in the table declares a signature for them, in this package or in
another.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
import functools
from typing import Any
from typing import Final
from typing import NamedTuple

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.plugins import load_object
from rt_robot_os.devices.parts import DeviceParts
from rt_robot_os.devices.registry import DRIVERS
from rt_robot_os.devices.table import all_parts


Chips = Mapping[int, Mapping[int, str]]

# Chips without a driver that are often confused with supported ones; registers in the order of
# reading.
WITHOUT_DRIVER: Final[Chips] = {
    0xD0: {0x60: 'BME280', 0x61: 'BME680', 0x55: 'BMP180'},
    0x00: {0xEA: 'ICM-20948'},
    0x75: {0x73: 'MPU-9255'},
}


class _Known(NamedTuple):
    """
    One signature, with its function imported.

    :ivar frames: a name for the bytes.
    :ivar remedy: what to do.
    :ivar fits: returns whether some bytes match.
    :ivar readable: a driver reads these bytes.
    """

    frames: str
    remedy: str
    fits: Callable[[bytes], Any]
    readable: bool


class SignatureTable:
    """The signatures of all devices."""

    def __init__(self) -> None:
        self._known: tuple[_Known, ...] | None = None

    def prepare(self) -> tuple[_Known, ...]:
        """Import them once, outside of the loop; one that is broken is left out."""
        if self._known is None:
            found = [each for name, parts in all_parts() for each in _known_of(name, parts)]
            # Signatures of bytes that a driver reads are checked first.
            self._known = tuple(sorted(found, key=lambda each: not each.readable))
        return self._known

    def identify(self, data: bytes, baud: int) -> str:
        """
        Return the device whose bytes they are, and what to do; empty if unknown.

        Signatures of other packages are checked first: their protocols are often variants of known
        ones. All signatures are checked until one matches, so it must not be called in the task of
        a device.

        :param data: the last bytes received, some hundred.
        :param baud: speed of the line.
        """
        for each in self.prepare():
            if _fits(each.fits, data):
                speed = f' at {baud} baud' if baud and each.readable else ''
                return f'these are {each.frames}{speed}: {each.remedy}'
        return ''


SIGNATURES: Final = SignatureTable()


@functools.cache
def known_chips() -> Chips:
    """Import the tables of chips on I2C once, so that the loop need not."""
    found: dict[int, dict[int, str]] = {
        register: dict(names) for register, names in WITHOUT_DRIVER.items()}
    for name, parts in all_parts():
        try:
            chips: Any = load_object(f'device {name!r}', parts.chips) if parts.chips else {}
            for register, names in chips.items():
                found.setdefault(register, {}).update(names)
        except Exception:  # a table of another package that cannot be used is left out
            continue
    return found


def _known_of(name: str, parts: DeviceParts) -> Iterator[_Known]:
    for each in parts.signatures:
        try:
            fits = load_object(f'device {name!r}', each.function)
        except ConfigError:
            continue
        if callable(fits):
            remedy = each.remedy or f'set type: {name}, or swap the ports'
            yield _Known(each.frames, remedy, fits, not each.remedy)
    if not parts.signatures and name in DRIVERS.foreign_names():
        yield from _known_of_class(name, parts)


def _known_of_class(name: str, parts: DeviceParts) -> Iterator[_Known]:
    """Yield the signature in the class of a driver, where none is declared; for one release."""
    try:
        driver = load_object(f'driver {name!r}', parts.driver)
    except ConfigError:
        return
    frames, fits = getattr(driver, 'FRAMES', ''), getattr(driver, 'recognises', None)
    if isinstance(frames, str) and frames and callable(fits):
        yield _Known(frames, f'set type: {name}, or swap the ports', fits, True)


def _fits(recognises: Callable[[bytes], Any], data: bytes) -> bool:
    try:
        return bool(recognises(data))
    except Exception:  # a broken signature of another package must not end the diagnosis
        return False
