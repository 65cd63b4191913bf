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

"""Mapping next to a running robot: inputs from its core, the map, and outputs to the core."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import functools
from pathlib import Path
import re
import time
from typing import Any
from typing import Final

import numpy as np

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.mapping.engine import Engine
from rt_robot_os.features.mapping.process.commands import MappingCommands
from rt_robot_os.features.mapping.process.commands import read_map
from rt_robot_os.features.mapping.process.core_link import CoreLink
from rt_robot_os.features.mapping.process.exploring import Exploring
from rt_robot_os.features.mapping.process.map_store import MapStore
from rt_robot_os.features.mapping.process.outputs import Outputs
from rt_robot_os.features.mapping.process.outputs import TOPICS
from rt_robot_os.features.mapping.process.recovery_spin import RecoverySpin
from rt_robot_os.features.mapping.process.resumption import Resumption
from rt_robot_os.features.mapping.robot_pose import Hint
from rt_robot_os.features.mapping.scan_intake import PosedScan
from rt_robot_os.features.mapping.scan_intake import ScanIntake
from rt_robot_os.features.mapping.settings import GLOBAL
from rt_robot_os.features.mapping.settings import LOCALIZATION
from rt_robot_os.features.mapping.settings import MAPPING
from rt_robot_os.features.mapping.settings import MappingSettings
from rt_robot_os.features.mapping.settings import ORIGIN
from rt_robot_os.features.mapping.slam.deskew import LaserMount
from rt_robot_os.features.mapping.slam.graph import MapGraph
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.link.reader import SampleHandler
from rt_robot_os.messages.cdr import string_in

COMMAND: Final = 'mapping/command'
_IDLE_S: Final = 0.05
#: How long to wait for the pose of localization where there are no absolute poses.
_POSE_WAIT_NS: Final = NS_PER_S
_COMMANDS_MOST: Final = 16
_NUMBER: Final = re.compile(r'\d[\d.]*')
#: A published initial pose that comes back within this distance is our own.
_SAME_M: Final = 1e-6


class LiveMapping:
    """
    Map next to a robot until it is stopped.

    :param path: of the core's socket.
    :param folder: of the state that survives restarts.
    :param tell: called with a line of text for the log.
    """

    def __init__(self, settings: MappingSettings, path: Path, folder: Path,
                 tell: Callable[[str], None]) -> None:
        self._settings = settings
        self._tell = tell
        self._is_new_core = False
        self._begun_ns = time.monotonic_ns()
        self._first_ns = 0
        self._kept_s = time.monotonic()
        self._told_problem = ''
        # The saved state: until the robot is localised it has the best pose.
        self._left_as: tuple[MapGraph | None, str] | None = None
        self._given: deque[str] = deque(maxlen=_COMMANDS_MOST)
        self._published: Floats | None = None
        self._relocated_ns = self._begun_ns
        self._fix_ns = 0
        self.intake = ScanIntake(self._mount_of, settings.deskew)
        self.engine = Engine(settings, self._start_at)
        self.store = MapStore(folder)
        self.link = CoreLink(path, (settings.scan_topic, settings.odom_topic), self._reads(),
                             (*TOPICS, *filter(None, (
                                 settings.initial_pose_topic, settings.goal_topic,
                                 settings.cancel_topic, settings.find_topic))),
                             self._on_connection,
                             tell)
        self.exploring = Exploring(settings, self.engine, self.link.publish, self.link.has)
        self.recovery_spin = RecoverySpin(settings, self.engine, self.link.publish, self.link.has)
        self.outputs = Outputs(self.link, round(settings.map_period_s * NS_PER_S))
        map_file = Path(settings.map_file).expanduser() if settings.map_file else folder / 'map'
        self.commands = MappingCommands(settings, self.engine, self.store, map_file,
                                        self._load_hint,
                                        self.exploring, self.outputs.publish_answer)
        self._begin(map_file)

    def _reads(self) -> dict[str, SampleHandler]:
        settings, intake = self._settings, self.intake
        found: dict[str, SampleHandler] = {
            settings.scan_topic: intake.add_scan, settings.odom_topic: intake.add_odometry,
            COMMAND: self._on_command}
        for topic in (settings.pose_topic, settings.fix_topic, settings.initial_pose_topic):
            if topic:
                found[topic] = _pose_handler(intake, topic)
        if settings.planner_state_topic:
            found[settings.planner_state_topic] = self._on_planner_state
        return found

    # ---- start -------------------------------------------------------------------------------

    def _begin(self, map_file: Path) -> None:
        """
        Continue with the map of the last run, or load the map for localization.

        :raises ConfigError: there is no map for localization.
        """
        settings = self._settings
        if settings.resume and self._resume():
            return
        if settings.mode == LOCALIZATION and settings.map_file:
            said, known = read_map(map_file)
            self.commands.loaded = str(map_file)
            self._tell(said)
            self.engine.use_map(known, self._start_hint())

    def _resume(self) -> bool:
        state = self.store.read_state()
        if self.store.problem:
            self._tell(f'saved state: {self.store.problem}')
        if state is None:
            return False
        try:
            found = Resumption.of(*state, self._settings)
        except (ConfigError, ValueError) as error:
            self._tell(f'the saved state is not used: {error}')
            return False
        if found is None:
            return False
        self.engine.mode = found.mode
        self.commands.loaded = found.loaded
        self.engine.use_map(found.known, functools.partial(self._resumed_pose, found))
        self._left_as = found.known.graph, found.loaded
        self._tell(f'continuing with {found.text}')
        return True

    def _resumed_pose(self, found: Resumption, posed: PosedScan) -> Floats | None:
        """Return the pose by the saved state; odometry is used if the core is the same."""
        if found.base is not None and found.run_id == self.link.run_id:
            self.engine.trust_next_hint()
            return found.base_at(self.intake.raw_odometry(posed.base))
        start = self._settings.start
        if start != GLOBAL and self._has_fixes():
            return self._start_at(posed)
        if start != GLOBAL and found.base is not None:
            return found.base  # assumed unmoved; if it did move, the map is searched
        self.engine.start_search()
        return None

    def _start_hint(self) -> Hint | None:
        """Return the source of the initial pose on the map at the start; None: there is none."""
        start = self._settings.start
        if start == ORIGIN:
            return lambda posed: np.zeros(3)
        return None if start == GLOBAL else self._start_at

    def _load_hint(self) -> Hint | None:
        """Return the source of the pose on a map that was just loaded."""
        return self._start_at if self._has_fixes() else None

    def _has_fixes(self) -> bool:
        topic = self._settings.fix_topic
        return bool(topic) and topic in self.link.topics

    def _start_at(self, posed: PosedScan) -> Floats | None:
        """Return the pose on a new map: that of localization, or the origin."""
        settings, stamp_ns = self._settings, posed.scan.stamp_ns
        if settings.start == ORIGIN:
            return np.zeros(3)
        found = self.intake.pose_at(settings.pose_topic, stamp_ns)
        if found is not None:
            return found.pose
        if self._has_fixes():
            return None  # it will arrive
        self._first_ns = self._first_ns or stamp_ns
        return np.zeros(3) if stamp_ns - self._first_ns >= _POSE_WAIT_NS else None

    # ---- run ---------------------------------------------------------------------------------

    def run(self, stopping: Callable[[], bool]) -> None:
        """Map until it is stopped."""
        self.link.start()
        try:
            while not stopping():
                self.step()
        finally:
            self.save_state(is_last=True)
            self.store.close()
            self.link.stop()

    def step(self) -> None:
        """Do the pending work; wait a moment when there is none."""
        intake, now_s = self.intake, time.monotonic()
        intake.new.clear()
        if self._is_new_core:
            self._is_new_core = False
            self.outputs.reset()
        while self._given:
            self.commands.execute(self._given.popleft())
        posed = intake.next()
        if posed is not None:
            self._map_scan(posed)
        is_busy = self.engine.process_pending()
        self.commands.report_saves()
        now_ns = time.monotonic_ns()
        self.exploring.step(now_ns)
        self.recovery_spin.step(now_ns, self.exploring.is_active)
        if now_s - self._kept_s >= self._settings.state_period_s:
            self._kept_s = now_s
            self.save_state()
        self._publish(time.monotonic_ns())
        if posed is None and not is_busy:
            intake.new.wait(_IDLE_S)

    def _map_scan(self, posed: PosedScan) -> None:
        self._apply_initial_pose(posed)
        self._apply_absolute_pose()
        place = self.engine.add_scan(posed)
        if place is None:
            return
        if place.is_found:
            self._tell('localised at {:.2f} m, {:.2f} m, {:.0f} degrees'.format(
                *place.pose[:2], np.degrees(place.pose[2])))
            if not self._has_fixes():
                self._published = self.outputs.publish_relocation(
                    self._settings.initial_pose_topic, place)
        self.outputs.publish_pose(place)

    def _apply_initial_pose(self, posed: PosedScan) -> None:
        """Apply an initial pose that was published since the last scan."""
        topic = self._settings.initial_pose_topic
        newest = self.intake.newest(topic)
        if newest is None or newest[0] <= self._relocated_ns:
            return
        self._relocated_ns = newest[0]
        pose = newest[1].pose
        if self._published is not None and np.abs(pose - self._published).max() < _SAME_M:
            return  # our own
        base = self.intake.pose_at(topic, posed.scan.stamp_ns)
        if base is not None:
            self.engine.relocate(posed, base.pose)

    def _apply_absolute_pose(self) -> None:
        """Fit the map to absolute poses, where there are some."""
        newest = self.intake.newest(self._settings.fix_topic)
        if newest is None or newest[0] <= self._fix_ns:
            return
        self._fix_ns = newest[0]
        try:
            self.engine.add_absolute_pose(newest[0], newest[1].pose, newest[1].covariance)
        except ValueError as error:
            self.intake.problem = f'{self._settings.fix_topic}: {error}'

    def save_state(self, is_last: bool = False) -> None:
        """Save the state, to resume from it."""
        engine, loaded = self.engine, self.commands.loaded
        here = engine.last_pose
        left = self._left_as
        if left is not None and (here is not None or engine.graph is not left[0]
                                 or loaded != left[1]):
            self._left_as = left = None
        if engine.drawing.version and left is None:
            self.store.save_state(engine.graph, Resumption.extra(
                self._settings, engine.mode, loaded, self.link.run_id,
                None if here is None else here[0],
                None if here is None else self.intake.raw_odometry(here[1].base)), is_last)

    def _publish(self, now_ns: int) -> None:
        outputs, engine = self.outputs, self.engine
        outputs.publish_grid(now_ns, engine.drawing.version, engine.grid, engine.drawing.drawn_ns)
        outputs.publish_graph(now_ns, engine.drawing.version, engine.path, engine.graph)
        state = self._state()
        outputs.publish_state(state)
        if outputs.is_status_due(now_ns):
            problem = self._problem()
            level = 1 if problem or state.startswith('lost') else 0
            outputs.publish_status(now_ns, level, problem or state, self.statistics())
            words = _NUMBER.sub('', problem)  # a changed number alone is not logged again
            if problem and words != self._told_problem:
                self._tell(problem)
            self._told_problem = words

    def _state(self) -> str:
        """Return the state in one line."""
        engine, hindrance = self.engine, self.intake.blocking_problem
        if hindrance and not engine.is_paused:
            return f'lost: {hindrance}'
        state = (self.exploring.state if engine.state == MAPPING else '') or engine.state
        return f'{state}; {self.recovery_spin.state}' if self.recovery_spin.state else state

    def _problem(self) -> str:
        """Return the problems, the worst first; empty without any."""
        found = [self.intake.warning(self.link.is_connected),
                 *self.engine.checks.warnings(self.intake.newest_ns), self.store.problem]
        return '; '.join(filter(None, found))

    def statistics(self) -> dict[str, Any]:
        """Return all counters."""
        return {**self.intake.statistics(), **self.engine.statistics(), **self.link.counts,
                **self.commands.counts, **self.store.counts, **self.exploring.statistics()}

    # ---- in the thread of the link -----------------------------------------------------------

    def _on_connection(self, is_new: bool) -> None:
        """Handle a new connection."""
        self.intake.connected()
        if is_new:
            self.intake.core_restarted()
            self._is_new_core = True

    def _on_command(self, stamp_ns: int, missed: int, cdr: memoryview) -> None:
        if stamp_ns < self._begun_ns:
            return  # it was published before this process started
        try:
            self._given.append(string_in(cdr))
        except ValueError as error:
            self._tell(f'{COMMAND}: {error}')
        self.intake.new.set()

    def _on_planner_state(self, stamp_ns: int, missed: int, cdr: memoryview) -> None:
        self.exploring.add_planner_state(stamp_ns, missed, cdr)

    def _mount_of(self, frame_id: str) -> LaserMount | None:
        mounting = self._settings.mounting() or self.link.mounting_of(frame_id)
        return None if mounting is None else LaserMount.of(mounting)


def _pose_handler(intake: ScanIntake, topic: str) -> SampleHandler:
    return lambda stamp_ns, missed, cdr: intake.add_pose(topic, stamp_ns, cdr)
