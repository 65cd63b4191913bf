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

// The two types that Karto's solver uses of slam_toolbox.

#ifndef SLAM_TOOLBOX__TOOLBOX_TYPES_HPP_
#define SLAM_TOOLBOX__TOOLBOX_TYPES_HPP_

#include <unordered_map>

#include "karto_sdk/Mapper.h"

namespace toolbox_types
{

using GraphIterator = std::unordered_map<int, Eigen::Vector3d>::iterator;
using ConstGraphIterator = std::unordered_map<int, Eigen::Vector3d>::const_iterator;

}  // namespace toolbox_types

#endif  // SLAM_TOOLBOX__TOOLBOX_TYPES_HPP_
