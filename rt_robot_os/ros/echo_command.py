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

"""The program `echo`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from rt_robot_os.base.programs import ended_by_signals


def run(argv: Sequence[str]) -> int:
    """
    Print the messages of a topic, or its rate, until Ctrl-C.

    :param argv: without the program's name.
    :return: the exit code, 1 if the topic is not published.
    """
    parser = argparse.ArgumentParser(
        prog='echo', description="Print a ROS 2 topic; for machines without ROS 2's own tools.")
    parser.add_argument('topic', help='such as /imu/data')
    parser.add_argument('--hz', action='store_true', help='print the rate once a second instead')
    parser.add_argument('--count', type=int, default=0,
                        help='end after this many messages (0: never)')
    parser.add_argument('--timeout', type=float, default=10.0,
                        help='seconds to wait for a publisher (default %(default)g)')
    arguments = parser.parse_args(argv)
    stops: list[int] = []

    # Before the import: loading rclpy takes long enough to be interrupted.
    with ended_by_signals(stops.append):
        from rt_robot_os.ros.echo import echo
        return echo(arguments.topic, hz=arguments.hz, count=arguments.count,
                    timeout_s=arguments.timeout, stopping=lambda: bool(stops))
