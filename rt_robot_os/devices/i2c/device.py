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
The I2C device: everything between a bus and the registers of a chip.

A driver identifies its chip and then works in steps. A step performs one or two short transactions
and returns when the next one is due; until then a poll costs one comparison. So nothing ever
blocks on a chip: a conversion is started in one poll and fetched in a later one.

Nothing blocks on the bus either: ``data = yield self.fetch(register, size)`` starts a transaction,
and the job ends. When the answer has arrived the step continues after the ``yield``, in the job
released by the answer, or in that of the next poll.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Generator
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import ClassVar
from typing import Final
from typing import TypeVar

from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.base.units import period_from_rate
from rt_robot_os.devices.device import Device
from rt_robot_os.devices.device import DeviceStatistics
from rt_robot_os.devices.device import SamplePublisher
from rt_robot_os.devices.i2c.bus import BUSES
from rt_robot_os.devices.i2c.bus import I2cBus
from rt_robot_os.devices.i2c.bus import I2cBuses
from rt_robot_os.devices.i2c.bus import Transfer
from rt_robot_os.devices.signatures import known_chips

# One bad reading may be noise on the wires; this many in succession are an error.
_BAD_IN_A_ROW: Final = 3

T = TypeVar('T')

# A step with transactions: it yields each, and receives the bytes read.
Transactions = Generator[Transfer, bytes, T]
Step = Callable[[int], 'int | Transactions[int]']


def i2c_settings(
    *, address: int, addresses: tuple[int, ...], frame_id: str, topic: str, rate_hz: float,
    maximum_hz: float, rates_hz: tuple[float, ...] = (),
) -> tuple[Field, ...]:
    """
    Declare the settings that every I2C device has, with the defaults of one chip.

    :param addresses: all possible addresses of the chip.
    :param rate_hz: default of the rate of the samples.
    :param rates_hz: the only possible rates; empty allows all.
    """
    named = ' or '.join(f'{each} (0x{each:02x})' for each in addresses)
    return (
        Field('port', str, REQUIRED,
              'I2C bus such as /dev/i2c-1; sim is a simulated device.'),
        Field('address', int, address, f'Address on the bus: {named}.', choices=addresses),
        Field('frame_id', str, frame_id, 'Coordinate frame of the samples.'),
        Field('topic', str, topic, 'Topic of the samples.'),
        Field('depth', int, 16, 'Samples that each topic keeps.',
              choices=(2, 4, 8, 16, 32, 64, 128, 256, 512, 1024)),
        Field('output_rate_hz', float, rate_hz, 'Samples per second.', unit='Hz', minimum=0.05,
              maximum=maximum_hz, choices=rates_hz),
    )


class I2cDevice(Device):
    """
    A chip on an I2C bus.

    :ivar period_ns: time between two samples.
    :ivar buses: the open buses; a test may replace them.
    """

    SHARES_PORT: ClassVar[bool] = True
    ANSWERS: ClassVar[bool] = True
    IF_SILENT: ClassVar[str] = 'it answers but measures nothing: switch its power off and on'
    IF_GARBAGE: ClassVar[str] = (
        'check the wiring, the pull-up resistors and that no other device has its address')

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """Store the settings; nothing is opened."""
        super().__init__(name, settings)
        self.buses: I2cBuses = BUSES
        self._address: int = settings['address']
        self._bus: I2cBus | None = None
        self._step: Step = self._not_open
        self._under_way: Transactions[int] | None = None
        self._not_yielded: Transfer | None = None
        self._due_ns = 0
        self._grid_ns = 0
        self.period_ns = period_from_rate(settings['output_rate_hz'])
        self._bytes_read = 0
        self._frames = 0
        self._samples = 0
        self._rejected_frames = 0
        self._lost_samples = 0
        self._last_frame_ns = 0
        self._bad_in_a_row = 0

    @abstractmethod
    def identify(self) -> Transactions[object] | None:
        """
        Check that it is the right chip, and reset it.

        :raises DeviceError: it is not, or the bus failed.
        """

    @abstractmethod
    def begin(self, now_ns: int) -> int | Transactions[int]:
        """
        Run the first step after the chip was identified; each step calls :meth:`then`.

        :return: number of samples published; a step that yields returns it at its end.
        :raises DeviceError: the bus failed.
        """

    def then(self, step: Step, due_ns: int) -> int:
        """
        Schedule the next step, and its earliest time.

        :return: 0, the number of samples published.
        """
        self._step = step
        self._due_ns = due_ns
        return 0

    def bind(self, publishers: Sequence[SamplePublisher]) -> None:
        """
        Bind the publishers, and prepare the bridge and the table of chips.

        :raises TopicError: their number is not that of the publications.
        """
        super().bind(publishers)
        known_chips()
        self.buses.prepare(self.settings['port'])

    def open(self) -> None:  # noqa: A003
        """
        Acquire the bus and check for the chip; :meth:`read` receives the answer.

        :raises DeviceError: the bus cannot be opened, or has answered already that the chip is
            missing.
        """
        self.close()
        try:
            self._bus = self.buses.acquire(self.settings['port'])
        except DeviceError as error:
            raise DeviceError(f'{self.name}: {error}') from error
        self._bad_in_a_row = 0
        self.then(self._identify, 0)
        try:
            self.read(self.clock_ns())
        except DeviceError:
            self.close()
            raise

    def close(self) -> None:
        """Release the bus; may be called twice and does not raise."""
        self.then(self._not_open, 0)
        self._under_way = self._not_yielded = None
        bus, self._bus = self._bus, None
        if bus is not None:
            self.buses.release(bus)

    def fileno(self) -> int | None:
        """Return the descriptor that becomes readable with an answer; None for immediate ones."""
        return None if self._bus is None else self._bus.connection.fileno()

    def read(self, now_ns: int) -> int:
        """
        Continue the current step, or run the one that is due; safe in the loop.

        :raises DeviceError: the bus failed, or the chip has changed.
        """
        # Removed first: if the kernel aborts the job within a step, the step has ended.
        step, self._under_way = self._under_way, None
        if step is not None:
            return self._go_on(step, now_ns)
        if now_ns < self._due_ns:
            return 0
        self._not_yielded = None
        begun = self._step(now_ns)
        if isinstance(begun, int):
            return self._end(begun)
        try:
            self._ask(next(begun), now_ns)
        except StopIteration as end:
            return self._end(end.value)
        return self._go_on(begun, now_ns)

    def _go_on(self, step: Transactions[int], now_ns: int) -> int:
        """Pass a step its answers, as far as they have arrived."""
        bus = self._opened()
        try:
            while True:
                try:
                    answer = bus.answer(now_ns)
                except DeviceError as error:
                    named = DeviceError(f'{self.name}: {error}')
                    named.__cause__ = error
                    self._ask(step.throw(named), now_ns)
                    continue
                if answer is None:
                    self._under_way = step
                    return 0
                self._ask(step.send(answer), now_ns)
        except StopIteration as end:
            return self._end(end.value)

    def _ask(self, transfer: Transfer, now_ns: int) -> None:
        if transfer is self._not_yielded:
            self._not_yielded = None
        self._opened().begin(transfer, now_ns)

    def _end(self, samples: int) -> int:
        if self._not_yielded is not None:
            raise self._forgotten()
        self._samples += samples
        return samples

    def statistics(self) -> DeviceStatistics:
        """Return the current counters."""
        return DeviceStatistics(
            bytes_read=self._bytes_read, frames=self._frames, samples=self._samples,
            rejected_frames=self._rejected_frames, last_frame_ns=self._last_frame_ns,
            lost_samples=self._lost_samples)

    # ---- for drivers -------------------------------------------------------------------------

    def fetch(self, register: int, size: int) -> Transfer:
        """
        Return a transfer that reads registers, to be yielded.

        ``data = yield self.fetch(0xD0, 1)``. The ``yield`` raises DeviceError when the bus fails.
        """
        return self._made(bytes((register,)), size)

    def put(self, register: int, *data: int) -> Transfer:
        """
        Return a transfer that writes registers, to be yielded; without data it is a command.

        The ``yield`` raises DeviceError when the bus fails.
        """
        return self._made(bytes((register, *data)), 0)

    def start_grid(self, now_ns: int) -> None:
        """Start the grid of the samples now."""
        self._grid_ns = now_ns

    def advance(self, now_ns: int, step: Step) -> None:
        """Run a step at the next time of the grid; missed times count as lost samples."""
        self._grid_ns += self.period_ns
        late_ns = now_ns - self._grid_ns
        if late_ns >= self.period_ns:
            missed = late_ns // self.period_ns
            self._lost_samples += missed
            self._grid_ns += missed * self.period_ns
        self.then(step, self._grid_ns)

    def accept(self, stamp_ns: int) -> None:
        """Count a valid reading."""
        self._frames += 1
        self._bad_in_a_row = 0
        self._last_frame_ns = stamp_ns

    def reject(self, reason: str) -> int:
        """
        Count an impossible reading.

        :return: 0, the number of samples published.
        :raises DeviceError: too many in succession.
        """
        self._rejected_frames += 1
        self._bad_in_a_row += 1
        if self._bad_in_a_row >= _BAD_IN_A_ROW:
            raise DeviceError(f'{self.name}: {self.place}: {reason}: {self.IF_GARBAGE}')
        return 0

    def expect_chip(self, register: int, wanted: Sequence[int], chip: str) -> Transactions[int]:
        """
        Check the register with the chip id, with ``yield from``.

        :param chip: its name, for the error.
        :return: its value.
        :raises DeviceError: it is another chip; the message names the probable one.
        """
        found = (yield self.fetch(register, 1))[0]
        if found in wanted:
            return found
        ids = ' or '.join(f'0x{each:02x}' for each in wanted)
        probably = yield from self.probably()
        raise DeviceError(
            f'{self.name}: {self.place}: chip id 0x{found:02x} in register 0x{register:02x}, but '
            f'{chip} has {ids}: {probably}')

    def probably(self) -> Transactions[str]:
        """Identify the chip by transactions on the bus; return its probable name and a remedy."""
        for register, names in known_chips().items():
            name = names.get((yield self.fetch(register, 1))[0])
            if name is not None:
                return f'it is probably a {name}: change type or address'
        return 'an unknown chip: check type and address'

    @property
    def place(self) -> str:
        """Name bus and address."""
        return f'I2C bus {self.settings["port"]}, address 0x{self._address:02x}'

    def _made(self, data: bytes, size: int) -> Transfer:
        if self._not_yielded is not None:
            raise self._forgotten()
        self._not_yielded = Transfer(self._address, data, size)
        return self._not_yielded

    def _forgotten(self) -> DeviceError:
        made, self._not_yielded = self._not_yielded, None
        return DeviceError(f'{self.name}: its driver is defective: {made} was made and not '
                           'yielded: write `yield self.put(...)`, `yield self.fetch(...)`')

    def _identify(self, now_ns: int) -> Transactions[int]:
        found = self.identify()
        if found is not None:
            yield from found
        return self.then(self.begin, 0)

    def _not_open(self, now_ns: int) -> int:
        raise DeviceError(f'{self.name}: {self.place} is not open: call open() first')

    def _opened(self) -> I2cBus:
        if self._bus is None:
            raise DeviceError(f'{self.place} is not open: call open() first')
        return self._bus
