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

// Map scans with slam_toolbox's Karto and its Ceres solver.

#include <memory>

#include "karto_sdk/Mapper.h"
#include "solvers/ceres_solver.hpp"

#include "scans.hpp"

namespace
{

// Give a mapper the settings that are named; the others keep the defaults of the library.
void configure(karto::Mapper & mapper, const Settings & settings)
{
  using Mapper = karto::Mapper;
  const std::map<std::string, void (Mapper::*)(double)> numbers = {
    {"minimum_time_interval", &Mapper::setParamMinimumTimeInterval},
    {"minimum_travel_distance", &Mapper::setParamMinimumTravelDistance},
    {"minimum_travel_heading", &Mapper::setParamMinimumTravelHeading},
    {"scan_buffer_maximum_scan_distance", &Mapper::setParamScanBufferMaximumScanDistance},
    {"link_match_minimum_response_fine", &Mapper::setParamLinkMatchMinimumResponseFine},
    {"link_scan_maximum_distance", &Mapper::setParamLinkScanMaximumDistance},
    {"loop_search_maximum_distance", &Mapper::setParamLoopSearchMaximumDistance},
    {"loop_match_maximum_variance_coarse", &Mapper::setParamLoopMatchMaximumVarianceCoarse},
    {"loop_match_minimum_response_coarse", &Mapper::setParamLoopMatchMinimumResponseCoarse},
    {"loop_match_minimum_response_fine", &Mapper::setParamLoopMatchMinimumResponseFine},
    {"correlation_search_space_dimension", &Mapper::setParamCorrelationSearchSpaceDimension},
    {"correlation_search_space_resolution", &Mapper::setParamCorrelationSearchSpaceResolution},
    {"correlation_search_space_smear_deviation",
      &Mapper::setParamCorrelationSearchSpaceSmearDeviation},
    {"loop_search_space_dimension", &Mapper::setParamLoopSearchSpaceDimension},
    {"loop_search_space_resolution", &Mapper::setParamLoopSearchSpaceResolution},
    {"loop_search_space_smear_deviation", &Mapper::setParamLoopSearchSpaceSmearDeviation},
    {"distance_variance_penalty", &Mapper::setParamDistanceVariancePenalty},
    {"angle_variance_penalty", &Mapper::setParamAngleVariancePenalty},
    {"fine_search_angle_offset", &Mapper::setParamFineSearchAngleOffset},
    {"coarse_search_angle_offset", &Mapper::setParamCoarseSearchAngleOffset},
    {"coarse_angle_resolution", &Mapper::setParamCoarseAngleResolution},
    {"minimum_angle_penalty", &Mapper::setParamMinimumAnglePenalty},
    {"minimum_distance_penalty", &Mapper::setParamMinimumDistancePenalty}};
  const std::map<std::string, void (Mapper::*)(int)> counts = {
    {"scan_buffer_size", &Mapper::setParamScanBufferSize},
    {"loop_match_minimum_chain_size", &Mapper::setParamLoopMatchMinimumChainSize}};
  const std::map<std::string, void (Mapper::*)(bool)> switches = {
    {"use_scan_matching", &Mapper::setParamUseScanMatching},
    {"use_scan_barycenter", &Mapper::setParamUseScanBarycenter},
    {"do_loop_closing", &Mapper::setParamDoLoopClosing},
    {"use_response_expansion", &Mapper::setParamUseResponseExpansion}};
  for (const auto & [name, set] : numbers) {
    if (settings.count(name)) {
      (mapper.*set)(number(settings, name, 0.0));
    }
  }
  for (const auto & [name, set] : counts) {
    if (settings.count(name)) {
      (mapper.*set)(static_cast<int>(number(settings, name, 0.0)));
    }
  }
  for (const auto & [name, set] : switches) {
    if (settings.count(name)) {
      (mapper.*set)(number(settings, name, 0.0) != 0.0);
    }
  }
}

karto::LaserRangeFinder * laser_of(const Log & log, double range_max, const karto::Name & name)
{
  auto * laser = karto::LaserRangeFinder::CreateLaserRangeFinder(
    karto::LaserRangeFinder_Custom, name);
  laser->SetMinimumRange(0.05);
  laser->SetMaximumRange(log.range_max);
  laser->SetMinimumAngle(log.angle_min);
  laser->SetMaximumAngle(log.angle_min + log.angle_increment * (log.beams - 1));
  laser->SetAngularResolution(log.angle_increment);
  laser->SetRangeThreshold(std::min(range_max, log.range_max));
  return laser;
}

}  // namespace

int main(int count, char ** words)
{
  const Settings settings = read_settings(SETTINGS, count, words);
  const Log log = read_log();
  const double begin = cpu_seconds();
  std::cout.rdbuf(nullptr);  // it reports its sensor there
  karto::Mapper mapper;
  configure(mapper, settings);
  solver_plugins::CeresSolver solver;
  solver.Configure(std::make_shared<rclcpp_lifecycle::LifecycleNode>(settings));
  mapper.SetScanSolver(&solver);
  karto::Dataset dataset;
  const karto::Name name("laser");
  dataset.Add(laser_of(log, number(settings, "max_laser_range", 20.0), name));
  // Each scan is seen from the last one that Karto has kept: the others it leaves out.
  std::vector<karto::LocalizedRangeScan *> kept;
  std::vector<std::size_t> base;
  for (const Scan & each : log.scans) {
    auto * scan = new karto::LocalizedRangeScan(name, each.ranges);
    const karto::Pose2 pose(each.odometry.x, each.odometry.y, each.odometry.yaw);
    scan->SetOdometricPose(pose);
    scan->SetCorrectedPose(pose);
    scan->SetTime(each.seconds);
    if (mapper.Process(scan)) {
      dataset.Add(scan);
      kept.push_back(scan);
    } else {
      delete scan;
    }
    base.push_back(kept.empty() ? 0 : kept.size() - 1);
  }
  const double seconds = cpu_seconds() - begin;
  std::vector<Pose> poses;
  for (std::size_t at = 0; at < log.scans.size() && !kept.empty(); ++at) {
    const auto * scan = kept[base[at]];
    const karto::Pose2 now = scan->GetCorrectedPose(), then = scan->GetOdometricPose();
    poses.push_back(
      moved(
        {now.GetX(), now.GetY(), now.GetHeading()}, {then.GetX(), then.GetY(), then.GetHeading()},
        log.scans[at].odometry));
  }
  write_poses(seconds, poses);
  std::fflush(stdout);
  std::_Exit(0);  // the library's own order of destruction is no concern here
}
