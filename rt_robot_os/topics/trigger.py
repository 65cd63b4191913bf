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


"""Triggers that release a task: every n-th publication, or one of each of several topics."""

from __future__ import annotations

from collections.abc import Sequence

from rt_robot_os.base.errors import TopicError
from rt_robot_os.kernel import Task
from rt_robot_os.topics.topic import Topic
from rt_robot_os.topics.topic import Trigger


class Every(Trigger):
    """
    Release with each n-th publication, beginning with the n-th from now.

    :raises TopicError: n is below 1.
    """

    __slots__ = ('number', '_left')

    def __init__(self, task: Task, number: int) -> None:
        super().__init__(task)
        if isinstance(number, bool) or not isinstance(number, int) or number < 1:
            raise TopicError(f'task {task.name!r}: every {number!r} must be an integer number of '
                             'publications, 1 or more')
        self.number = number
        self._left = number

    def published(self, topic: Topic) -> bool:
        self._left -= 1
        if self._left:
            return False
        self._left = self.number
        return True


class AllOf(Trigger):
    """
    Release when each of several topics had a publication since the last release.

    Further publications of one topic meanwhile have no effect: its newest sample can be read.

    :raises TopicError: a topic is given twice, or none is given.
    """

    __slots__ = ('topics', '_missing')

    def __init__(self, task: Task, topics: Sequence[Topic]) -> None:
        super().__init__(task)
        if not topics or len(set(topics)) != len(topics):
            names = ', '.join(repr(topic.name) for topic in topics) or 'none'
            raise TopicError(f'task {task.name!r}: waiting for several topics requires each of '
                             f'them once; given: {names}')
        self.topics = tuple(topics)
        self._missing = set(topics)

    def published(self, topic: Topic) -> bool:
        self._missing.discard(topic)
        if self._missing:
            return False
        self._missing.update(self.topics)
        return True
