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

"""Problems of the incoming scans and odometry, as warnings for the operator."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from collections.abc import Mapping
import time
from typing import Final

from rt_robot_os.base.units import NS_PER_S

#: Time without input that is reported, and for how long an event is reported.
TIMEOUT_NS: Final = 2 * NS_PER_S
_REPORTED_NS: Final = 10 * NS_PER_S
_EVENTS: Final = {
    'scans_backwards': 'stamps of scans went back or stood still: scans were dropped',
    'odometry_backwards': 'stamps of odometry went back or stood still: samples were dropped',
    'odometry_gaps': 'odometry paused: scans must confirm the pose of the robot first',
    'odometry_jumps': 'odometry jumped: the robot is assumed to have stood still',
    'scans_without_odometry': 'scans without odometry at their time were dropped',
}
#: Share of skipped scans from which on they are reported.
_SKIPPED_SHARE: Final = 0.2
#: Clocks differ when the stamps of as many scans in a row are further from those of odometry
#: than any delay.
_APART_NS: Final = NS_PER_S
_APART_SCANS: Final = 10


class InputDiagnostics:
    """
    Watch the counters of the intake, and when inputs last arrived.

    :param counts: of :class:`.ScanIntake`.
    """

    def __init__(self, counts: Mapping[str, int]) -> None:
        self._counts = counts
        self._received_ns = dict.fromkeys(('scans', 'odometry'), time.monotonic_ns())
        self._reported = dict.fromkeys(_EVENTS, 0)
        self._event_ns = dict.fromkeys(_EVENTS, -_REPORTED_NS)
        # Time, and how many scans had arrived and been skipped.
        self._scans: deque[tuple[int, int, int]] = deque()
        self._behind_ns: deque[int] = deque(maxlen=_APART_SCANS)

    def record_stamps(self, scan_ns: int, odometry_ns: int) -> None:
        """Record the stamp of a new scan, and that of the last odometry."""
        self._behind_ns.append(odometry_ns - scan_ns)

    def record_arrival(self, what: str) -> None:
        """Record an arrival of ``scans`` or ``odometry``."""
        self._received_ns[what] = time.monotonic_ns()

    def silent_inputs(self) -> dict[str, float]:
        """Return the inputs that do not arrive, and for how many seconds."""
        now_ns = time.monotonic_ns()
        return {what: (now_ns - then_ns) / NS_PER_S for what, then_ns in self._received_ns.items()
                if now_ns - then_ns > TIMEOUT_NS}

    def warnings(self, is_connected: bool) -> Iterator[str]:
        """
        Yield a line for each problem; call it about once a second.

        :param is_connected: whether there is a core that could send inputs.
        """
        silent = self.silent_inputs()
        for what, for_s in silent.items() if is_connected else ():
            yield f'no {what} for {for_s:.0f} s'
        if not silent:
            yield from self._clock_difference()
        now_ns = time.monotonic_ns()
        share = self._skipped_share(now_ns)
        if share >= _SKIPPED_SHARE and 'scans' not in silent:
            yield (f'this machine is overloaded: {share:.0%} of the scans were skipped, the '
                   'newest were used')
        for key, text in _EVENTS.items():
            if self._counts[key] > self._reported[key]:
                self._reported[key], self._event_ns[key] = self._counts[key], now_ns
            if now_ns - self._event_ns[key] < _REPORTED_NS:
                yield text

    def _clock_difference(self) -> Iterator[str]:
        """Report two clocks that differ; of scans that are merely late some are near in time."""
        if len(self._behind_ns) < _APART_SCANS:
            return
        least_ns = min(self._behind_ns, key=abs)
        if abs(least_ns) > _APART_NS:
            yield (f'stamps of scans are {abs(least_ns) / NS_PER_S:.1f} s '
                   f'{"behind" if least_ns > 0 else "ahead of"} those of odometry: one of two '
                   'clocks is wrong')

    def _skipped_share(self, now_ns: int) -> float:
        """Return the share of the scans of the last seconds that were skipped."""
        counts, scans = self._counts, self._scans
        scans.append((now_ns, counts['scans'],
                      counts['scans_skipped'] + counts['scans_overflowed']))
        while now_ns - scans[0][0] > _REPORTED_NS:
            scans.popleft()
        (then_ns, came, skipped), (_, comes, skips) = scans[0], scans[-1]
        if now_ns - then_ns < _REPORTED_NS // 2:
            return 0.0  # too short: some are skipped anyway while libraries are loaded
        # Some of the skipped scans may have arrived before.
        return (skips - skipped) / max(1, comes - came, skips - skipped)
