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

"""Mapping beside a core: what comes from there, what goes back, and what is left of it."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import time
from typing import Any

from benchmarks.slam.drives import Drive
from mapping_robot import Beside
from mapping_robot import odometry_message
from mapping_robot import scan_message
import numpy as np
from processes import wait_until
import pytest

from rt_robot_os.features.mapping.messages import pose_in
from rt_robot_os.features.mapping.process.live_mapping import LiveMapping
from rt_robot_os.features.mapping.settings import MappingSettings
from rt_robot_os.features.mapping.slam.archive import load
from rt_robot_os.features.mapping.slam.transforms import Floats
from rt_robot_os.messages.cdr import string_in
from rt_robot_os.messages.cdr import string_message

ORIGIN = MappingSettings(start='origin', fix_topic='', state_period_s=1.0, map_period_s=0.1)


class Beheld:
    """A robot that drives as it once drove, and who maps beside it, step by step."""

    def __init__(self, beside: Beside, flat: Drive, folder: Path) -> None:
        self.beside, self.flat, self.folder = beside, flat, folder
        for said in beside.heard.values():
            said.clear()
        self.told: list[str] = []
        self.zero_ns = time.monotonic_ns() - int(flat.odometry_ns[-1]) - 10 ** 9
        if beside.newest_ns:  # clearly before what another test has left in the core
            self.zero_ns = min(self.zero_ns, beside.newest_ns - 3 * 10 ** 9)
        self.live = self.begin()

    def begin(self) -> LiveMapping:
        self.live = LiveMapping(ORIGIN, self.beside.folder / 'robot.sock', self.folder,
                                self.told.append)
        self.live.link.start()
        self.until(lambda: self.live.link.is_connected and self.live.link.has('mapping/answer'),
                   'the connection')
        return self.live

    def until(self, condition: Any, what: str) -> Any:
        def looked() -> Any:
            self.beside.client.pump(0.0)
            self.live.step()
            self.beside.client.pump(0.0)
            return condition()
        return wait_until(looked, what)

    def drive(self, first: int, last: int) -> None:
        """Publish some scans with their odometry; each is mapped before the next."""
        flat, beside = self.flat, self.beside
        for scan in flat.scans[first:last]:
            before = flat.odometry_ns <= scan.stamp_ns + 20_000_000
            after = flat.odometry_ns >= scan.stamp_ns - 100_000_000
            for stamp_ns, pose in zip(flat.odometry_ns[before & after],
                                      flat.odometry[before & after]):
                beside.publish('odom', odometry_message(pose), self.zero_ns + int(stamp_ns))
            beside.publish('scan', scan_message(scan), self.zero_ns + scan.stamp_ns)
            beside.newest_ns = self.zero_ns + scan.stamp_ns
            taken = self.live.engine
            self.until(lambda: taken.last_ns >= self.zero_ns + scan.stamp_ns, 'a scan is mapped')

    def command(self, text: str) -> dict[str, Any]:
        answers = self.beside.heard['mapping/answer']
        answers.clear()
        self.beside.publish('mapping/command', string_message(text))
        self.until(lambda: answers, f'an answer to {text}')
        found: dict[str, Any] = json.loads(string_in(answers[0][1]))
        assert found['command'] == text
        return found

    def off(self) -> Floats:
        """Return how far the newest pose is off, as seen from the first."""
        stamp_ns, cdr = self.beside.heard['slam/pose'][-1]
        place = [each.stamp_ns + self.zero_ns for each in self.flat.scans].index(stamp_ns)
        return np.abs(pose_in(cdr).pose - self.flat.in_its_map()[place])

    def kill(self) -> None:
        """End it as kill -9 does, as far as that goes in one process."""
        self.live.link.stop()
        self.live.store.close()


@pytest.fixture
def beheld(beside: Beside, flat: Drive, tmp_path: Path) -> Iterator[Beheld]:
    made = Beheld(beside, flat, tmp_path)
    yield made
    made.kill()


def test_it_maps_saves_and_goes_on_after_it_was_killed(beheld: Beheld, tmp_path: Path) -> None:
    heard = beheld.beside.heard
    beheld.drive(0, 60)
    assert beheld.off().max() < 0.05
    assert beheld.until(lambda: heard['map'], 'a map')
    beheld.until(lambda: string_in(heard['mapping/state'][-1][1]) == 'mapping', 'the state')
    status = json.loads(string_in(beheld.until(lambda: heard['mapping/status'], 'status')[-1][1]))
    assert status['status'][0]['values']['connections'] == 1

    saved = beheld.command(f'save {tmp_path}/my flat')
    assert saved['ok'], saved
    graph = load(tmp_path / 'my flat').graph
    assert graph is not None and len(graph.keyframes) > 1
    assert beheld.command('save')['text'] == f'saved as {tmp_path}/map.yaml'

    kept = beheld.live.store.counts['states_kept']
    beheld.drive(60, 66)
    beheld.until(lambda: beheld.live.store.counts['states_kept'] > kept, 'the state on the disk')
    beheld.kill()
    beheld.begin()
    assert any('continuing with' in each for each in beheld.told)
    beheld.drive(66, 75)
    assert beheld.off().max() < 0.08 and beheld.live.engine.found == 0
    again = beheld.live.engine.graph
    assert again is not None and len(again.keyframes) >= len(graph.keyframes)


def test_who_has_not_seen_where_it_is_leaves_what_it_knew(beheld: Beheld) -> None:
    beheld.drive(0, 12)
    kept = beheld.live.store
    beheld.until(lambda: kept.counts['states_kept'], 'the state on the disk')
    beheld.live.save_state(is_last=True)
    beheld.kill()
    for _ in range(2):  # no scan comes, twice
        live = beheld.begin()
        beheld.until(lambda: live.engine.drawing.version, 'the map of before')
        beheld.until(lambda: live.intake.blocking_problem, 'silence')
        said = beheld.beside.heard['mapping/state']
        beheld.until(lambda: 'lost: no scans' in string_in(said[-1][1]), 'the state')
        live.save_state(is_last=True)
        beheld.kill()
    beheld.begin()
    beheld.drive(12, 14)
    assert beheld.off().max() < 0.05 and beheld.live.engine.found == 0


def test_commands_that_cannot_be_done_say_why_and_keep_the_map(beheld: Beheld, tmp_path: Path
                                                               ) -> None:
    assert 'no map yet' in beheld.command('save')['text']
    assert 'no map yet' in beheld.command('localization')['text']
    beheld.drive(0, 12)
    (tmp_path / 'torn.yaml').write_text('image: torn.pgm\nresolution: 0.05\n')
    (tmp_path / 'file').write_text('')
    for command, why in (
            ('fly', 'no such command'), ('', 'no such command'), ('reset now', 'has no argument'),
            ('load', 'needs the path'), ('load nowhere', 'does not exist'),
            ('load nowhere.yaml', 'does not exist'), (f'load {tmp_path}/torn.yaml', 'origin'),
            (f'save {tmp_path}/none/x', 'folder does not exist'),
            (f'save {tmp_path}', 'is a folder'), (f'save {tmp_path}/file/x', 'does not exist'),
            (f'save {tmp_path}/{"x" * 300}/x', 'too long'), (f'load {"x" * 300}', 'too long'),
            ('load ~nosuchuser17/x', 'home'), ('explore', 'goal_topic')):
        answer = beheld.command(command)
        assert not answer['ok'] and why in answer['text'], answer
    assert beheld.live.engine.state == 'mapping'
    assert beheld.live.commands.counts['refused'] == 16


def test_it_pauses_begins_anew_and_takes_the_map_for_granted(beheld: Beheld) -> None:
    heard = beheld.beside.heard
    beheld.drive(0, 12)
    beheld.until(lambda: len(heard['slam/pose']) == 12, 'all poses')
    assert beheld.command('pause')['ok']
    beheld.drive(12, 14)
    assert len(heard['slam/pose']) == 12
    assert beheld.command('resume')['ok']
    beheld.drive(14, 24)
    assert beheld.off().max() < 0.05
    assert beheld.command('localization')['ok']
    graph = beheld.live.engine.graph
    beheld.drive(24, 34)
    assert beheld.off().max() < 0.06 and beheld.live.engine.graph is graph
    assert beheld.command('mapping')['ok'] and beheld.command('reset')['ok']
    beheld.drive(34, 36)
    assert beheld.live.engine.graph is not None
    assert len(beheld.live.engine.graph.keyframes) == 1
