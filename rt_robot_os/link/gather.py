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
When the link's task runs: at once after a pause, else once for all that comes within an interval.

This is interrupt coalescing as network cards do it. A sample on a topic that is published now and
then goes out at once; of many or fast topics the samples of an interval go together.
"""

from __future__ import annotations

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.topics import Subscription
from rt_robot_os.topics import Trigger
from rt_robot_os.topics.topic import Topic


class Gather:
    """
    Keep an interval between the releases of a task, for all topics that it carries.

    :param task: which.
    :param interval_ns: from one of its jobs to the next; 0 holds nothing back.
    """

    __slots__ = ('task', 'interval_ns', 'waiting', '_kernel', '_timer', '_open_ns')

    def __init__(self, kernel: Kernel, task: Task, interval_ns: int) -> None:
        self.task = task
        self.interval_ns = interval_ns
        self.waiting = False
        self._kernel = kernel
        self._timer = kernel.timer(task)
        self._open_ns = 0

    def due(self) -> bool:
        """Return whether the task is to run now; otherwise it runs at the end of the interval."""
        kernel = self._kernel
        self.waiting = True
        if kernel.now_ns() >= self._open_ns or not kernel.running:
            return True
        self._timer.start_at(self._open_ns)
        return False

    def begin(self) -> None:
        """Note that the task runs, before it looks at the topics."""
        if self._timer.started:
            self._timer.cancel()
        self.waiting = False

    def carried(self, now_ns: int) -> None:
        """Note that samples went out; after a job that found none there is no interval."""
        self._open_ns = now_ns + self.interval_ns


class Gathered(Trigger):
    """
    Release the task for one topic that it carries.

    At once, whatever the interval, when half of the topic's ring is unread: none shall be lost.
    """

    __slots__ = ('_gather', '_subscription', '_enough', '_full_at')

    def __init__(self, gather: Gather, subscription: Subscription) -> None:
        super().__init__(gather.task)
        self._gather = gather
        self._subscription = subscription
        self._enough = max(1, subscription.topic.depth // 2)
        self.carried()

    def carried(self) -> None:
        """Note how far the topic has been read."""
        self._full_at = self._subscription.next_seq + self._enough

    def published(self, topic: Topic) -> bool:
        gather = self._gather
        if topic.head == self._full_at:
            gather.waiting = True
            return True
        return not gather.waiting and gather.due()
