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

"""A simulated pulse oximeter says what is set, recorded or true of who wears it; read by ours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from rt_robot_os.base.errors import ConfigError
from rt_robot_os.features.health.oximeter.driver import Oximeter
from rt_robot_os.features.health.oximeter.simulated import SimulatedOximeter
from rt_robot_os.features.health.pulse_check.pulse_meter import PulseMeter
from rt_robot_os.sim.world import World
from rt_robot_os.sim.world_settings import WorldSettings
from rt_robot_os.testing import rig

STEP_MS = 100.0


def run(made: Any, seconds: float) -> None:
    made.run(seconds * 1000, STEP_MS)


def values(made: Any, index: int) -> list[Any]:
    return [sample.data for sample in made.publishers[index].samples]


def wave(made: Any) -> list[float]:
    return [float(level) for packet in made.publishers[2].samples for level in packet.data]


def test_its_wave_has_the_pulse_that_it_says(tmp_path: Path) -> None:
    with rig(tmp_path, SimulatedOximeter, Oximeter, sim={'pulse_per_min': 88.0}) as made:
        run(made, 14)
        assert set(values(made, 0)) == {88.0}
        assert set(values(made, 1)) == {97.0}
        assert values(made, 3)[-1] == 'measuring, perfusion good'
        meter = PulseMeter(75.0)
        meter.add(wave(made))
        assert meter.measure().rate_per_min == pytest.approx(88.0, abs=1.0)


def test_what_befalls_it_is_told_and_no_number_is_published(tmp_path: Path) -> None:
    for fault, state in (('off', 'no finger'), ('disconnect', 'disconnected'),
                         ('artefact', 'out of track')):
        with rig(tmp_path, SimulatedOximeter, Oximeter) as made:
            run(made, 2)
            made.simulated.inject(fault, 20.0)
            run(made, 8)
            before = len(values(made, 0))
            run(made, 2)
            assert values(made, 3)[-1].startswith(state)
            assert len(values(made, 0)) == before
            # The device shows the old numbers for ten seconds; nobody takes them for new ones.
            run(made, 12)
            assert len(values(made, 0)) > before


def test_a_monitors_numbers_are_played_and_its_zeros_are_a_sensor_that_is_off(
        data_dir: Path, tmp_path: Path) -> None:
    numerics = next((data_dir / 'vitals').glob('s25047*.csv'))
    with rig(tmp_path, SimulatedOximeter, Oximeter,
             sim={'numerics': str(numerics), 'faster': 30.0}) as made:
        run(made, 16)
        pulses, states = values(made, 0), values(made, 3)
    # Minutes 0 and 1 are zeros, minute 2 has 88.5 and 95.7, the next 68.5.
    assert states[0].startswith('no finger') and states[20].startswith('measuring')
    assert pulses[:2] == [88.0, 88.0] and 68.0 in pulses
    assert min(pulses) > 30.0


def test_a_recorded_wave_is_played_with_its_own_pulse(data_dir: Path, tmp_path: Path) -> None:
    record = data_dir / 'vitals' / 'a103l.hea'
    with rig(tmp_path, SimulatedOximeter, Oximeter, sim={'wave': str(record)}) as made:
        run(made, 25)
        assert values(made, 0)[-1] == pytest.approx(127.0, abs=3.0)
        meter = PulseMeter(75.0)
        meter.add(wave(made))
        assert meter.measure().rate_per_min == pytest.approx(127.0, abs=3.0)


def test_it_measures_who_wears_it(tmp_path: Path) -> None:
    world = World(WorldSettings(map='open', people=('anna 0 1.0 1.0',)))
    with rig(tmp_path, SimulatedOximeter, Oximeter, sim={'on': 'anna'}, world=world) as made:
        run(made, 2)
        assert values(made, 0)[-1] == pytest.approx(72.0, abs=15.0)
        world.inject('vital anna pulse_per_min 150'.split())
        world.inject('vital anna spo2_percent 84'.split())
        run(made, 2)
        assert (values(made, 0)[-1], values(made, 1)[-1]) == (150.0, 84.0)
        for sign in ('pulse_per_min', 'spo2_percent'):
            world.inject(['vital', 'anna', sign, '0'])
        run(made, 2)
        assert values(made, 3)[-1] == 'no finger'


def test_somebody_who_is_not_there_is_told(tmp_path: Path) -> None:
    world = World(WorldSettings(map='open', people=('anna 0 1.0 1.0',)))
    with pytest.raises(ConfigError, match='on: bert: there is no such person; there are anna'):
        with rig(tmp_path, SimulatedOximeter, Oximeter, sim={'on': 'bert'}, world=world):
            pass


@pytest.mark.parametrize('sim, message', [
    ({'numerics': '/nowhere.csv'}, '/nowhere.csv: .*name a CSV file'),
    ({'wave': '/nowhere.hea'}, 'name the header of a WFDB record')])
def test_a_recording_that_cannot_be_read_is_told(
        tmp_path: Path, sim: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        with rig(tmp_path, SimulatedOximeter, Oximeter, sim=sim):
            pass


def test_numbers_in_other_columns_are_told(tmp_path: Path) -> None:
    path = tmp_path / 'numbers.csv'
    path.write_text('time,heart\n1,2\n')
    with pytest.raises(ConfigError, match='must have the columns minute, PULSE or HR and SpO2'):
        with rig(tmp_path, SimulatedOximeter, Oximeter, sim={'numerics': str(path)}):
            pass
