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

// A node that has parameters, and nothing else.

#ifndef RCLCPP_LIFECYCLE__LIFECYCLE_NODE_HPP_
#define RCLCPP_LIFECYCLE__LIFECYCLE_NODE_HPP_

#include <map>
#include <memory>
#include <string>
#include <utility>

#include "rclcpp/rclcpp.hpp"

namespace rclcpp_lifecycle
{

class LifecycleNode
{
public:
  using SharedPtr = std::shared_ptr<LifecycleNode>;

  explicit LifecycleNode(std::map<std::string, std::string> parameters)
  : parameters_(std::move(parameters)) {}

  rclcpp::Logger get_logger() const {return {};}

  bool has_parameter(const std::string & name) const {return parameters_.count(name) > 0;}

  void declare_parameter(const std::string & name, const rclcpp::ParameterValue & value)
  {
    parameters_.emplace(name, value.text);
  }

  rclcpp::ParameterValue get_parameter(const std::string & name) const
  {
    const auto found = parameters_.find(name);
    return rclcpp::ParameterValue(found == parameters_.end() ? "" : found->second);
  }

private:
  std::map<std::string, std::string> parameters_;
};

}  // namespace rclcpp_lifecycle

#endif  // RCLCPP_LIFECYCLE__LIFECYCLE_NODE_HPP_
