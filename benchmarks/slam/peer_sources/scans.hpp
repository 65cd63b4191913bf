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

// The scans that a mapper is given, and what it gives back.
//
// Standard input: a line "beams angle_min angle_increment range_max", then for each scan a line
// "seconds x y yaw range ...", in m and rad. Settings are those of the file that the mapper ships;
// arguments NAME=VALUE replace some of them. Standard output:
// the CPU seconds of all threads that mapping took, without reading; then a line "x y yaw" for
// each scan.

#ifndef SCANS_HPP_
#define SCANS_HPP_

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

struct Pose
{
  double x, y, yaw;
};

struct Scan
{
  double seconds;
  Pose odometry;
  std::vector<double> ranges;
};

struct Log
{
  int beams;
  double angle_min, angle_increment, range_max;
  std::vector<Scan> scans;
};

using Settings = std::map<std::string, std::string>;

inline Log read_log()
{
  Log log{};
  std::string line;
  std::getline(std::cin, line);
  std::istringstream(line) >> log.beams >> log.angle_min >> log.angle_increment >> log.range_max;
  while (std::getline(std::cin, line)) {
    const char * at = line.c_str();
    char * end = nullptr;
    std::vector<double> values;
    for (double value = std::strtod(at, &end); end != at; value = std::strtod(at, &end)) {
      values.push_back(value);
      at = end;
    }
    if (values.size() != static_cast<std::size_t>(4 + log.beams)) {
      std::cerr << "a scan of " << values.size() << " values instead of " << 4 + log.beams << "\n";
      std::exit(2);
    }
    log.scans.push_back(
      {values[0], {values[1], values[2], values[3]}, {values.begin() + 4, values.end()}});
  }
  return log;
}

// Read "name: value" or "name value" of each line, with a comment behind a #; then the arguments.
inline Settings read_settings(const char * path, int count, char ** words)
{
  Settings settings;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line); ) {
    line = line.substr(0, line.find('#'));
    std::replace(line.begin(), line.end(), ':', ' ');
    std::istringstream parts(line);
    std::string name, value;
    if (parts >> name >> value) {
      settings[name] = value;
    }
  }
  if (settings.empty()) {
    std::cerr << path << ": no settings in it\n";
    std::exit(2);
  }
  for (int at = 1; at < count; ++at) {
    const std::string word = words[at];
    const auto sign = word.find('=');
    if (sign == std::string::npos) {
      std::cerr << word << ": a setting is NAME=VALUE\n";
      std::exit(2);
    }
    settings[word.substr(0, sign)] = word.substr(sign + 1);
  }
  return settings;
}

inline double number(const Settings & settings, const std::string & name, double otherwise)
{
  const auto found = settings.find(name);
  if (found == settings.end()) {
    return otherwise;
  }
  const std::string & text = found->second;
  return text == "on" || text == "true" ? 1.0 : std::atof(text.c_str());
}

inline double cpu_seconds()
{
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  return used.ru_utime.tv_sec + used.ru_stime.tv_sec +
         1e-6 * (used.ru_utime.tv_usec + used.ru_stime.tv_usec);
}

// Where a robot is that was at a pose and moved as odometry says.
inline Pose moved(const Pose & from, const Pose & odometry_then, const Pose & odometry_now)
{
  const double turn = from.yaw - odometry_then.yaw;
  const double x = odometry_now.x - odometry_then.x, y = odometry_now.y - odometry_then.y;
  return {from.x + std::cos(turn) * x - std::sin(turn) * y,
    from.y + std::sin(turn) * x + std::cos(turn) * y, odometry_now.yaw + turn};
}

inline void write_poses(double seconds, const std::vector<Pose> & poses)
{
  std::printf("%.6f\n", seconds);
  for (const Pose & pose : poses) {
    std::printf("%.6f %.6f %.7f\n", pose.x, pose.y, pose.yaw);
  }
}

#endif  // SCANS_HPP_
