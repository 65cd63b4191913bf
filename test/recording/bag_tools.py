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

"""Write recordings anew with something changed, with all sums right: as a forger would."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any

from mcap.reader import make_reader

from rt_robot_os.core.tap_format import is_tap
from rt_robot_os.core.tap_format import MESSAGE
from rt_robot_os.recording.bag_file import BagFile
from rt_robot_os.recording.bag_info import TopicFacts
from rt_robot_os.recording.reading import Recorded
from rt_robot_os.recording.reading import Recording
from rt_robot_os.recording.session import SESSION
from rt_robot_os.recording.session import SETTINGS

Change = Callable[[dict[str, str], dict[str, Any]], None]


def session_of(file: Path) -> tuple[dict[str, str], dict[str, Any]]:
    """Give what a file says of its session, and the settings in it."""
    with file.open('rb') as stream:
        reader = make_reader(stream)
        facts, = [each.metadata for each in reader.iter_metadata() if each.name == SESSION]
        settings, = [each.data for each in reader.iter_attachments() if each.name == SETTINGS]
    return dict(facts), json.loads(settings)


def rewrite(folder: Path, path: Path, change: Change = lambda facts, settings: None,
            each: Callable[[Recorded], bytes | None] = lambda sample: sample.cdr,
            settings_text: str | None = None, old_form: bool = False) -> Path:
    """
    Write a recording of one file anew.

    :param change: what it says of its session, and its settings; in place.
    :param each: gives the bytes of each sample; None leaves it out.
    :param settings_text: instead of the settings.
    :param old_form: as the first release wrote it: all topics in sight, under their core's names.
    """
    facts, settings = session_of(next(folder.glob('*.mcap')))
    change(facts, settings)
    recording = Recording(folder)
    file = BagFile(path, 'test')
    file.note(SESSION, {**facts, 'format': '1'} if old_form else facts)
    text = json.dumps(settings) if settings_text is None else settings_text
    file.attach(SETTINGS, 'application/json', text.encode())
    samples = list(recording.samples())
    channels = {}
    for topic in dict.fromkeys(sample.topic for sample in samples):
        if is_tap(topic) and not old_form:
            channels[topic] = file.kept_channel(topic)
        else:
            shown = recording.topics.get(topic)
            channels[topic] = file.channel(
                TopicFacts(f'/{topic}', shown.type_name if shown is not None else MESSAGE)
                if old_form or shown is None else shown)
    for sample in samples:
        cdr, topic = each(sample), sample.topic
        if cdr is None:
            continue
        if is_tap(topic) and not old_form:
            file.keep(channels[topic], sample.log_ns, cdr, sample.number)
        else:
            file.add(channels[topic], sample.log_ns, cdr, sample.number, sample.log_ns)
    file.finish()
    return path
