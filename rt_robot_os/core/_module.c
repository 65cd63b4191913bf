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

/*
 * The extension module rt_robot_os._core: the other sources add their types to it. SOURCES and BUILD
 * say from which sources and how it was built; base/compiled/__init__.py decides whether it is used.
 */

#include "../base/_core.h"

#if defined(__clang__)
#define COMPILER __VERSION__
#elif defined(__GNUC__)
#define COMPILER "GCC " __VERSION__
#else
#define COMPILER "another compiler"
#endif

#ifdef __OPTIMIZE__
#define OPTIMISED ""
#else
#define OPTIMISED ", not optimised"
#endif

#define TEXT_OF(number) #number
#define TEXT(number) TEXT_OF(number)
#ifdef Py_LIMITED_API
#define FOR "Python 3.11 and later"
#else
#define FOR "Python " TEXT(PY_MAJOR_VERSION) "." TEXT(PY_MINOR_VERSION)
#endif

static struct PyModuleDef module_definition = {
    PyModuleDef_HEAD_INIT, "_core", "The classes that each job and each message use, in C.", -1, NULL,
    NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC
PyInit__core(void)
{
    PyObject *module = PyModule_Create(&module_definition);
    if (module == NULL)
        return NULL;
    if (PyModule_AddStringConstant(module, "SOURCES", RT_ROBOT_OS_SOURCES) < 0
            || PyModule_AddStringConstant(module, "BUILD",
                                          COMPILER ", for " FOR OPTIMISED) < 0
            || add_core_types(module) < 0
            || add_timer_types(module) < 0
            || add_ring_types(module) < 0) {
        Py_DECREF(module);
        return NULL;
    }
    return module;
}
