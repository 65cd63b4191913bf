/*
 * Copyright 2026 The rt_robot_os authors
 *
 * Licensed under the Apache License, Version 2.0 (the "License");
 * you may not use this file except in compliance with the License.
 * You may obtain a copy of the License at
 *
 *     http://www.apache.org/licenses/LICENSE-2.0
 *
 * Unless required by applicable law or agreed to in writing, software
 * distributed under the License is distributed on an "AS IS" BASIS,
 * WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
 * See the License for the specific language governing permissions and
 * limitations under the License.
 */

/* What the sources of the extension module rt_robot_os._core share. */

#ifndef RT_ROBOT_OS_CORE_H
#define RT_ROBOT_OS_CORE_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>

/* Each adds the types of its source to the module; returns -1 with an exception set. */
int add_core_types(PyObject *module);
int add_timer_types(PyObject *module);
int add_ring_types(PyObject *module);

#endif
