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

A driver says how its chip is recognised and then works in steps. A step does one or two short
transactions and says when the next one is due; until then a poll costs a comparison. So nothing
ever waits for a chip: a conversion is started in one poll and fetched in a later one.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from collections.abc import Mapping
from collections.abc import Sequence
from typing import Any
from typing import ClassVar
from typing import Final

from rt_robot_os.drivers.device import Device
from rt_robot_os.drivers.device import DeviceStatistics
from rt_robot_os.drivers.device import SamplePublisher
from rt_robot_os.drivers.i2c import BUSES
from rt_robot_os.drivers.i2c import I2cBus
from rt_robot_os.drivers.i2c import I2cBuses
from rt_robot_os.drivers.i2c import preload
from rt_robot_os.errors import DeviceError
from rt_robot_os.schema import Field
from rt_robot_os.schema import REQUIRED
from rt_robot_os.units import period_from_rate

# What stands where in chips that are often taken for each other: register -> value -> chip.
KNOWN_CHIPS: Final[Mapping[int, Mapping[int, str]]] = {
    0xD0: {0x58: 'BMP280', 0x56: 'BMP280 (sample)', 0x57: 'BMP280 (sample)', 0x60: 'BME280',
           0x61: 'BME680', 0x55: 'BMP180'},
    0x00: {0x50: 'BMP388', 0x60: 'BMP390', 0xA0: 'BNO055', 0xEA: 'ICM-20948'},
    0x75: {0x68: 'MPU-6050', 0x70: 'MPU-6500', 0x71: 'MPU-9250', 0x73: 'MPU-9255'},
}
# One bad reading may be noise on the wires; so many one after the other are not.
_BAD_IN_A_ROW: Final = 3

Step = Callable[[int], int]


def i2c_settings(
    *, address: int, addresses: tuple[int, ...], frame_id: str, topic: str, rate_hz: float,
    maximum_hz: float, rates_hz: tuple[float, ...] = (),
) -> tuple[Field, ...]:
    """
    Declare the settings that every I2C device has, with the defaults of one chip.

    :param addresses: all that the chip can have.
    :param rate_hz: default of the rate of the samples.
    :param rates_hz: the only rates it has; empty allows all.
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
        Field('output_rate_hz', float, rate_hz, 'Samples a second.', unit='Hz', minimum=0.05,
              maximum=maximum_hz, choices=rates_hz),
    )


class I2cDevice(Device):
    """
    A chip on an I2C bus.

    :ivar period_ns: between two samples.
    :ivar buses: where the bus is taken from; a test may put others in its place.
    """

    SHARES_PORT: ClassVar[bool] = True
    IF_SILENT: ClassVar[str] = 'it answers but measures nothing: switch its power off and on'
    IF_GARBAGE: ClassVar[str] = (
        'check the wiring, the pull-up resistors and that no other device has its address')

    def __init__(self, name: str, settings: Mapping[str, Any]) -> None:
        """Keep the settings; nothing is opened."""
        super().__init__(name, settings)
        self.buses: I2cBuses = BUSES
        self._address: int = settings['address']
        self._bus: I2cBus | None = None
        self._step: Step = self._not_open
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
    def identify(self) -> None:
        """
        Check that it is the right chip, and reset it; not in the loop.

        :raises DeviceError: it is not, or the bus failed.
        """

    @abstractmethod
    def begin(self, now_ns: int) -> int:
        """
        Do the first step after opening; it and each other calls :meth:`then`.

        :return: number of samples published.
        :raises DeviceError: the bus failed.
        """

    def then(self, step: Step, due_ns: int) -> int:
        """
        Say what is done next, and not before when.

        :return: 0, the number of samples published.
        """
        self._step = step
        self._due_ns = due_ns
        return 0

    def bind(self, publishers: Sequence[SamplePublisher]) -> None:
        """
        Take the publishers, and import what opening the bus needs.

        :raises TopicError: there are more or fewer of them than publications.
        """
        super().bind(publishers)
        preload()

    def open(self) -> None:  # noqa: A003
        """
        Take the bus and look whether the chip is there.

        :raises DeviceError: the bus cannot be opened, or the chip is not there.
        """
        self.close()
        try:
            self._bus = self.buses.take(self.settings['port'])
        except DeviceError as error:
            raise DeviceError(f'{self.name}: {error}') from error
        self._bad_in_a_row = 0
        try:
            self.identify()
        except DeviceError:
            self.close()
            raise
        self.then(self.begin, 0)

    def close(self) -> None:
        """Give the bus back; may be called twice and does not raise."""
        self.then(self._not_open, 0)
        bus, self._bus = self._bus, None
        if bus is not None:
            self.buses.give_back(bus)

    def read(self, now_ns: int) -> int:
        """
        Do the step that is due, if one is; safe in the loop.

        :raises DeviceError: the bus failed, or the chip is not what it was.
        """
        if now_ns < self._due_ns:
            return 0
        samples = self._step(now_ns)
        self._samples += samples
        return samples

    def statistics(self) -> DeviceStatistics:
        """Give the counters as they are now."""
        return DeviceStatistics(
            bytes_read=self._bytes_read, frames=self._frames, samples=self._samples,
            rejected_frames=self._rejected_frames, last_frame_ns=self._last_frame_ns,
            lost_samples=self._lost_samples)

    # ---- for drivers -------------------------------------------------------------------------

    def fetch(self, register: int, size: int) -> bytes:
        """
        Read registers.

        :raises DeviceError: the bus failed or is not open.
        """
        try:
            return self._opened().read_block(self._address, register, size)
        except DeviceError as error:
            raise DeviceError(f'{self.name}: {error}') from error

    def put(self, register: int, *data: int) -> None:
        """
        Write registers; without data the register is a command.

        :raises DeviceError: the bus failed or is not open.
        """
        try:
            self._opened().write_block(self._address, register, bytes(data))
        except DeviceError as error:
            raise DeviceError(f'{self.name}: {error}') from error

    def start_grid(self, now_ns: int) -> None:
        """Let the grid of the samples begin now."""
        self._grid_ns = now_ns

    def advance(self, now_ns: int, step: Step) -> None:
        """Do a step at the next moment of the grid; those that were missed count as lost."""
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
        Count a reading that cannot be right.

        :return: 0, the number of samples published.
        :raises DeviceError: it was not the first one.
        """
        self._rejected_frames += 1
        self._bad_in_a_row += 1
        if self._bad_in_a_row >= _BAD_IN_A_ROW:
            raise DeviceError(f'{self.name}: {self.place}: {reason}: {self.IF_GARBAGE}')
        return 0

    def expect_chip(self, register: int, wanted: Sequence[int], chip: str) -> int:
        """
        Read the register that tells the chip.

        :param chip: its name, for the error.
        :return: what it holds.
        :raises DeviceError: it is another chip; the message says which it probably is.
        """
        found = self.fetch(register, 1)[0]
        if found in wanted:
            return found
        ids = ' or '.join(f'0x{each:02x}' for each in wanted)
        raise DeviceError(
            f'{self.name}: {self.place}: chip id 0x{found:02x} in register 0x{register:02x}, but '
            f'{chip} has {ids}: {self.probably()}')

    def probably(self) -> str:
        """Say which chip it probably is and what to do; asks the bus, not for the loop."""
        for register, names in KNOWN_CHIPS.items():
            name = names.get(self.fetch(register, 1)[0])
            if name is not None:
                return f'it is probably a {name}: change type or address'
        return 'a chip that is not known here: check type and address'

    @property
    def place(self) -> str:
        """Name bus and address."""
        return f'I2C bus {self.settings["port"]}, address 0x{self._address:02x}'

    def _not_open(self, now_ns: int) -> int:
        raise DeviceError(f'{self.name}: {self.place} is not open: call open() first')

    def _opened(self) -> I2cBus:
        if self._bus is None:
            raise DeviceError(f'{self.place} is not open: call open() first')
        return self._bus
