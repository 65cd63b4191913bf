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

"""Commands of operators and services: ``save``, ``load``, ``reset``, and modes of mapping."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import asdict
from pathlib import Path
from typing import Final
from urllib.parse import unquote

from rt_robot_os.base.errors import ConfigError
from rt_robot_os.base.safe_text import safe_line
from rt_robot_os.features.mapping.engine import Engine
from rt_robot_os.features.mapping.process.exploring import Exploring
from rt_robot_os.features.mapping.process.map_store import error_text
from rt_robot_os.features.mapping.process.map_store import MapStore
from rt_robot_os.features.mapping.robot_pose import Hint
from rt_robot_os.features.mapping.robot_pose import LoadedMap
from rt_robot_os.features.mapping.settings import LOCALIZATION
from rt_robot_os.features.mapping.settings import MAPPING
from rt_robot_os.features.mapping.settings import MappingSettings
from rt_robot_os.features.mapping.slam import archive

_FILE_URL: Final = 'file://'
_HELP: Final = ('save [PATH], load PATH, reset, pause, resume, localization, mapping, explore, '
                'stop')
_SAVES_MAX: Final = 4
Say = Callable[[str, bool, str], None]


class MappingCommands:
    """
    Execute commands and publish their answers.

    :param map_file: of ``save`` without a path.
    :param hint: returns what knows the pose on a map that was loaded; None: it is searched.
    :param exploring: started by ``explore``.
    :param answer: called with the command, whether it succeeded, and a text.
    :ivar counts: ``commands`` and ``refused``.
    :ivar loaded: path of the map that was loaded last; empty when it was made here.
    """

    def __init__(self, settings: MappingSettings, engine: Engine, keeper: MapStore, map_file: Path,
                 hint: Callable[[], Hint | None], exploring: Exploring, answer: Say) -> None:
        self.counts = {'commands': 0, 'refused': 0}
        self.loaded = ''
        self._settings = settings
        self._engine = engine
        self._keeper = keeper
        self._map_file = map_file
        self._hint = hint
        self._exploring = exploring
        self._answer = answer
        self._saving: list[tuple[str, Future[Path]]] = []
        self._handlers: dict[str, Callable[[str, str], str | None]] = {
            'save': self._save, 'load': self._load, 'reset': self._reset, 'pause': self._pause,
            'resume': self._resume, LOCALIZATION: self._mode, MAPPING: self._mode,
            'explore': self._explore, 'stop': self._stop}

    def execute(self, text: str) -> None:
        """Execute one command."""
        self.counts['commands'] += 1
        word, _, rest = text.strip().partition(' ')
        try:
            does = self._handlers.get(word)
            if does is None:
                raise ConfigError([f'{safe_line(word) or "nothing"}: no such command; there are '
                                   f'{_HELP}'])
            rest = rest.strip()
            if rest and word not in ('save', 'load'):
                raise ConfigError([f'{word} has no argument, but {safe_line(rest)!r} follows '
                                   'it'])
            said = does(rest, text)
        except (ConfigError, OSError) as error:  # a path may be unreadable
            self._reject(text, error_text(error))
            return
        if said is not None:
            self._answer(text, True, said)

    def _reject(self, text: str, why: str) -> None:
        self.counts['refused'] += 1
        self._answer(text, False, why)

    def report_saves(self) -> None:
        """Answer the ``save`` commands that have ended."""
        for each in [each for each in self._saving if each[1].done()]:
            self._saving.remove(each)
            text, future = each
            try:
                self._answer(text, True, f'saved as {future.result()}')
            except Exception as error:  # any error of the disk
                self._reject(text, error_text(error))

    # ---- handlers ----------------------------------------------------------------------------

    def _save(self, rest: str, text: str) -> str | None:
        engine = self._engine
        engine.finish_drawing()
        if not engine.drawing.version:
            raise ConfigError(['there is no map yet: nothing was saved'])
        if len(self._saving) >= _SAVES_MAX:
            raise ConfigError(['too many maps are being saved: try again'])
        path = self._path(rest) if rest else self._map_file
        if path.is_dir() or rest.endswith('/'):
            raise ConfigError([f'{path}: is a folder: name a map in it'])
        if rest and not path.parent.is_dir():
            raise ConfigError([f'{path.parent}: this folder does not exist: create it first'])
        self._saving.append((text, self._keeper.save_map(
            path, engine.graph, engine.grid, asdict(self._settings))))
        return None

    def _load(self, rest: str, text: str) -> str:
        if not rest:
            raise ConfigError(['load needs the path of a map'])
        said, known = read_map(self._path(rest))
        self.loaded = str(self._path(rest))
        self._exploring.stop()
        self._engine.use_map(known, self._hint())
        return said

    def _reset(self, rest: str, text: str) -> str:
        self.loaded = ''
        self._exploring.stop()
        self._engine.begin_new()
        self._keeper.delete_state()
        return 'a new map begins; saved maps are unchanged'

    def _pause(self, rest: str, text: str) -> str:
        self._engine.is_paused = True
        return 'paused: scans are dropped'

    def _resume(self, rest: str, text: str) -> str:
        self._engine.is_paused = False
        return 'resumed: scans are processed again'

    def _mode(self, rest: str, text: str) -> str:
        mode = text.strip()
        self._engine.set_mode(mode)
        return 'the map grows' if mode == MAPPING else 'the map stays unmodified'

    def _explore(self, rest: str, text: str) -> str:
        if self._engine.mode != MAPPING:
            raise ConfigError(['the map stays unmodified in mode localization: send the command '
                               'mapping before explore'])
        self._engine.is_paused = False
        self._exploring.begin()
        return 'exploring'

    def _stop(self, rest: str, text: str) -> str:
        return ('exploring was stopped' if self._exploring.stop() else
                'nothing to stop: it does not explore')

    def _path(self, text: str) -> Path:
        """Return the path of a map; a relative one is relative to the folder of ``map_file``."""
        if text.startswith(_FILE_URL):
            text = unquote(text.removeprefix(_FILE_URL))
        if '\0' in text:
            raise ConfigError(['a path cannot contain NUL'])
        try:
            path = Path(text).expanduser()
        except RuntimeError as error:  # ~ of an unknown user
            raise ConfigError([f'{safe_line(text)}: {error}']) from error
        return path if path.is_absolute() else self._map_file.parent / path


def read_map(path: Path) -> tuple[str, LoadedMap]:
    """
    Read a map.

    :return: a description of it, and the map.
    :raises ConfigError: it cannot be used.
    """
    there = (path, path.with_name(f'{path.name}.yaml'))
    try:
        if path.suffix not in ('.yaml', '.yml') and not any(each.exists() for each in there):
            raise ConfigError([f'{path}: this map does not exist'])
        if path.suffix in ('.yaml', '.yml') and not path.exists():
            raise ConfigError([f'{path}: this file does not exist'])
        saved = archive.load(path)
    except OSError as error:
        raise ConfigError([error_text(error)]) from error
    size = 'a grid alone' if saved.graph is None else f'{len(saved.graph.keyframes)} scans'
    said = f'loaded {path}: {saved.grid.columns} x {saved.grid.rows} cells, {size}'
    return '; '.join([said, *saved.notes]), LoadedMap(saved.graph, saved.grid)
