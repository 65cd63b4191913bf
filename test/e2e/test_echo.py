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

"""The program echo ends in order, whenever it is told to."""

from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

ROOT = Path(__file__).resolve().parents[2]
# A publisher in the same process, so that what is told needs no second one.
INTERRUPTED = """
import os, signal, sys, threading, time
import rclpy
from rt_robot_os.ros.echo_program import main
from std_msgs.msg import String

moment, sys.argv[1:] = sys.argv[1], ['/chatter', *sys.argv[2:]]

def strike(function):
    def struck(*arguments, **options):
        os.kill(os.getpid(), signal.SIG)
        time.sleep(0.3)
        return function(*arguments, **options)
    return struck

def create_node(*arguments, **options):
    node = made(*arguments, **options)
    publisher = node.create_publisher(String, '/chatter', 10)
    node.create_timer(0.005, lambda: publisher.publish(String(data='hello')))
    if moment == 'subscribing':
        node.create_subscription = strike(node.create_subscription)
    return node

made = rclpy.create_node
rclpy.create_node = strike(create_node) if moment == 'starting' else create_node
spins = []
spin_once = rclpy.spin_once

def spin(*arguments, **options):
    spins.append(1)
    if moment == 'running' and len(spins) == 80:
        os.kill(os.getpid(), signal.SIG)
    return spin_once(*arguments, **options)

rclpy.spin_once = spin
sys.exit(main())
"""


def run(moment: str, signo: signal.Signals, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, '-c', INTERRUPTED.replace('signal.SIG)', f'signal.{signo.name})'),
         moment, *options], capture_output=True, text=True, timeout=120, env={
            **os.environ,
            'PYTHONPATH': os.pathsep.join([str(ROOT), os.environ.get('PYTHONPATH', '')])})


@pytest.mark.parametrize('option', ['--hz', '--count=0'])
@pytest.mark.parametrize('moment', ['starting', 'subscribing', 'running'])
@pytest.mark.parametrize('signo', [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_at_any_moment(signo: signal.Signals, moment: str, option: str) -> None:
    ended = run(moment, signo, option)
    assert (ended.returncode, ended.stderr) == (0, '')


def test_a_reader_that_has_enough_ends_it() -> None:
    code = INTERRUPTED.replace('signal.SIG)', 'signal.SIGTERM)')
    with subprocess.Popen(
            [sys.executable, '-c', code, 'never'], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True, env={**os.environ, 'PYTHONPATH': os.pathsep.join(
                [str(ROOT), os.environ.get('PYTHONPATH', '')])}) as program:
        assert program.stdout is not None and program.stderr is not None
        assert program.stdout.readline() == "data: 'hello'\n"
        program.stdout.close()
        assert program.stderr.read() == ''
        assert program.wait(60) == 0
