// Copyright 2026 The rt_robot_os authors
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.

// Map scans with GMapping, the particle filter of OpenSLAM.

#include <algorithm>
#include <cstdlib>

#include "gridfastslam/gridslamprocessor.h"
#include "sensor/sensor_odometry/odometrysensor.h"
#include "sensor/sensor_range/rangereading.h"
#include "sensor/sensor_range/rangesensor.h"

#include "scans.hpp"

namespace
{

using GMapping::GridSlamProcessor;
using GMapping::OrientedPoint;

void configure(GridSlamProcessor & processor, const Settings & s)
{
  processor.setMatchingParameters(
    number(s, "maxUrange", 80.0), number(s, "maxrange", 81.0), number(s, "sigma", 0.05),
    static_cast<int>(number(s, "kernelSize", 1)), number(s, "lstep", 0.05),
    number(s, "astep", 0.05), static_cast<int>(number(s, "iterations", 5)),
    number(s, "lsigma", 0.075), number(s, "ogain", 3.0),
    static_cast<unsigned int>(number(s, "lskip", 0)));
  processor.setMotionModelParameters(
    number(s, "srr", 0.1), number(s, "srt", 0.1), number(s, "str", 0.1), number(s, "stt", 0.1));
  processor.setUpdateDistances(
    number(s, "linearUpdate", 1.0), number(s, "angularUpdate", 0.5),
    number(s, "resampleThreshold", 0.5));
  processor.setgenerateMap(false);
  processor.setllsamplerange(number(s, "llsamplerange", 0.1));
  processor.setllsamplestep(number(s, "llsamplestep", 0.1));
  processor.setlasamplerange(number(s, "lasamplerange", 0.05));
  processor.setlasamplestep(number(s, "lasamplestep", 0.05));
  processor.setregScore(number(s, "regscore", 0.0004));
  processor.setcritScore(number(s, "critscore", 0.0));
  processor.setmaxMove(number(s, "maxMove", 1.0));
}

OrientedPoint point(const Pose & pose)
{
  return OrientedPoint(pose.x, pose.y, pose.yaw);
}

}  // namespace

int main(int count, char ** words)
{
  const Settings settings = read_settings(SETTINGS, count, words);
  const Log log = read_log();
  const auto seed = static_cast<unsigned int>(number(settings, "randseed", 1));
  std::srand(seed);
  srand48(seed);
  const double begin = cpu_seconds();
  std::ostream silent(nullptr);
  std::cout.rdbuf(nullptr);  // it reports each scan there
  GridSlamProcessor processor(silent);
  // Beams lie to both sides of where the middle one looks.
  const double middle = log.angle_min + 0.5 * log.angle_increment * (log.beams - 1);
  GMapping::RangeSensor laser(
    "FLASER", log.beams, log.angle_increment, OrientedPoint(0.0, 0.0, middle), 0.0,
    log.range_max);
  GMapping::OdometrySensor odometry("ODOM");
  GMapping::SensorMap sensors;
  sensors.insert({laser.getName(), &laser});
  sensors.insert({odometry.getName(), &odometry});
  processor.setSensorMap(sensors);
  configure(processor, settings);
  processor.init(
    static_cast<unsigned int>(number(settings, "particles", 30)), number(settings, "xmin", -100.0),
    number(settings, "ymin", -100.0), number(settings, "xmax", 100.0),
    number(settings, "ymax", 100.0), number(settings, "delta", 0.05),
    point(log.scans.front().odometry));
  std::vector<std::size_t> used;
  for (std::size_t at = 0; at < log.scans.size(); ++at) {
    const Scan & scan = log.scans[at];
    auto * reading = new GMapping::RangeReading(
      log.beams, scan.ranges.data(), &laser, scan.seconds);
    reading->setPose(point(scan.odometry));
    if (processor.processScan(*reading)) {
      used.push_back(at);
    }
  }
  const double seconds = cpu_seconds() - begin;
  // The way of the best particle, from its end; each other scan is seen from the last one used.
  std::vector<Pose> way;
  const auto & best = processor.getParticles()[processor.getBestParticleIndex()];
  for (const auto * node = best.node; node && node->parent; node = node->parent) {
    way.push_back({node->pose.x, node->pose.y, node->pose.theta});
  }
  std::reverse(way.begin(), way.end());
  if (way.size() != used.size()) {
    std::cerr << way.size() << " poses of " << used.size() << " scans\n";
    return 1;
  }
  std::vector<Pose> poses;
  std::size_t last = 0;
  for (std::size_t at = 0; at < log.scans.size(); ++at) {
    while (last + 1 < used.size() && used[last + 1] <= at) {
      ++last;
    }
    poses.push_back(moved(way[last], log.scans[used[last]].odometry, log.scans[at].odometry));
  }
  write_poses(seconds, poses);
  std::fflush(stdout);
  std::_Exit(0);
}
