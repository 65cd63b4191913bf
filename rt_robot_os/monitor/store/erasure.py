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
Erase a person: what was measured of them, alarms about them, and their name wherever else it is.

The audit keeps who saw what of whom, which is what it is for; backups are the keeper's to delete.
"""

from __future__ import annotations

from dataclasses import dataclass
import json
import re
from typing import Any
from typing import Final

from rt_robot_os.monitor.store.engine import reading
from rt_robot_os.monitor.store.engine import writing
from rt_robot_os.monitor.store.retention import drop
from rt_robot_os.monitor.store.tables import ALARM_EVENTS
from rt_robot_os.monitor.store.tables import ALARM_NOTES
from rt_robot_os.monitor.store.tables import ALARMS
from rt_robot_os.monitor.store.tables import EVENTS
from rt_robot_os.monitor.store.tables import MEDIA
from rt_robot_os.monitor.store.tables import NODES
from rt_robot_os.monitor.store.tables import OBSERVATIONS
from rt_robot_os.monitor.store.tables import PEOPLE
from rt_robot_os.monitor.store.tables import PLACES
from rt_robot_os.monitor.store.tables import ROBOT_PEOPLE
from rt_robot_os.monitor.store.tables import ROBOTS
from rt_robot_os.monitor.store.tables import SERIES
from rt_robot_os.monitor.store.tables import UNKNOWN
from sqlalchemy import Connection
from sqlalchemy import delete
from sqlalchemy import Engine
from sqlalchemy import select
from sqlalchemy import Table
from sqlalchemy import update

#: Stands where a name was.
NOBODY: Final = '(erased)'
#: Where a name may stand in a text.
_TEXTS: Final[tuple[tuple[Table, tuple[str, ...]], ...]] = (
    (ALARMS, ('subject', 'text', 'by', 'why', 'acknowledged_by')), (ALARM_EVENTS, ('content',)),
    (ALARM_NOTES, ('text', 'by')), (EVENTS, ('content',)), (NODES, ('content',)),
    (UNKNOWN, ('content', 'why')), (ROBOTS, ('details',)), (OBSERVATIONS, ('source',)))


@dataclass
class Erased:
    """
    What was erased.

    :ivar rows: deleted, by table.
    :ivar changed: rows of others in which the name stood.
    :ivar files: pictures and clips that have to be deleted: robot and SHA-256.
    """

    rows: dict[str, int]
    changed: int
    files: list[tuple[str, str]]


def erase(engine: Engine, person: str) -> Erased:
    """
    Erase a person; when it ends early, do it again.

    :raises StoreError: the database is away or full.
    """
    with reading(engine) as connection:
        number = connection.execute(select(PEOPLE.c.id).where(
            PEOPLE.c.person == person)).scalar()
        series = list(connection.execute(select(SERIES.c.id).where(
            SERIES.c.person_id == number)).scalars())
    # Most of it in steps, so that robots can go on writing.
    rows = {'observations': sum(drop(engine, OBSERVATIONS, OBSERVATIONS.c.series_id == each)
                                for each in series),
            'places': drop(engine, PLACES, PLACES.c.person_id == number)}
    with writing(engine) as connection:
        files = _media(connection, person, rows)
        rows['alarms'] = connection.execute(delete(ALARMS).where(
            ALARMS.c.subject == person)).rowcount
        connection.execute(delete(ROBOT_PEOPLE).where(ROBOT_PEOPLE.c.person_id == number))
        rows['people'] = connection.execute(delete(PEOPLE).where(PEOPLE.c.id == number)).rowcount
    changed = 0
    for table, columns in _TEXTS:
        for column in columns:
            changed += _take_out(engine, table, column, person)
    return Erased(rows, changed, files)


def _media(connection: Connection, person: str, rows: dict[str, int]) -> list[tuple[str, str]]:
    """Delete the media of a person's alarms; return the files of which nothing is left."""
    about = (MEDIA.c.robot_id == ALARMS.c.robot_id) & (MEDIA.c.alarm == ALARMS.c.alarm)
    found = connection.execute(select(MEDIA.c.id, ROBOTS.c.robot, MEDIA.c.sha256).join(
        ROBOTS, ROBOTS.c.id == MEDIA.c.robot_id).join(ALARMS, about).where(
            ALARMS.c.subject == person)).all()
    for one in found:
        connection.execute(delete(MEDIA).where(MEDIA.c.id == one.id))
    rows['media'] = len(found)
    left = {(each.robot, each.sha256) for each in connection.execute(select(
        ROBOTS.c.robot, MEDIA.c.sha256).join(ROBOTS, ROBOTS.c.id == MEDIA.c.robot_id).where(
            MEDIA.c.sha256.in_([each.sha256 for each in found])))}
    return sorted({(each.robot, each.sha256) for each in found} - left)


def _take_out(engine: Engine, table: Table, column: str, person: str) -> int:
    """Replace a name, as a word, in all texts of a column."""
    word = re.compile(rf'(?<![^\W_]){re.escape(person)}(?![^\W_])')
    is_json = column in ('content', 'details')
    # In JSON some characters are written as escapes.
    shown = json.dumps(person, ensure_ascii=False)[1:-1] if is_json else person
    after = changed = 0
    while True:
        with reading(engine) as connection:
            found = connection.execute(select(table.c.id, table.c[column]).where(
                table.c.id > after, table.c[column].contains(shown, autoescape=True)).order_by(
                    table.c.id).limit(1000)).all()
        if not found:
            return changed
        after = found[-1][0]
        with writing(engine) as connection:
            for number, text in found:
                new = _replaced(text, word, is_json)
                if new != text:
                    changed += 1
                    connection.execute(update(table).where(table.c.id == number), {column: new})


def _replaced(text: str, word: re.Pattern[str], is_json: bool) -> str:
    if not is_json:
        return word.sub(NOBODY, text)
    try:
        return json.dumps(_within(json.loads(text), word), ensure_ascii=False,
                          separators=(',', ':'))
    except ValueError:  # What was kept aside is cut.
        return word.sub(NOBODY, text)


def _within(found: Any, word: re.Pattern[str]) -> Any:
    if isinstance(found, str):
        return word.sub(NOBODY, found)
    if isinstance(found, dict):
        return {word.sub(NOBODY, name): _within(value, word) for name, value in found.items()
                if not (name and word.fullmatch(name))}
    if isinstance(found, list):
        return [_within(each, word) for each in found]
    return found
