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
Logical execution time (LET): inputs are read at the release, outputs published at the deadline.

Henzinger, Horowitz, Kirsch: Giotto, 2003. The inputs of a task, and the time at which others see
its outputs, do not depend on how long it computes or on preemption: the robot behaves on a loaded
machine as on an idle one, at the price of a delay of one deadline.
"""

from __future__ import annotations

from collections.abc import Callable


class Logical:
    """
    The state of a task with logical execution time.

    :ivar late: jobs that had not ended at their deadline; their outputs are not published.
    :ivar inputs: functions that are called at each release, before the job.
    :ivar outputs: functions that are called at each deadline: True publishes, False discards.
    """

    __slots__ = ('late', 'inputs', 'outputs', '_overdue')

    def __init__(self) -> None:
        self.late = 0
        self.inputs: list[Callable[[], None]] = []
        self.outputs: list[Callable[[bool], None]] = []
        self._overdue = False

    def begin(self) -> None:
        """Fix the inputs of a released job."""
        if self._overdue:  # outputs of the previous job after its deadline
            self._overdue = False
            for output in self.outputs:
                output(False)
        for fix in self.inputs:
            fix()

    def end(self, in_time: bool) -> None:
        """At the deadline of a job, publish its outputs if it has ended, or discard them."""
        self.late += not in_time
        self._overdue = not in_time
        for output in self.outputs:
            output(in_time)
