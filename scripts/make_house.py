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
Make config/maps/house.yaml and house.pgm, the house of house_world.yaml beside it.

    PYTHONPATH=. .venv/bin/python scripts/make_house.py

It gives the same map each time. All lengths are in m; x goes to the right, y up.
"""

from __future__ import annotations

from make_flat import built
from make_flat import MAPS
from rt_robot_os.motion.grid_map import GridMap

SIZE_M = 18.0, 12.0

# Left, bottom, right, top.
WALLS = (
    (0.0, 0.0, 18.0, 0.2), (0.0, 11.8, 18.0, 12.0), (0.0, 0.0, 0.2, 12.0), (17.8, 0.0, 18.0, 12.0),
    (0.2, 5.1, 17.8, 5.2), (0.2, 6.6, 17.8, 6.7),  # on both sides of the corridor
    (6.4, 0.2, 6.5, 5.1), (10.4, 0.2, 10.5, 5.1), (12.9, 0.2, 13.0, 5.1),
    (4.4, 6.7, 4.5, 11.8), (9.0, 6.7, 9.1, 11.8), (12.9, 6.7, 13.0, 11.8), (15.2, 6.7, 15.3, 11.8),
)
DOORS = (
    (3.0, 5.1, 3.9, 5.2),      # living room
    (8.0, 5.1, 8.9, 5.2),      # kitchen
    (11.2, 5.1, 12.1, 5.2),    # bath
    (14.5, 5.1, 15.4, 5.2),    # anna
    (2.0, 6.6, 2.9, 6.7),      # study
    (6.3, 6.6, 7.2, 6.7),      # bob
    (10.5, 6.6, 11.4, 6.7),    # guests
    (13.7, 6.6, 14.6, 6.7),    # utility room
    (16.0, 6.6, 16.9, 6.7),    # workshop
    (6.4, 2.5, 6.5, 3.6),      # living room - kitchen
)
FURNITURE = (
    (0.2, 1.2, 1.1, 3.2),      # sofa
    (1.7, 1.8, 2.3, 2.7),      # low table
    (2.0, 0.2, 4.0, 0.6),      # sideboard
    (5.9, 0.2, 6.4, 1.9),      # shelf
    (6.5, 0.2, 10.4, 0.8),     # kitchen counter
    (9.8, 0.8, 10.4, 1.5),     # refrigerator
    (10.5, 0.2, 12.9, 0.9),    # bath tub
    (15.8, 0.2, 17.8, 1.8),    # anna's bed
    (13.0, 0.2, 13.6, 2.2),    # wardrobe
    (0.2, 11.1, 1.9, 11.8),    # desk
    (3.8, 8.5, 4.4, 11.0),     # bookcase
    (4.5, 10.2, 6.5, 11.8),    # bob's bed
    (8.4, 8.6, 9.0, 10.6),     # wardrobe
    (10.2, 10.2, 12.2, 11.8),  # guests' bed
    (14.5, 11.1, 15.2, 11.8),  # boiler
    (13.0, 11.1, 13.7, 11.8),  # washing machine
    (15.3, 11.1, 17.8, 11.8),  # workbench
)
LEGS = ((7.4, 2.2, 1.4, 0.8), (7.6, 3.1, 0.4, 0.4), (8.3, 1.6, 0.4, 0.4), (0.8, 10.5, 0.4, 0.4))


def made() -> GridMap:
    """Draw the house."""
    return built(SIZE_M, WALLS, DOORS, FURNITURE, LEGS)


def main() -> None:
    """Write it."""
    made().save(MAPS / 'house.yaml')


if __name__ == '__main__':
    main()
