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
Write the page of all keys from the declarations that check them.

``python3 -m rt_robot_os.settings.describe > docs/configuration.md``
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence
import sys
from typing import Final

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.schema import declared
from rt_robot_os.base.schema import Field
from rt_robot_os.base.schema import REQUIRED
from rt_robot_os.settings.catalogue import Catalogue
from rt_robot_os.settings.catalogue import Lookup
from rt_robot_os.settings.installed import installed
from rt_robot_os.settings.model import DeviceSettings
from rt_robot_os.settings.model import MirrorSettings
from rt_robot_os.settings.model import ModuleSettings
from rt_robot_os.settings.model import RobotSettings
from rt_robot_os.settings.model import TaskSettings
from rt_robot_os.settings.model import TopicSettings
from rt_robot_os.settings.problems import description_of
from rt_robot_os.settings.process_model import CoreSettings
from rt_robot_os.settings.process_model import LogSettings
from rt_robot_os.settings.process_model import WatchdogSettings
from rt_robot_os.settings.service_model import ServiceSettings
from rt_robot_os.settings.tree import show
from rt_robot_os.sim.world_settings import WorldSettings

_HEAD: Final = """\
# Configuration

Written by `python3 -m rt_robot_os.settings.describe`; do not edit it here.

The configuration is a ROS 2 parameter file: lists of names under the node's name, then a section
for each name. `config/robot.yaml` is a complete one with simulated devices, `config/serial.yaml`
one with real ports.

```yaml
robot:
  ros__parameters:
    devices: [imu]
    imu: {type: witmotion, port: /dev/ttyUSB0, baud: 115200, frame_id: imu_link}
    mirrors: [imu_data]
    imu_data: {topic: imu/data}
```

```
ros2 run rt_robot_os robot --ros-args --params-file my_robot.yaml -p imu.rate_hz:=100.0
```

Without a parameter file the shipped `robot.yaml` is used: its devices are simulated, which the
first line, `/diagnostics` (a warning) and `top` report. `robot --simulate` confirms it; with
`--params-file` it simulates the devices of that file, whatever their ports.

A device or a module is disabled with `-p gps.enabled:=false`, or by a list on the command line
without it: `-p "devices:=[imu]"`. Its section is still checked. Its topics remain without samples,
so that its mirrors and readers need no change. A mirror that is not in such a list is removed.

## How it is read

- All problems are reported together, with file, line, key, value and remedy, before anything is
  opened: `robot.yaml:14: imu.baud = 'fast': must be an integer from ...`.
- Several files are merged key by key; later ones win, and the command line wins over all files.
  (In rcl a `-p` loses to the node's own section when the file also has `/**`.)
- `robot:`, `/robot:`, `/lab: {robot: ...}` and `/lab/robot:` name the node as in every ROS 2 file.
  The wildcards `*` (one name) and `**` (any number) work, in the order of the file.
- Values follow the rules of ROS 2: `yes` and `on` are true, `010` is eight, `1e3` is a number,
  `"5"` is a string. An integer is accepted as a float. A list has one type.
- A key that is given twice, an unknown key, a key without value, an alias, a section in no list:
  each is an error. Only `use_sim_time`, `start_type_description_service` and `qos_overrides`
  belong to ROS 2 and are ignored.
- Names of sections consist of letters, digits and `_`; each belongs to one list.
- *Live* keys can be changed while the robot runs: `ros2 param set /robot imu.rate_hz 50.0`.
"""

_DEVICE_TEXT: Final = """\
Each name in `devices` has a section with these keys and those of its driver. With `port: sim` the
device is simulated: a pseudo-terminal or an emulated I2C bus sends its bytes, according to its
section `sim` (below, with each driver). With any other port the section `sim` is checked but not
used.
"""

_MODULE_TEXT: Final = """\
Each name in `modules` has a section with these keys and those of its class.
"""

_TASK_TEXT: Final = """\
The section of a device or a module may also have these keys for its task. Contradictions are
refused: a budget above the period with `on_budget: abort`, a deadline that no overrun policy can
meet, `failure: safe_state` for a class without a method `safe_state()`, modules that release each
other in a cycle. So is a new rate that would cause one.

With `failure: restart` a module is deactivated and activated again, not configured; a device is
closed and opened again. A task that was stopped or is in its safe state is held until it is
re-armed: `ros2 service call /robot/rearm std_srvs/srv/Trigger`.
"""

_LOG_TEXT: Final = """\
The node writes the reports of the core, its devices and modules; see `docs/logging.md`.
"""

_WATCHDOG_TEXT: Final = """\
It watches the tasks with `critical: true`; see `docs/watchdog.md`.
"""

_WORLD_TEXT: Final = """\
The world that the simulated devices sense; see `docs/world.md`. A relative path is resolved from
the folder of the file that has it, then from the `config` folder of this package.
"""

_TOPIC_TEXT: Final = """\
Topics that no device and no module declares, such as inputs from ROS. A section `fixed` has the
fixed strings and lengths of sequences of the message, by dotted field name:
`fixed: {header.frame_id: base_link}`.
"""

_SERVICE_TEXT: Final = """\
Each is a service of the node that publishes a string in the core and returns the answer of the
core. Of the standard services only `nav_msgs/srv/LoadMap` has a string in its request: its
`map_url` replaces `{map_url}` in the text. For other strings use a mirror of a topic.
A call that awaits its answer delays nothing else in the node; at most 16 calls of a service wait
at the same time, further ones are refused.

Another process may answer, as mapping does, or a ROS node that is connected by mirrors. A call
first asks the core whether a client that reads `topic` and publishes `answer_topic` is connected.
If not, nothing is published, and the response names the command that starts it (`started_by`).
When the process ends before it has answered, or no answer comes within `timeout_s`, the response
says that the result is unknown.

```yaml
    topics: [orders, answers]
    orders: {topic: crane/order, message: std_msgs/msg/String, tail: 100}
    answers: {topic: crane/answer, message: std_msgs/msg/String, tail: 200}
    services: [park]
    park: {service: ~/crane/park, topic: crane/order, text: park, answer_topic: crane/answer}
```

`ros2 service call /robot/crane/park std_srvs/srv/Trigger`

The response of a LoadMap has a code and no field for a reason, which is logged, and it contains no
map. A `nav_msgs/srv/GetMap` returns the last sample of its topic, or an empty map.
"""

_SECTIONS: Final = (
    ('The robot', '', RobotSettings),
    ('`core`: the real-time process', '', CoreSettings),
    ('`watchdog`: supervision of critical tasks', _WATCHDOG_TEXT, WatchdogSettings),
    ('`log`: the log file', _LOG_TEXT, LogSettings),
    ('`world`: the simulated world', _WORLD_TEXT, WorldSettings),
    ('Devices', _DEVICE_TEXT, DeviceSettings),
    ('Modules', _MODULE_TEXT, ModuleSettings),
    ('Tasks', _TASK_TEXT, TaskSettings),
    ('Topics', _TOPIC_TEXT, TopicSettings),
    ('Mirrors', 'Each copies a topic of the core to ROS, or one from ROS.\n', MirrorSettings),
    ('Services', _SERVICE_TEXT, ServiceSettings),
)

_COLUMNS: Final = ('key', 'type', 'default', 'range', 'unit', 'live', 'meaning')
_KINDS: Final = {bool: 'bool', int: 'int', float: 'float', str: 'string'}


def describe(catalogue: Catalogue | None = None) -> str:
    """Write the page, as Markdown."""
    known = catalogue or installed()
    parts = [_HEAD, *(_section(title, text, _without_task(cls)) for title, text, cls in _SECTIONS)]
    for name in sorted(known.drivers.names()):
        parts += _kind('driver', name, known.drivers)
        if name in known.simulators.names():
            text = 'The section `sim` of such a device:\n'
            parts.append(_section('', text, known.simulators.find(name).fields))
    for name in sorted(known.modules.names()):
        parts += _kind('module', name, known.modules)
    return '\n'.join(part for part in parts if part)


def _without_task(cls: type) -> Sequence[Field]:
    """Return the settings of a section; those of tasks have a table of their own."""
    task = declared(TaskSettings)
    return [field for field in declared(cls) if cls is TaskSettings or field not in task]


def _kind(noun: str, name: str, lookup: Lookup) -> Iterable[str]:
    try:
        fields = lookup.find(name).fields
    except ConfigError as error:
        return [f'## {noun.capitalize()} `{name}`\n', f'Not usable here: {error}\n']
    return [_section(f'{noun.capitalize()} `{name}`', '', fields) or
            f'## {noun.capitalize()} `{name}`\n\nIt has no keys of its own.\n']


def _section(title: str, text: str, fields: Sequence[Field]) -> str:
    if not fields:
        return ''
    lines = [f'## {title}', ''] if title else []
    lines += [text] if text else []
    lines += [_row(_COLUMNS), _row(['---'] * len(_COLUMNS))]
    lines += [_row(_cells(field)) for field in fields]
    return '\n'.join(lines) + '\n'


def _cells(field: Field) -> Sequence[str]:
    kind = f'list of {_KINDS[field.item]}' if field.kind is list else _KINDS[field.kind]
    default = 'required' if field.default is REQUIRED else f'`{show(field.default)}`'
    if field.choices:
        limits = ', '.join(f'`{choice}`' for choice in field.choices)
    else:
        limits = field.limits().removeprefix(' from ').removeprefix(' of ')
        if field.length:
            limits = f'{field.length} items {limits}'.rstrip()
    return (f'`{field.name}`', kind, default, limits, field.unit, 'yes' if field.live else '',
            description_of(field))


def _row(cells: Sequence[str]) -> str:
    escaped = (cell.replace('|', '\\|') for cell in cells)
    return f"| {' | '.join(escaped)} |"


if __name__ == '__main__':
    sys.stdout.write(describe())
