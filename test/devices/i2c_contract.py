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
What every driver of an I2C chip has to do; a driver's test inherits it.

    class TestMyChip(I2cContract):
        driver = MyChip
        simulator = SimulatedMyChip
"""

from __future__ import annotations

import errno
import math
import random
from typing import Any
from typing import ClassVar

from driver_fakes import bind
from driver_fakes import settings_of
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from i2c_bench import ERRORS
from i2c_bench import failing
from i2c_bench import i2c_rig
from i2c_bench import I2cRig
from i2c_bench import LateBuses
from i2c_bench import MS
from i2c_bench import S
from i2c_bench import ScriptedTransport
from i2c_bench import START_NS
import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.base.errors import TopicError
from rt_robot_os.devices.i2c.bus import I2cBuses
from rt_robot_os.devices.i2c.device import I2cDevice
from rt_robot_os.devices.i2c.simulated_device import SimulatedChip


class I2cContract:
    """
    The contract.

    :cvar driver: the class under test.
    :cvar simulator: its simulated device.
    :cvar named: what the errors call the chip.
    :cvar stranger: what is said of the chip that the fault wrong puts in its place.
    """

    driver: ClassVar[type[I2cDevice]]
    simulator: ClassVar[type[SimulatedChip]]
    named: ClassVar[str]
    stranger: ClassVar[str]

    def rig(self, sim: dict[str, Any] | None = None, **more: Any) -> Any:
        return i2c_rig(self.simulator, self.driver, sim, **more)

    def per_second(self, rig: I2cRig) -> float:
        """Give the samples a second, on all topics."""
        return float(sum(p.rate_hz for p in rig.device.publications()))

    # --- samples -------------------------------------------------------------------------------

    def test_samples_come_at_their_rate(self) -> None:
        with self.rig() as rig:
            rig.run(1000)
            before = rig.device.statistics()
            samples = rig.run(4000)
            statistics = rig.device.statistics()
            assert samples == pytest.approx(4 * self.per_second(rig), rel=0.03)
            assert statistics.samples - before.samples == samples
            assert statistics.rejected_frames == statistics.lost_samples == 0
            assert statistics.frames == len(rig.publishers[0].samples)

    def test_stamps_rise_and_are_of_the_past(self) -> None:
        with self.rig() as rig:
            seen: list[int] = []

            def look(now_ns: int) -> None:
                stamps = rig.publishers[0].stamps
                if len(stamps) > len(seen):
                    seen.append(now_ns)
                    assert now_ns - 60 * MS < stamps[-1] <= now_ns

            rig.run(2000, step_ms=3.0, each=look)
            for publisher in rig.publishers:
                stamps = publisher.stamps
                assert all(a < b for a, b in zip(stamps, stamps[1:]))
            assert rig.device.statistics().last_frame_ns == rig.publishers[0].stamps[-1]

    def test_an_idle_poll_uses_no_bus(self) -> None:
        with self.rig() as rig:
            rig.run(1000)
            transfers = rig.port.bus.transfers
            rig.device.then(rig.device.begin, rig.now_ns + S)
            rig.run(500)
            assert rig.port.bus.transfers == transfers

    def test_nothing_waits_for_the_chip(self) -> None:
        # Real time passes only on the wire: all else would show as time that no transfer took.
        with self.rig() as rig:
            longest = 0

            def look(now_ns: int) -> None:
                nonlocal longest
                longest, rig.bus_ns = max(longest, rig.bus_ns), 0

            rig.run(2000, each=look)
            assert 0 < longest < 3 * MS

    # --- answers that come later ---------------------------------------------------------------

    def late_rig(self, sim: dict[str, Any] | None = None) -> Any:
        """Give a rig whose answers are there with the next poll."""
        rig = I2cRig(self.simulator, self.driver, sim or {}, {})
        rig.device.buses = LateBuses(rig.open_bus)
        rig.device.open()
        return rig

    def test_samples_keep_their_rate_when_answers_come_later(self) -> None:
        rig = self.late_rig()
        rig.run(1000, step_ms=0.25)
        before = rig.device.statistics()
        samples = rig.run(3000, step_ms=0.25)
        statistics = rig.device.statistics()
        assert samples == pytest.approx(3 * self.per_second(rig), rel=0.05)
        assert statistics.lost_samples == before.lost_samples
        assert statistics.rejected_frames == 0
        stamps = rig.publishers[0].stamps
        assert all(a < b for a, b in zip(stamps, stamps[1:]))
        rig.device.close()

    @pytest.mark.parametrize('fault, said', [
        ('nack', 'no device answers'), ('wrong', 'it is probably a'), ('hold', 'SDA or SCL low'),
        ('vanish', 'the bus is gone')])
    def test_what_is_wrong_is_told_when_answers_come_later(self, fault: str, said: str) -> None:
        rig = self.late_rig({'faults': [f'{fault} at 0 for 100']})
        assert said in rig.run_until_error(500)
        rig.device.close()
        assert rig.device.buses.open_count == 0

    def test_a_job_that_is_aborted_anywhere_spoils_nothing(self) -> None:
        class Aborted(BaseException):
            pass

        for at in range(1, 12):
            rig = self.late_rig()
            rig.run(800, step_ms=0.25)
            begin, calls = rig.device._bus.begin, 0

            def cut(transfer: Any, now_ns: int) -> None:
                nonlocal calls
                calls += 1
                begin(transfer, now_ns)
                if calls == at:
                    raise Aborted

            rig.device._bus.begin = cut
            with pytest.raises(Aborted):
                rig.run(2000, step_ms=0.25)
            rig.run(500, step_ms=0.25)
            assert rig.run(1000, step_ms=0.25) == pytest.approx(self.per_second(rig), rel=0.1)
            rig.device.close()

    # --- the chip and the bus ------------------------------------------------------------------

    def test_another_chip_is_named_when_it_is_opened(self) -> None:
        with self.rig({'faults': ['wrong at 0 for 100']}, is_open=False) as rig:
            with pytest.raises(DeviceError) as caught:
                rig.device.open()
            text = str(caught.value)
            address = f'address 0x{rig.chip.address:02x}'
            for part in ('dut: I2C bus /dev/i2c-7', address, self.named, self.stranger,
                         'change type or address'):
                assert part in text, text
            assert rig.device.buses.open_count == 0

    def test_a_chip_that_nobody_knows(self) -> None:
        rig = I2cRig(self.simulator, self.driver, {}, {})
        rig.device.buses = I2cBuses(lambda path: ScriptedTransport(lambda d, n: b'\x13' * n))
        with pytest.raises(DeviceError, match='an unknown chip: check type and address'):
            rig.device.open()

    @pytest.mark.parametrize('fault', ['nack', 'unplug'])
    def test_a_chip_that_is_not_there(self, fault: str) -> None:
        with self.rig({'faults': [f'{fault} at 0 for 100']}, is_open=False) as rig:
            with pytest.raises(DeviceError, match='dut: .*no device answers: check its power.*'
                               r'\(i2cdetect -y 7 lists'):
                rig.device.open()

    @pytest.mark.parametrize('fault', ['nack', 'unplug'])
    def test_a_chip_that_goes_and_comes_back(self, fault: str) -> None:
        with self.rig() as rig:
            assert rig.run(1000)
            rig.chip.inject(fault, 1.0)
            assert 'no device answers' in rig.run_until_error(1000)
            with pytest.raises(DeviceError):
                rig.device.open()
            rig.now_ns += S
            rig.device.open()
            rig.run(500)
            samples = rig.run(2000)
            assert samples == pytest.approx(2 * self.per_second(rig), rel=0.05)

    def test_power_that_is_away_between_two_polls_is_noticed(self) -> None:
        with self.rig() as rig:
            rig.run(1000)
            rig.chip.inject('unplug', 0.0001)
            rig.chip.pump = None
            rig.chip.update(rig.now_ns)
            rig.now_ns += MS
            text = rig.run_until_error(1500)
            statistics = rig.device.statistics()
            if not text:  # it set itself up again
                assert statistics.frames and rig.run(1000) > 0.8 * self.per_second(rig)
                return
            assert 'power' in text
            rig.device.open()
            rig.run(500)
            assert rig.run(1000) == pytest.approx(self.per_second(rig), rel=0.05)

    def test_a_bus_that_is_held_low(self) -> None:
        with self.rig() as rig:
            rig.run(1000)
            rig.chip.inject('hold', 1.0)
            rig.chip.update(rig.now_ns)
            assert 'a device holds SDA or SCL low' in rig.run_until_error(500)

    def test_a_bus_that_goes_away_is_opened_anew(self) -> None:
        with self.rig() as rig:
            rig.run(1000)
            rig.chip.inject('vanish', 0.2)
            rig.chip.update(rig.now_ns)
            assert 'the bus is gone' in rig.run_until_error(500)
            rig.now_ns += S
            rig.device.open()
            assert rig.opened == 2
            assert rig.run(1000) > 0

    def test_a_chip_that_measures_no_more_gives_no_samples(self) -> None:
        with self.rig() as rig:
            rig.run(1000)
            rig.chip.inject('silent', 2.0)
            rig.chip.update(rig.now_ns)
            rig.run_until_error(50)
            frames = rig.device.statistics().frames
            rig.run_until_error(1000)
            assert rig.device.statistics().frames <= frames + (
                30 if getattr(rig.device, '_normal', False) else 0)

    def test_garbage_raises_nothing_but_says_so(self) -> None:
        with self.rig() as rig:
            rig.run(1000)
            rig.chip.inject('garbage', 100.0)
            errors = []
            for _ in range(20):
                errors.append(rig.run_until_error(500))
                try:
                    rig.device.open()
                except DeviceError as error:
                    errors.append(str(error))
            assert any(errors)
            assert all(e.startswith('dut: I2C bus') for e in errors if e)

    def test_flipped_bits_are_survived(self) -> None:
        with self.rig({'corrupt_probability': 0.01}) as rig:
            rig.run(1000)
            rig.chip.inject('corrupt', 4.0)
            while rig.now_ns < START_NS + 5 * S:
                rig.run_until_error(100)
                if rig.device.statistics().rejected_frames > 50:
                    break
            rig.now_ns += 5 * S
            rig.device.open()
            rig.run(500)
            assert rig.run(1000) == pytest.approx(self.per_second(rig), rel=0.05)

    @pytest.mark.parametrize('number', ERRORS)
    def test_every_error_of_linux_names_device_bus_address_and_remedy(self, number: int) -> None:
        rig = I2cRig(self.simulator, self.driver, {}, {})
        rig.device.open()
        rig.run(500)
        rig.device._bus.connection.transport = ScriptedTransport(failing(number))
        text = rig.run_until_error(2000)
        assert text.startswith(
            f'dut: I2C bus /dev/i2c-7, address 0x{rig.chip.address:02x}: '), text
        assert any(word in text for word in ('check', 'switch', 'unloaded', 'shorten', 'use '))

    def test_an_adapter_that_gives_too_little(self) -> None:
        rig = I2cRig(self.simulator, self.driver, {}, {})
        rig.device.buses = I2cBuses(lambda path: ScriptedTransport(lambda d, n: b''))
        with pytest.raises(DeviceError, match='0 bytes arrived instead of the requested .'):
            rig.device.open()

    def test_any_bytes_raise_nothing_else(self) -> None:
        @settings(max_examples=40, deadline=None)
        @given(number=st.integers(), whole=st.booleans())
        def check(number: int, whole: bool) -> None:
            seed = random.Random(number)
            rig = I2cRig(self.simulator, self.driver, {}, {})
            rig.device.open()
            rig.run(400)
            true = rig.device._bus.connection.transport

            def answer(data: bytes, size: int) -> bytes:
                told: bytes = true.transfer(rig.chip.address, data, size)
                if whole or seed.random() < 0.3:
                    return seed.randbytes(size)
                return told

            rig.device._bus.connection.transport = ScriptedTransport(answer)
            rig.run_until_error(400)
            for publisher in rig.publishers:
                for sample in publisher.values:
                    self.check_finite(sample)

        check()

    def check_finite(self, values: Any) -> None:
        for value in values:
            if isinstance(value, tuple):
                self.check_finite(value)
            else:
                assert math.isfinite(value)

    # --- the contract with the SensorManager ---------------------------------------------------

    def test_open_and_close_may_be_repeated(self) -> None:
        with self.rig() as rig:
            rig.device.open()
            rig.run(500)
            rig.device.close()
            rig.device.close()
            assert rig.device.buses.open_count == 0
            assert rig.device.fileno() is None
            rig.device.open()
            assert rig.run(1000) > 0

    def test_reading_before_opening_is_an_error(self) -> None:
        device = self.driver('dut', settings_of(self.driver, port='x'))
        bind(device)
        with pytest.raises(DeviceError, match=r'dut: .*call open\(\)'):
            device.read(S)

    def test_a_bus_that_does_not_exist(self) -> None:
        device = self.driver('dut', settings_of(self.driver, port='/dev/i2c-991'))
        with pytest.raises(DeviceError, match='dut: I2C bus /dev/i2c-991 does not exist: ls /dev'):
            device.open()

    def test_publications_name_topic_type_and_what_is_fixed(self) -> None:
        device = self.driver('dut', settings_of(self.driver, port='x'))
        for publication in device.publications():
            assert publication.topic and publication.fixed['header.frame_id']
            assert publication.rate_hz == device.settings['output_rate_hz']
        topics = [f.name for f in self.driver.SETTINGS if f.name.endswith('_topic')]
        alone = self.driver('dut', settings_of(
            self.driver, port='x', **dict.fromkeys(topics, '')))
        assert len(alone.publications()) == 1
        with pytest.raises(TopicError, match='dut: '):
            device.bind([])

    def test_without_the_other_topics_the_main_one_is_published(self) -> None:
        topics = [f.name for f in self.driver.SETTINGS if f.name.endswith('_topic')]
        with self.rig(**dict.fromkeys(topics, '')) as rig:
            rig.run(500)
            samples = rig.run(1000)
            assert samples == pytest.approx(rig.device.settings['output_rate_hz'], rel=0.05)

    def test_settings_have_names_descriptions_and_valid_defaults(self) -> None:
        for cls in (self.driver, self.simulator):
            names = [f.name for f in cls.SETTINGS]
            assert len(names) == len(set(names))
            assert all(f.description.endswith('.') for f in cls.SETTINGS)
        assert self.driver.description and self.driver.SHARES_PORT

    def test_a_change_of_what_is_not_live_is_refused(self) -> None:
        device = self.driver('dut', settings_of(self.driver, port='x'))
        with pytest.raises(ConfigError, match='dut.port cannot be changed while'):
            device.change('port', 'y')

    def test_errors_are_errno_free(self) -> None:
        # A DeviceError says all in its text; nobody may mistake it for one of the system.
        rig = I2cRig(self.simulator, self.driver, {'faults': ['nack at 0 for 9']}, {})
        with pytest.raises(DeviceError) as caught:
            rig.device.open()
        assert caught.value.errno is None
        assert isinstance(caught.value.__cause__, DeviceError)
        cause = caught.value.__cause__.__cause__
        assert isinstance(cause, OSError) and cause.errno == errno.EREMOTEIO
