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

"""The public names of the package; loaded when one of them is used."""

from __future__ import annotations

from rt_robot_os.core.dumps.dump_file import DumpFile
from rt_robot_os.core.dumps.dump_file import read_dump
from rt_robot_os.core.dumps.dump_file import write_parts
from rt_robot_os.core.dumps.dump_parts import join
from rt_robot_os.core.dumps.dump_parts import parts
from rt_robot_os.core.dumps.folder import default_folder
from rt_robot_os.core.dumps.folder import dumps
from rt_robot_os.core.dumps.folder import file_name
from rt_robot_os.core.dumps.folder import newest
from rt_robot_os.tools.black_box.chains import Chain
from rt_robot_os.tools.black_box.chains import chain_text
from rt_robot_os.tools.black_box.chains import find_chains
from rt_robot_os.tools.black_box.chart import Chart
from rt_robot_os.tools.black_box.chart import chart_of
from rt_robot_os.tools.black_box.chart import window
from rt_robot_os.tools.black_box.chart_drawing import save as save_chart
from rt_robot_os.tools.black_box.history import History
from rt_robot_os.tools.black_box.history import Job
from rt_robot_os.tools.black_box.history import Outcome
from rt_robot_os.tools.black_box.history import understand
from rt_robot_os.tools.black_box.perfetto import perfetto_document
from rt_robot_os.tools.black_box.text_report import show

__all__ = [
    'Chain', 'chain_text', 'Chart', 'chart_of', 'default_folder', 'DumpFile', 'dumps', 'file_name',
    'find_chains', 'History', 'Job', 'join', 'newest', 'Outcome', 'parts', 'perfetto_document',
    'read_dump', 'save_chart', 'show', 'understand', 'window', 'write_parts',
]
