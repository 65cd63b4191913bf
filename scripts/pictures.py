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
Take the pictures of docs/images from robots that run: top, top_trouble, recording, drive.

    .venv/bin/python scripts/pictures.py [top top_trouble recording drive] [--out docs/images]

Run it on a quiet machine. The picture of `top` is taken of a robot that is well only: no job was
late or lost since the statistics began, and none waited longer than ``--latency-us``; otherwise it
is tried again, and in the end nothing is written. Needs rich, matplotlib, Pillow and
mcap-ros2-support.
"""

from __future__ import annotations

import argparse
import io
from pathlib import Path
import re
import sys
import time

from drive_pictures import draw_map
from drive_pictures import draw_scene
from drive_pictures import record_drive
from rich.console import Console
from rt_robot_os.link import LinkClient
from rt_robot_os.linux.paths import socket_path
from rt_robot_os.tools.top.controls import Controls
from rt_robot_os.tools.top.core_source import Source
from rt_robot_os.tools.top.live import drawn
from rt_robot_os.tools.top.live import screen
from rt_robot_os.tools.top.rows import Snapshot
from rt_robot_os.tools.top.screen_layout import Choices
from rt_robot_os.tools.top.snapshot import compare
from simulated_robot import EXAMPLES
from simulated_robot import robot
from simulated_robot import ROOT

WARM_UP_S, WATCHED_S = 5.0, 10.0


def look(source: Source, interval_s: float = 1.0) -> Snapshot:
    """Look twice."""
    before = source.look()
    time.sleep(interval_s)
    source.pump()
    return compare('robot', source.look(), before)


def save_screen(snapshot: Snapshot, source: Source, path: Path, size: tuple[int, int]) -> None:
    """Draw what a terminal would show."""
    console = Console(record=True, width=size[0], height=size[1], file=io.StringIO(),
                      force_terminal=True, color_system='truecolor')
    lines = screen(snapshot, Controls(Choices(), 1.0), source, '', size)
    console.print(drawn(lines))
    text = console.export_svg(title='ros2 run rt_robot_os top', unique_id=path.stem)
    # No font from elsewhere: whoever looks at it has one of fixed width.
    text = re.sub(r'@font-face \{.*?\}\s*', '', text, flags=re.DOTALL)
    path.write_text(text.replace('Fira Code, monospace', 'DejaVu Sans Mono, monospace'))
    print(path)


def trouble(snapshot: Snapshot, latency_us: float) -> list[str]:
    """Say what is wrong with a robot that should be well."""
    found = [f'{task.name}: {key} {getattr(task, key)}' for task in snapshot.tasks
             for key in ('deadline_missed', 'missed', 'overruns', 'aborted', 'failures')
             if getattr(task, key)]
    found += [f'{task.name}: {task.latency_max_us:.0f} us late' for task in snapshot.tasks
              if task.priority > 3 and (task.latency_max_us or 0.0) > latency_us]
    return found + [f'{topic.name}: lost {topic.lost}' for topic in snapshot.topics if topic.lost]


def picture_top(path: Path, tries: int, latency_us: float) -> bool:
    """Take the picture of a robot that is well."""
    with robot(ROOT / 'config' / 'robot.yaml'):
        time.sleep(WARM_UP_S)
        for _ in range(tries):
            source = Source(socket_path('robot'))
            source.look()
            with_reset = LinkClient(socket_path('robot'), 'pictures')
            with_reset.request('reset_statistics')
            with_reset.close()
            time.sleep(WATCHED_S)
            snapshot = look(source)
            wrong = trouble(snapshot, latency_us)
            if not wrong:
                source.lines.clear()
                save_screen(snapshot, source, path, (132, 39))
                source.close()
                return True
            print(f'not well, once more: {"; ".join(wrong[:3])}', file=sys.stderr)
            source.close()
    return False


def picture_trouble(path: Path) -> None:
    """Take the picture of a robot in trouble, after its IMU was unplugged and came back."""
    with robot(EXAMPLES / 'trouble.yaml'):
        source = Source(socket_path('robot'))
        source.look()
        time.sleep(14.0)
        save_screen(look(source), source, path, (132, 39))
        source.close()


def main() -> int:
    """Take pictures; the exit code is 1 when the robot was never well."""
    parser = argparse.ArgumentParser(description='Take the pictures of docs/images.')
    names = ('top', 'top_trouble', 'recording', 'drive')
    parser.add_argument('which', nargs='*', choices=[*names, []], default=[], help='default: all')
    parser.add_argument('--out', type=Path, default=ROOT / 'docs' / 'images')
    parser.add_argument('--tries', type=int, default=20)
    parser.add_argument('--latency-us', type=float, default=2000.0,
                        help='longest wait of a task that is still well (default %(default)g)')
    parser.add_argument('--seconds', type=float, default=40.0, help='length of the recorded drive')
    arguments = parser.parse_args()
    wanted = arguments.which or names
    well = True
    if 'recording' in wanted or 'drive' in wanted:
        drive = record_drive(arguments.seconds)
        if 'drive' in wanted:
            draw_map(drive, arguments.out / 'drive.svg')
        if 'recording' in wanted:
            draw_scene(drive, arguments.out / 'recording.svg')
    if 'top_trouble' in wanted:
        picture_trouble(arguments.out / 'top_trouble.svg')
    if 'top' in wanted:
        well = picture_top(arguments.out / 'top.svg', arguments.tries, arguments.latency_us)
    return 0 if well else 1


if __name__ == '__main__':
    sys.exit(main())
