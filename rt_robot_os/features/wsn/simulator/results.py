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


"""The results of a simulation, as plain values for tables, files and programs."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
import math
from typing import Any
from typing import Final

from rt_robot_os.base.units import NS_PER_MS
from rt_robot_os.base.units import NS_PER_S
from rt_robot_os.features.wsn.simulator.packet_statistics import Gap

#: Number of consecutive lost packets of a node that count as a gap.
GAP_PACKETS: Final = 2
_SECONDS_A_DAY: Final = 86_400.0


@dataclass(frozen=True)
class Results:
    """
    The results of one run; values by node exclude the sink, if not stated otherwise.

    :ivar ended_s: simulated time; less than ``seconds`` after an interruption.
    :ivar sinks: the sink of each network; more than 65,534 nodes are several networks.
    :ivar duplicates: packets that the sink received again.
    :ivar data_by_node: data frames sent by each node.
    :ivar latencies_ms: sorted.
    :ivar parents: None without a route.
    :ivar beacon_costs: the last cost advertised by each node, including the sink.
    :ivar costs_said: all costs advertised by each node while it had a route.
    :ivar parents_had: all parents of each node during the run.
    :ivar used_mah: charge used of each battery.
    :ivar outcomes: outcomes of frames at their destinations, by name.
    :ivar counters: sums of the protocols' counters.
    :ivar happenings: counts of events, by name.
    :ivar beacon_period_s: 0 where there is none.
    :ivar host: counts of the robot's model, if it was run; see :class:`.host.Host`.
    """

    scenario: str
    protocol: str
    seed: int
    seconds: float
    ended_s: float
    nodes: int
    generated: Mapping[int, int]
    delivered: Mapping[int, int]
    duplicates: int
    data_by_node: Mapping[int, int]
    beacons: int
    acks: int
    latencies_ms: Sequence[float]
    parents: Mapping[int, int | None]
    costs: Mapping[int, int]
    hops: Mapping[int, int]
    beacon_costs: Mapping[int, int]
    used_mah: Mapping[int, float]
    battery_mah: float
    costs_said: Mapping[int, frozenset[int]] = field(default_factory=dict)
    parents_had: Mapping[int, frozenset[int]] = field(default_factory=dict)
    gaps: Sequence[Gap] = ()
    beacon_period_s: float = 0.0
    outcomes: Mapping[str, int] = field(default_factory=dict)
    counters: Mapping[str, int] = field(default_factory=dict)
    happenings: Mapping[str, int] = field(default_factory=dict)
    host: Mapping[str, Any] = field(default_factory=dict)
    sinks: Sequence[int] = ()
    events: int = 0
    wall_s: float = 0.0

    @property
    def total_generated(self) -> int:
        """Return the number of packets generated."""
        return sum(self.generated.values())

    @property
    def total_delivered(self) -> int:
        """Return the number of packets delivered."""
        return sum(self.delivered.values())

    @property
    def delivery(self) -> float:
        """Return the share of packets delivered; NaN if none was generated."""
        made = self.total_generated
        return self.total_delivered / made if made else math.nan

    @property
    def data_transmissions(self) -> int:
        """Return the number of data frames sent, including retransmissions."""
        return sum(self.data_by_node.values())

    @property
    def transmissions(self) -> int:
        """Return the number of frames sent, without acknowledgements."""
        return self.data_transmissions + self.beacons

    def per_delivery(self, transmissions: int) -> float:
        """Return this number divided by the packets delivered; NaN if there were none."""
        return transmissions / self.total_delivered if self.total_delivered else math.nan

    @property
    def load_ratio(self) -> float:
        """Return the ratio of the largest relay load to the mean."""
        return _over_mean(self.data_by_node.values())

    @property
    def energy_ratio(self) -> float:
        """Return the ratio of the largest energy consumption to the mean."""
        return _over_mean(self.used_mah.values())

    @property
    def first_empty_days(self) -> float:
        """Return when the first battery is empty at this consumption; inf without any."""
        most = max(self.used_mah.values(), default=0.0)
        if most <= 0.0 or self.ended_s <= 0.0:
            return math.inf
        return self.battery_mah / most * self.ended_s / _SECONDS_A_DAY

    def latency_ms(self, part: float) -> float:
        """Return a quantile of the latencies, such as 0.95; NaN without any."""
        if not self.latencies_ms:
            return math.nan
        return self.latencies_ms[min(len(self.latencies_ms) - 1,
                                     int(part * len(self.latencies_ms)))]

    @property
    def gap_s(self) -> list[float]:
        """Return the durations of the gaps, sorted."""
        return sorted((gap.end_ns - gap.begin_ns) / NS_PER_S for gap in self.gaps)

    def as_json(self) -> dict[str, Any]:
        """Return plain values; unknown ones are None."""
        made = self.generated
        found: dict[str, Any] = _plain({
            'scenario': self.scenario, 'protocol': self.protocol, 'seed': self.seed,
            'seconds': self.ended_s, 'nodes': self.nodes,
            'generated': made, 'delivered': self.delivered, 'duplicates': self.duplicates,
            'data_transmissions': self.data_transmissions, 'beacons': self.beacons,
            'acks': self.acks, 'transmissions': self.transmissions, 'delivery': self.delivery,
            'delivery_by_node': {each: self.delivered[each] / count
                                 for each, count in made.items() if count},
            'transmissions_per_delivery': self.per_delivery(self.data_transmissions),
            'all_transmissions_per_delivery': self.per_delivery(self.transmissions),
            'latency_ms': {'p50': self.latency_ms(0.5), 'p95': self.latency_ms(0.95),
                           'max': self.latency_ms(1.0)},
            'parents': self.parents, 'costs': self.costs, 'hops': self.hops,
            'beacon_costs': self.beacon_costs,
            'relay_load': {'by_node': self.data_by_node,
                           'largest': max(self.data_by_node.values(), default=0),
                           'mean': _mean(self.data_by_node.values()),
                           'largest_over_mean': self.load_ratio},
            'energy': {'mah_by_node': self.used_mah, 'mean_mah': _mean(self.used_mah.values()),
                       'most_mah': max(self.used_mah.values(), default=0.0),
                       'largest_over_mean': self.energy_ratio},
            'first_empty_days': self.first_empty_days,
            'gaps': self._gaps_as_json(), 'losses': self.outcomes, 'counters': self.counters,
            **({'host': self.host} if self.host else {}),
            **({'sinks': list(self.sinks)} if len(self.sinks) > 1 else {}),
            'events': self.happenings,
            'events_run': self.events, 'wall_s': self.wall_s,
            'times_real_time': self.ended_s / self.wall_s if self.wall_s else None})
        return found

    def _gaps_as_json(self) -> dict[str, Any]:
        lengths, period = self.gap_s, self.beacon_period_s
        longest = lengths[-1] if lengths else 0.0
        return {'count': len(lengths), 'longest_s': longest,
                'median_s': lengths[len(lengths) // 2] if lengths else 0.0,
                'longest_beacon_periods': longest / period if period else None,
                'within_two_beacon_periods': sum(one <= 2 * period for one in lengths)
                / len(lengths) if period and lengths else None}


def _mean(values: Any) -> float:
    known = list(values)
    return sum(known) / len(known) if known else 0.0


def _over_mean(values: Any) -> float:
    known = list(values)
    mean = _mean(known)
    return max(known) / mean if mean else math.nan


def _plain(value: Any) -> Any:
    """Convert keys to strings, NaN and infinity to None, and round numbers."""
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, float):
        return round(value, 6) if math.isfinite(value) else None
    return value


def latencies_in_ms(latencies_ns: Sequence[int]) -> list[float]:
    """Return latencies as :class:`Results` has them."""
    return [each / NS_PER_MS for each in sorted(latencies_ns)]
