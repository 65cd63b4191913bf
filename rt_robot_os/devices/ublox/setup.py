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
Set-up of a u-blox receiver: CFG-VALSET from generation 9 on, or CFG-MSG and CFG-RATE before.

A receiver does not report which of its ports a command came through, so its messages are enabled
for every port; it refuses those of missing ports. A receiver that refuses all is of generation 8
or older, and is set up accordingly. Nothing is saved in the receiver.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Final

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.serial.handshake import Handshake
from rt_robot_os.devices.serial.handshake import HandshakeStep
from rt_robot_os.devices.ublox import wire
from rt_robot_os.devices.ublox.wire import UbxFrame

_REMEDY: Final = ('check the wire to its receive pin, or set configure: false and set it up with '
                  "the maker's u-center")


class UbloxSetup:
    """
    The set-up of one receiver; safe in the loop.

    :ivar done: the set-up is complete.
    :ivar generation: 9 if it supports CFG-VALSET, 8 if not; 0 before that is known.
    """

    def __init__(self, name: str, rate_hz: float, *, high_precision: bool,
                 corrections: bool) -> None:
        """
        Begin.

        :param high_precision: enable NAV-HPPOSLLH too.
        :param corrections: enable RTCM 3 as input.
        """
        self.done = False
        self.generation = 0
        self._name = name
        self._rate_hz = rate_hz
        self._high_precision = high_precision
        self._corrections = corrections
        self._problem = ''
        self._handshake = Handshake(name, (), _REMEDY)
        self._script = self._modern()
        self._next(None)

    def due(self, now_ns: int) -> bytes | None:
        """
        Return the bytes to send now; None if there are none.

        :raises DeviceError: the receiver does not answer, or refuses a required command.
        """
        if self._problem:
            raise DeviceError(f'{self._name}: {self._problem}')
        return self._handshake.due(now_ns)

    def handle(self, frame: UbxFrame) -> bool:
        """Handle a message if it is the expected answer; return whether it was."""
        step = self._handshake.step
        if step is None or frame.kind != wire.ACK \
                or frame.payload != bytes((wire.CFG, step.key)):
            return False
        self._next(frame.identifier == wire.ACK_ACK)
        return True

    def _next(self, accepted: bool | None) -> None:
        try:
            step = next(self._script) if accepted is None else self._script.send(accepted)
        except StopIteration:
            self._handshake = Handshake(self._name, (), _REMEDY)
            self.done = not self._problem
            return
        self._handshake = Handshake(self._name, (step,), _REMEDY)

    def _modern(self) -> Generator[HandshakeStep, bool, None]:
        ports = []
        for port in wire.PORTS:
            if (yield _valset(f'NAV-PVT on {port.name}', {port.ubx_out: 1, port.nav_pvt: 1})):
                ports.append(port)
        if not ports:
            self.generation = 8
            yield from self._legacy()
            return
        self.generation = 9
        for wanted, name, remedy in (
                (self._high_precision, 'NAV-HPPOSLLH', 'it has no high-precision position: set '
                 'high_precision: false'),
                (self._corrections, 'RTCM 3',
                 'it accepts no corrections: leave corrections empty')):
            accepted = False
            for port in ports if wanted else ():
                key = port.rtcm_in if name == 'RTCM 3' else port.nav_hpposllh
                accepted |= yield _valset(f'{name} on {port.name}', {key: 1})
            if wanted and not accepted:
                self._problem = f'it refuses {name}: {remedy}'
                return
        rate = {wire.RATE_MEAS: round(1000 / self._rate_hz), wire.RATE_NAV: 1}
        if not (yield _valset('CFG-RATE', rate)):
            self._refuse('CFG-RATE')

    def _legacy(self) -> Generator[HandshakeStep, bool, None]:
        steps = [HandshakeStep('CFG-MSG', wire.enable(wire.PVT), wire.CFG_MSG)]
        if self._high_precision:
            steps.append(HandshakeStep('CFG-MSG of NAV-HPPOSLLH', wire.enable(wire.HPPOSLLH),
                                       wire.CFG_MSG))
        steps.append(HandshakeStep('CFG-RATE', wire.set_rate(self._rate_hz), wire.CFG_RATE))
        for step in steps:
            if not (yield step):
                self._refuse(step.name)
                return

    def _refuse(self, name: str) -> None:
        self._problem = (f'it refuses {name}: lower output_rate_hz, or set it up with u-center '
                         'and set configure: false')


def _valset(name: str, values: dict[int, int]) -> HandshakeStep:
    return HandshakeStep(f'CFG-VALSET ({name})', wire.valset(values), wire.CFG_VALSET)
