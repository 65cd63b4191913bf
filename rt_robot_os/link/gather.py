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
When the link's task runs: immediately after a pause, otherwise once per interval.

This is interrupt coalescing, as network cards do it. A sample on a rarely published topic is sent
immediately; the samples of many or fast topics within an interval are sent together. A topic whose
client allows a delay waits for other samples from its first sample on.

A first sample shortly before the end of the interval is not held back: a timer for the rest would
wake the core once more. This is always so for a topic whose period is the interval, because the
interval starts when the link's task has sent the sample before.
"""

from __future__ import annotations

from rt_robot_os.kernel import Kernel
from rt_robot_os.kernel import Task
from rt_robot_os.kernel.clock import NEVER_NS
from rt_robot_os.topics import Subscription
from rt_robot_os.topics import Trigger
from rt_robot_os.topics.topic import Topic

# A sample in the last eighth of an interval is not held back.
_LAST_PART = 8


class Gather:
    """
    Keep an interval between the releases of a task, for all topics that it sends.

    :param task: the task.
    :param interval_ns: from one of its jobs to the next, an eighth less if a sample comes in that
        last eighth; 0 holds nothing back.
    :ivar prompt: the next job starts at the end of the interval, or has started.
    :ivar within_ns: the latest time until the next job starts.
    """

    __slots__ = ('task', 'interval_ns', 'prompt', 'within_ns', '_kernel', '_timer', '_early_ns',
                 '_open_ns', '_due_ns')

    def __init__(self, kernel: Kernel, task: Task, interval_ns: int) -> None:
        self.task = task
        self.interval_ns = interval_ns
        self.prompt = False
        self.within_ns = NEVER_NS
        self._kernel = kernel
        self._timer = kernel.timer(task)
        self._early_ns = interval_ns // _LAST_PART
        self._open_ns = 0
        self._due_ns = NEVER_NS

    def due(self, delay_ns: int) -> bool:
        """
        Return whether the task must run now; otherwise it is released in time.

        :param delay_ns: how long it may wait; 0: until the end of the interval.
        """
        kernel = self._kernel
        now_ns = kernel.now_ns()
        if delay_ns:
            due_ns = now_ns + delay_ns
            self.within_ns = delay_ns
            early_ns = 0
        else:
            due_ns = self._open_ns
            self.prompt = True
            early_ns = self._early_ns
        if due_ns - early_ns <= now_ns or not kernel.running:
            self.now()
            return True
        if due_ns < self._due_ns:
            self._due_ns = due_ns
            self._timer.start_at(due_ns)
        return False

    def now(self) -> None:
        """Note that the task is released."""
        self.prompt = True
        self.within_ns = 0

    def begin(self) -> None:
        """Note that the task runs, before it reads the topics."""
        if self._timer.started:
            self._timer.cancel()
        self.prompt = False
        self.within_ns = self._due_ns = NEVER_NS

    def note_sent(self, now_ns: int) -> None:
        """Note that samples were sent; a job without samples starts no interval."""
        self._open_ns = now_ns + self.interval_ns


class Gathered(Trigger):
    """
    Release the task for one topic that it sends.

    When half of the topic's ring is unread, the release is immediate, so that no sample is lost.

    :ivar delay_ns: how long a sample may wait for others; 0: until the end of the interval.
    """

    __slots__ = ('delay_ns', '_gather', '_subscription', '_enough', '_full_at')

    def __init__(self, gather: Gather, subscription: Subscription) -> None:
        super().__init__(gather.task)
        self.delay_ns = 0
        self._gather = gather
        self._subscription = subscription
        self._enough = max(1, subscription.topic.depth // 2)
        self.note_read()

    def note_read(self) -> None:
        """Note how far the topic has been read; samples left there are tried again in time."""
        subscription = self._subscription
        self._full_at = max(subscription.next_seq + self._enough,
                            subscription.topic.head + (self._enough + 1) // 2)

    def published(self, topic: Topic) -> bool:
        gather = self._gather
        if topic.head == self._full_at:
            gather.now()
            return True
        delay_ns = self.delay_ns
        if delay_ns:
            return gather.within_ns > delay_ns and gather.due(delay_ns)
        return not gather.prompt and gather.due(0)
