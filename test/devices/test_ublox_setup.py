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

"""Is a u-blox receiver of each generation set up, and told what it refuses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from driver_fakes import scripted
from hypothesis import given
from hypothesis import strategies as st
import pytest
from rt_robot_os.base.errors import DeviceError
from rt_robot_os.devices.ublox import wire
from rt_robot_os.devices.ublox.driver import Ublox
from rt_robot_os.devices.ublox.simulated import SimulatedUblox
from rt_robot_os.testing import rig

MS = 1_000_000


def run(tmp_path: Path, sim: dict[str, Any], milliseconds: int = 3000, **settings: Any
        ) -> tuple[Any, str, list[float]]:
    """Let the driver set the receiver up; give it, what it says and the times of its fixes."""
    with rig(tmp_path, SimulatedUblox, Ublox, sim=sim, configure=True, output_rate_hz=5.0,
             **settings) as made:
        said = ''

        def each(now_ns: int) -> None:
            if now_ns % (20 * MS) == 0:
                made.device.write(now_ns)

        try:
            made.run(milliseconds, each=each)
        except DeviceError as error:
            said = str(error)
        stamps = [stamp / 1e9 for stamp in made.publishers[0].stamps]
        return made.device, said, stamps


@pytest.mark.parametrize('generation, found', [(8, 8), (9, 9), (10, 9)])
def test_each_generation_is_set_up(tmp_path: Path, generation: int, found: int) -> None:
    device, said, stamps = run(tmp_path, {'generation': generation})
    assert said == '' and device.is_set_up() and device._setup.generation == found
    steps = [b - a for a, b in zip(stamps[-6:], stamps[-5:])]
    assert steps == pytest.approx([0.2] * 5, abs=0.01)
    assert device.statistics().rejected_bytes == 0


@pytest.mark.parametrize('generation, settings, refused', [
    (10, {'high_precision': True}, 'it refuses NAV-HPPOSLLH: it has no high-precision position: '
     'set high_precision: false'),
    (10, {'corrections': '/dev/ttyUSB7'}, 'it refuses RTCM 3: it accepts no corrections: leave'),
    (9, {}, ''), (9, {'high_precision': True}, '')])
def test_what_a_receiver_does_not_have_is_told(
        tmp_path: Path, generation: int, settings: dict[str, Any], refused: str) -> None:
    _, said, _ = run(tmp_path, {'generation': generation}, **settings)
    assert refused in said and bool(said) == bool(refused)


def test_a_receiver_that_refuses_everything_is_told(tmp_path: Path) -> None:
    _, said, _ = run(tmp_path, {'refuses': True})
    assert said.startswith('dut: it refuses CFG-MSG: lower output_rate_hz, or set it up with')


def test_a_receiver_that_does_not_hear_is_told(tmp_path: Path) -> None:
    with scripted(Ublox, [b''] * 20, configure=True) as (device, _):
        with pytest.raises(DeviceError, match='does not answer CFG-VALSET .NAV-PVT on UART1.* '
                                              'check the wire to its receive pin'):
            for i in range(10):
                device.write(i * 200 * MS)


def test_a_rate_that_is_refused() -> None:
    answers = [wire.acknowledge(6, 0x8A)] * 3 + [wire.acknowledge(6, 0x8A, done=False)]
    with scripted(Ublox, answers, configure=True, output_rate_hz=50.0) as (device, _):
        with pytest.raises(DeviceError, match='it refuses CFG-RATE: lower output_rate_hz'):
            for i in range(5):
                device.write(i)
                device.read(i)


# Made with pyubx2 1.4.0, UBXMessage.config_set.
VALSET = ('b562068a130000010000070091200134009120010100741001c950',
          'b562068a10000001000001002130c8000200213001000f4d')


def test_values_are_set_as_the_interface_description_says() -> None:
    port = wire.PORTS[0]
    assert wire.valset({port.nav_pvt: 1, port.nav_hpposllh: 1, port.ubx_out: 1}).hex() \
        == VALSET[0]
    assert wire.valset({wire.RATE_MEAS: 200, wire.RATE_NAV: 1}).hex() == VALSET[1]


KEYS = st.sampled_from([key for port in wire.PORTS for key in port[1:]] + [wire.RATE_MEAS])


@given(st.dictionaries(KEYS, st.integers(0, 255), max_size=12))
def test_what_is_set_can_be_read(values: dict[int, int]) -> None:
    assert wire.parse_valset(wire.valset(values)[6:-2]) == values


@given(st.binary(max_size=40))
def test_any_bytes_are_values_or_none(payload: bytes) -> None:
    found = wire.parse_valset(payload)
    assert found is None or isinstance(found, dict)
