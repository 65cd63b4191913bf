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

"""Do the helpers for other people's tests say what is wrong in them."""

from __future__ import annotations

import subprocess
import sys

import pytest

from rt_robot_os.devices.maxbotix.driver import MaxBotix
from rt_robot_os.modules import Input
from rt_robot_os.modules import Module
from rt_robot_os.modules import Output
from rt_robot_os.testing import ModuleBench
from rt_robot_os.testing import scripted
from rt_robot_os.testing import settings_of

pytest.importorskip('std_msgs', reason='ROS 2 messages are not installed')

INT = 'std_msgs/msg/Int64'


class Inverse(Module):
    number = Input('number', wake=True)
    inverse = Output('inverse', 'std_msgs/msg/Float64')

    def step(self) -> None:
        while self.number.take():
            self.inverse.msg.data = 1 / self.number.msg.data
            self.inverse.publish(self.number.stamp_ns)


def test_an_hour_on_the_bench() -> None:
    with ModuleBench() as bench:
        number = bench.topic('number', INT)
        bench.add(Inverse)
        inverse = bench.watch('inverse')

        def publish() -> None:
            number.msg.data = 4
            number.publish()

        bench.at(3599.0, publish)
        bench.run(3600.0)
        assert inverse.take()
        assert inverse.msg.data == 0.25
        assert inverse.stamp_ns - bench.kernel.start_ns == 3599 * 10**9
        assert not inverse.take()


def test_a_job_that_fails_fails_the_test_and_says_where() -> None:
    with ModuleBench() as bench:
        number = bench.topic('number', INT)
        bench.add(Inverse, 'inverse')
        bench.at(1.0, number.publish)
        with pytest.raises(AssertionError, match=r"(?s)failed: 1; .*task 'inverse': Zero"
                                                 r'DivisionError.*test_testing\.py:\d+ in step'):
            bench.run(2.0)


def test_settings_that_cannot_be_are_refused() -> None:
    with pytest.raises(AssertionError, match='MaxBotix needs a value for port'):
        settings_of(MaxBotix)
    with pytest.raises(AssertionError, match="unit = 'mile': must be one of mm, cm, inch"):
        settings_of(MaxBotix, port='x', unit='mile')
    with pytest.raises(AssertionError, match='MaxBotix has no setting limt: it has port, baud'):
        settings_of(MaxBotix, port='x', limt=1)


def test_a_recorded_message_keeps_its_values_and_a_sample_does_not_change() -> None:
    with scripted(MaxBotix, [b'R0480\r', b'R1000\r']) as (device, (publisher,)):
        device.read(1)
        device.read(2)
    assert [sample.range for sample in publisher.samples] == pytest.approx([0.48, 1.0])
    assert publisher.samples[0].header.frame_id == 'sonar_link'
    assert publisher.stamps == [1, 2]


WITHOUT_HYPOTHESIS = """
import sys
sys.modules['hypothesis'] = None
import rt_robot_os.testing
from rt_robot_os.base.errors import RtRobotError
from rt_robot_os.base.requirements import Library
Library.found = lambda self: None
try:
    rt_robot_os.testing.DecoderContract().any_chunks()
except RtRobotError as error:
    print(error)
"""


def test_only_the_contracts_need_hypothesis() -> None:
    """The tests of a module run where pytest alone is installed; those that need more say so."""
    done = subprocess.run([sys.executable, '-c', WITHOUT_HYPOTHESIS], text=True,
                          capture_output=True)
    assert done.stdout.startswith('this test of the contract needs hypothesis'), done.stderr
