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
The page of all keys, written from the same declarations that check them.

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

Without a parameter file the shipped `robot.yaml` counts: its devices are simulated, which the
first line, `/diagnostics` (a warning) and `top` say. `robot --simulate` says that it is meant, and
with `--params-file` it simulates the devices of that file, whatever their ports.

A device or a module is switched off with `-p gps.enabled:=false`, or by a list on the command line
that it is not in: `-p "devices:=[imu]"`. Its section is checked all the same. Its topics stay,
silent, so that its mirrors and who reads them need no change. A mirror that is not in such a list
is left out.

## How it is read

- Every problem is told at once, with file, line, key, value and what would be right, before
  anything is opened: `robot.yaml:14: imu.baud = 'fast': must be an integer from ...`.
- Several files are laid over each other, key by key; later ones win, and the command line wins
  over all files. (In rcl a `-p` loses to the node's own section when the file also has `/**`.)
- `robot:`, `/robot:`, `/lab: {robot: ...}` and `/lab/robot:` name the node as in every ROS 2 file.
  The wildcards `*` (one name) and `**` (any number) work, in the order of the file.
- Values are what ROS 2 reads in them: `yes` and `on` are true, `010` is eight, `1e3` is a number,
  `"5"` is a text. A whole number will do where a number is wanted. A list is of one type.
- A key given twice, a key nobody knows, a key without value, an alias, a section in no list: each
  is an error and none is ignored. Only `use_sim_time`, `start_type_description_service` and
  `qos_overrides` belong to ROS 2 and are left alone.
- Names of sections are letters, digits and `_`; each belongs to one list.
- *Live* keys can be changed while the robot runs: `ros2 param set /robot imu.rate_hz 50.0`.
"""

_DEVICE_TEXT: Final = """\
Each name in `devices` has a section with these keys and those of its driver. With `port: sim` the
device is simulated: a pseudo-terminal or an emulated I2C bus speaks its bytes, as its section
`sim` says (below, with each driver). With any other port the section `sim` is checked and then
left alone.
"""

_MODULE_TEXT: Final = """\
Each name in `modules` has a section with these keys and those of its class.
"""

_TASK_TEXT: Final = """\
The section of a device or a module may also say this of its task. What contradicts itself is
refused: a budget above the period with `on_budget: abort`, a deadline that no overrun policy can
keep, `failure: safe_state` for a class without a method `safe_state()`, modules that release each
other in a circle. So is a new rate that would contradict.

With `failure: restart` a module is deactivated and activated again, not configured; a device is
closed and opened anew. A task that was stopped or is in its safe state is held until it is
re-armed: `ros2 service call /robot/rearm std_srvs/srv/Trigger`.
"""

_LOG_TEXT: Final = """\
The node writes what the core, its devices and modules say; see `docs/logging.md`.
"""

_WATCHDOG_TEXT: Final = """\
It watches the tasks with `critical: true`; see `docs/watchdog.md`.
"""

_WORLD_TEXT: Final = """\
What the simulated devices look at; see `docs/world.md`. A relative path counts from the folder of
the file that has it, then from the `config` folder of this package.
"""

_TOPIC_TEXT: Final = """\
Topics that no device and no module declares, such as inputs from ROS. A section `fixed` gives the
texts and the lengths of sequences that the message is laid out with, by dotted field name:
`fixed: {header.frame_id: base_link}`.
"""

_SERVICE_TEXT: Final = """\
Each is a service of the node that publishes a text in the core and gives back what the core
answers. Of the standard services only `nav_msgs/srv/LoadMap` carries a text of its own: its
`map_url` goes where the text says `{map_url}`; what else needs one is a mirror of a topic.
A call that awaits its answer holds up nothing else of the node; at most 16 of a service wait at
the same time, more are refused.

Another process may answer, as mapping does, or a node of ROS that mirrors reach. A call asks the
core first whether anything that reads `topic` and publishes `answer_topic` is connected. If not,
nothing is published, and the response names what starts it (`started_by`). When the process ends
before it has answered, or no answer comes within `timeout_s`, the response says that it is not
known whether it was done.

```yaml
    topics: [orders, answers]
    orders: {topic: crane/order, message: std_msgs/msg/String, tail: 100}
    answers: {topic: crane/answer, message: std_msgs/msg/String, tail: 200}
    services: [park]
    park: {service: ~/crane/park, topic: crane/order, text: park, answer_topic: crane/answer}
```

`ros2 service call /robot/crane/park std_srvs/srv/Trigger`

The response of a LoadMap has a code and no room for a reason, which goes to the log, and carries
no map. A `nav_msgs/srv/GetMap` asks nobody: it gives the last sample of its topic, or an empty
map.
"""

_SECTIONS: Final = (
    ('The robot', '', RobotSettings),
    ('`core`: the real-time process', '', CoreSettings),
    ('`watchdog`: what happens when a critical task stands still', _WATCHDOG_TEXT,
     WatchdogSettings),
    ('`log`: the file of the log', _LOG_TEXT, LogSettings),
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
