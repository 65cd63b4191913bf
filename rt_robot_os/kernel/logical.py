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
Logical execution time: inputs as of the release, outputs at the deadline, whatever comes between.

Henzinger, Horowitz, Kirsch: Giotto, 2003. What a task reads and when others see what it wrote no
longer depend on how long it computes or on who preempts it: the robot behaves on a loaded machine
as it did on an idle one, at the price of one deadline of delay.
"""

from __future__ import annotations

from collections.abc import Callable


class Logical:
    """
    What belongs to a task with logical execution time.

    :ivar late: jobs that had not ended at their deadline; their outputs are not published.
    :ivar inputs: called at each release, before the job.
    :ivar outputs: called at each deadline with True to publish, with False to discard.
    """

    __slots__ = ('late', 'inputs', 'outputs', '_overdue')

    def __init__(self) -> None:
        self.late = 0
        self.inputs: list[Callable[[], None]] = []
        self.outputs: list[Callable[[bool], None]] = []
        self._overdue = False

    def begin(self) -> None:
        """Fix the inputs of a job that is released."""
        if self._overdue:  # what the job before published after its deadline
            self._overdue = False
            for output in self.outputs:
                output(False)
        for fix in self.inputs:
            fix()

    def end(self, in_time: bool) -> None:
        """Publish what a job wrote whose deadline has come, if it has ended."""
        self.late += not in_time
        self._overdue = not in_time
        for output in self.outputs:
            output(in_time)
