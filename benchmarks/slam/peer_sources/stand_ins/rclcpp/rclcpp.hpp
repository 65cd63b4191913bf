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

// What Karto's solver uses of rclcpp, so that it builds without ROS.

#ifndef RCLCPP__RCLCPP_HPP_
#define RCLCPP__RCLCPP_HPP_

#include <cstdio>
#include <memory>
#include <string>

namespace rclcpp
{

struct Logger {};

inline Logger get_logger(const char *) {return {};}

struct ParameterValue
{
  explicit ParameterValue(std::string value)
  : text(std::move(value)) {}

  std::string as_string() const {return text;}
  bool as_bool() const {return text == "true";}

  std::string text;
};

}  // namespace rclcpp

#define RCLCPP_INFO(logger, ...) (void)(logger)
#define RCLCPP_DEBUG(logger, ...) (void)(logger)
#define RCLCPP_WARN(logger, ...) (void)(logger), std::fprintf(stderr, __VA_ARGS__)
#define RCLCPP_ERROR(logger, ...) (void)(logger), std::fprintf(stderr, __VA_ARGS__)

#endif  // RCLCPP__RCLCPP_HPP_
