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
Make the tables of docs/mapping_accuracy.md: map each log, and compare it with its relations.

    ./scripts/bench mapping_accuracy [--pictures FOLDER] LOG ...

Beside NAME.csv.gz or NAME.log.gz stands NAME.relations.csv.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
import sys
import tempfile

from rt_robot_os.features.mapping.cli.command import run


def main() -> int:
    """
    Print a row for each log.

    :return: the exit code: 1 when a log could not be mapped or compared.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--pictures', metavar='FOLDER', type=Path)
    parser.add_argument('logs', metavar='LOG', nargs='+', type=Path)
    given = parser.parse_args()
    rows = []
    if given.pictures is not None:
        given.pictures.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for log in given.logs:
            name = log.name.partition('.')[0]
            report = Path(folder) / f'{name}.json'
            extra = [] if given.pictures is None else [
                '--picture', str(given.pictures / f'mapping_{name}.png')]
            if run(['--bag', str(log), '--report', str(report), '--relations',
                    str(log.with_name(f'{name}.relations.csv')), *extra]):
                continue
            found = json.loads(report.read_text())
            errors = found['errors']
            rows.append(f'| {name} | {found["scans"]} | {found["way_m"]:.0f} m | '
                        f'{errors["mean_m"]:.3f} m | {errors["mean_rad"]:.4f} rad | '
                        f'{errors["largest_m"]:.2f} m | {errors["loops_mean_m"]:.3f} m | '
                        f'{found["lost"]} | {found["scans_per_s"]:.0f} |')
    print('\n| log | scans | way | mean | mean turn | largest | loops | lost | scans a second |')
    print('|---|---|---|---|---|---|---|---|---|')
    print('\n'.join(rows))
    return 0 if len(rows) == len(given.logs) else 1


if __name__ == '__main__':
    sys.exit(main())
