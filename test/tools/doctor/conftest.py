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

"""Let the tests of this folder import the recorded machines, and unpack them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import sys

import pytest

sys.path.insert(0, str(Path(__file__).parent))
pytest.register_assert_rewrite('recorded')

from recorded import Recorded  # noqa: E402
from recorded import unpack  # noqa: E402

Machine = Callable[..., Recorded]


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    """Unpack a machine, with files changed (None: taken away) and other facts."""

    def make(name: str, files: dict[str, str | None] | None = None, **facts: object) -> Recorded:
        system = unpack(name, tmp_path / str(len(list(tmp_path.iterdir()))))
        for path, content in (files or {}).items():
            place = system.path(path)
            if content is None:
                place.unlink()
                continue
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(content)
        return Recorded(system.root, {**system.facts, **facts})

    return make
