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

"""A mote on a pty, for the commands that read and write a sink."""

from __future__ import annotations

import os
import pty
import select
import threading
import tty

from rt_robot_os.features.wsn.packets.framing import frame
from rt_robot_os.features.wsn.packets.framing import FrameReader
from rt_robot_os.features.wsn.packets.framing import PROTOCOLS


class Mote:
    """
    Sends frames and takes what is written to it, in a thread of its own.

    :param frames: what it sends, again and again, until it is closed.
    :param ignored: of the first frames that want it, so many are not acknowledged.
    :ivar path: of its port.
    :ivar taken: frames that were written to it: P, token, packet.
    """

    def __init__(self, frames: tuple[bytes, ...] = (), ignored: int = 0) -> None:
        self._master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(slave)
        self._slave: int | None = slave
        self.taken: list[tuple[int, int, bytes]] = []
        self.sent = 0
        self._frames = frames
        self._ignored = ignored
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Mote:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.unplug()

    def unplug(self) -> None:
        """End; who has the port open finds it gone. May be repeated."""
        self._over.set()
        self._thread.join()
        if self._slave is not None:
            os.close(self._slave)
            os.close(self._master)
            self._slave = None

    def _run(self) -> None:
        reader = FrameReader()
        while not self._over.is_set():
            readable, _, _ = select.select([self._master], [], [], 0.002)
            for each in reader.feed(os.read(self._master, 4096)) if readable else ():
                self.taken.append((each.protocol, each.token, each.packet))
                known = PROTOCOLS[each.protocol]
                if each.protocol == known.acked and len(self.taken) > self._ignored:
                    self._write(frame(known.ack, bytes((each.token,))))
            if self._frames:
                self._write(self._frames[self.sent % len(self._frames)])
                self.sent += 1

    def _write(self, data: bytes) -> None:
        try:
            os.write(self._master, data)
        except BlockingIOError:
            pass  # nobody reads
