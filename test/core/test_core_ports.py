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


"""The ports of modules and devices in a core: what is checked when a configuration is loaded."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.core.app import Core
from rt_robot_os.motion.mounting import Mounting

S = 1_000_000_000
MakeCore = Callable[[str], Core]


def test_two_inputs_of_one_topic_must_both_have_its_type(make_core: MakeCore) -> None:
    with pytest.raises(ConfigError, match="module it reads 'pose' as geometry_msgs/msg/Pose, but "
                                          'it is geometry_msgs/msg/Twist'):
        make_core('topics: [pose]\npose: {message: geometry_msgs/msg/Twist}\nmodules: [it]\n'
                  'it: {type: "core_port_modules:TwoInputs", rate_hz: 10.0}')


def test_a_guard_takes_nothing_but_commands(make_core: MakeCore) -> None:
    with pytest.raises(ConfigError, match="module guard reads 'imu/data' as geometry_msgs/msg/Twi"
                                          'st, but it is sensor_msgs/msg/Imu'):
        make_core('devices: [imu]\nimu: {type: witmotion, port: sim}\nmodules: [guard]\n'
                  'guard: {type: twist_guard, command_topic: imu/data}')


@pytest.mark.parametrize('kind', ['Mapper', 'LargeMapper'])
@pytest.mark.parametrize('logical', ['false', 'true'])
def test_a_module_publishes_messages_of_any_length(
        make_core: MakeCore, kind: str, logical: str) -> None:
    core = make_core(f'modules: [it]\nit: {{type: "core_port_modules:{kind}", rate_hz: 10.0, '
                     f'logical_execution: {logical}}}')
    reader = core.bus.subscribe('map', 'test')
    seen = []
    core.kernel.add_task('test', lambda: seen.append(list(reader.msg.data)) if reader.take()
                         else None, priority=10, rate_hz=100.0)
    core.prepare_modules()
    core.kernel.run(S // 2)
    assert seen[:4] == [[0], [0, 1], [0, 1, 2], [0, 1, 2, 3]]
    assert reader.msg.header.frame_id == 'map'
    assert reader.msg.info.width == len(seen[-1])


def test_a_module_knows_where_devices_are_before_it_runs(make_core: MakeCore) -> None:
    core = make_core(
        'devices: [laser]\nlaser: {type: hokuyo, port: sim, mounting_m: [0.1, 0.0, 0.3]}\n'
        'modules: [it]\nit: {type: "core_port_modules:Mounted", rate_hz: 10.0}')
    core.prepare_modules()
    assert getattr(core.modules[0], 'found') == Mounting((0.1, 0.0, 0.3))


def test_a_driver_that_sits_on_another_frame_knows_where_it_is_on_the_robot(make_core: MakeCore
                                                                            ) -> None:
    core = make_core(
        'devices: [plate, star]\n'
        'plate: {type: hokuyo, port: sim, frame_id: plate_link, mounting_m: [0.1, 0.0, 0.5], '
        'mounting_rad: [0.0, 0.0, 1.5707963267948966]}\n'
        "star: {type: stargazer, port: sim, landmarks: ['24578: 0.0, 0.0'], "
        'mounting_m: [0.2, 0.0, 0.1], parent_frame_id: plate_link}')
    star = next(each.device for each in core.sensors.devices if each.device.name == 'star')
    assert star.settings['parent_frame_id'] == 'base_link'
    assert star.settings['mounting_m'] == pytest.approx([0.1, 0.2, 0.6])
    assert star.settings['mounting_rad'] == pytest.approx([0.0, 0.0, 1.5707963267948966])
