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


"""A module that does what no module may: it starts a thread."""

from __future__ import annotations

import threading

from rt_robot_os.modules import Module


class Threaded(Module):
    """Compute in a thread of its own."""

    def configure(self) -> None:
        self.ends = threading.Event()
        self.thread: threading.Thread | None = None

    def step(self) -> None:
        if self.thread is None:
            self.thread = threading.Thread(target=self.compute, name='side', daemon=True)
            self.thread.start()

    def compute(self) -> None:
        while not self.ends.wait(0.001):
            sum(range(1000))

    def deactivate(self) -> None:
        self.ends.set()
        if self.thread is not None:
            self.thread.join()
