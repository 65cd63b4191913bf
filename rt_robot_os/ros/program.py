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

"""Run the node `robot` until somebody ends it."""

from __future__ import annotations

import sys

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.executors import SingleThreadedExecutor

from rt_robot_os.errors import RtRobotError
from rt_robot_os.ros.node import RobotNode
from rt_robot_os.settings import RobotSettings

OK, FAILED, BAD_CONFIGURATION = 0, 1, 2


def spin(settings: RobotSettings) -> int:
    """
    Run the robot: configure, activate, spin, and leave nothing behind.

    :return: the exit code.
    """
    rclpy.init(args=sys.argv)
    node = None
    try:
        node = RobotNode(settings)
        if settings.autostart:
            node.trigger_configure()
            if node.fatal:
                return BAD_CONFIGURATION
            node.trigger_activate()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while rclpy.ok() and not node.fatal:
            executor.spin_once(timeout_sec=1.0)
        return BAD_CONFIGURATION if node.fatal else OK
    except (KeyboardInterrupt, ExternalShutdownException):
        return OK
    except RtRobotError as error:
        print(f'robot: {error}', file=sys.stderr)
        return FAILED
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
