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


"""Modules that do not want to end; each writes what became of its output into a file."""

from __future__ import annotations

from rt_robot_os.modules import Field
from rt_robot_os.modules import Module


class Endless(Module):
    """Compute in Python without end."""

    SETTINGS = (Field('path', str, '', 'file of the output'),)

    def configure(self) -> None:
        self.put('configured')

    def put(self, text: str) -> None:
        with open(self.settings['path'], 'a') as file:
            file.write(f'{self.name} {text}\n')

    def step(self) -> None:
        self.put('computes')
        while True:
            pass

    def deactivate(self) -> None:
        self.put('rests')


class Resisting(Endless):
    """Swallow what is to end it, a few times."""

    def step(self) -> None:
        self.put('computes')
        for _ in range(5):
            try:
                while True:
                    pass
            except BaseException:
                continue


class StuckAtTheEnd(Endless):
    """Never come out of deactivate()."""

    def deactivate(self) -> None:
        while True:
            pass

    def safe_state(self) -> None:
        self.put('is safe')


class NativeAtTheEnd(Endless):
    """Never come out of a native call in deactivate()."""

    def deactivate(self) -> None:
        sum(range(10 ** 12))
