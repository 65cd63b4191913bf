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
 * The calls that a timer and a gate make for each job, without ctypes; see timer.py, which holds
 * the same in Python, and makes and deletes the timers.
 */

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <limits.h>
#include <signal.h>
#include <time.h>

#define NS_PER_S 1000000000LL

typedef struct {
    PyObject_HEAD
    timer_t timer;
    long long again_ns;
} Alarm;

typedef struct {
    PyObject_HEAD
    sigset_t signals;
} Gate;

/* The attribute of whoever rests that is set when something came up. */
static PyObject *pending_name;

static PyObject *
alarm_new(PyTypeObject *type, PyObject *args, PyObject *kwds)
{
    long long timer, again_ns;
    if (kwds != NULL && PyDict_GET_SIZE(kwds)) {
        PyErr_SetString(PyExc_TypeError, "Alarm(timer, again_ns) takes no keywords");
        return NULL;
    }
    if (!PyArg_ParseTuple(args, "LL", &timer, &again_ns))
        return NULL;
    Alarm *self = (Alarm *)type->tp_alloc(type, 0);
    if (self != NULL) {
        self->timer = (timer_t)(intptr_t)timer;
        self->again_ns = again_ns;
    }
    return (PyObject *)self;
}

static PyObject *
alarm_arm(PyObject *object, PyObject *deadline)
{
    Alarm *self = (Alarm *)object;
    int overflow;
    long long deadline_ns = PyLong_AsLongLongAndOverflow(deadline, &overflow);
    if (overflow > 0)
        deadline_ns = LLONG_MAX;
    else if (deadline_ns == -1 && PyErr_Occurred())
        return NULL;
    struct itimerspec spec = {
        {self->again_ns / NS_PER_S, self->again_ns % NS_PER_S},
        {deadline_ns / NS_PER_S, deadline_ns % NS_PER_S},
    };
    if (timer_settime(self->timer, TIMER_ABSTIME, &spec, NULL) < 0)
        return PyErr_SetFromErrno(PyExc_OSError);
    Py_RETURN_NONE;
}

static PyObject *
gate_new(PyTypeObject *type, PyObject *args, PyObject *kwds)
{
    unsigned long long mask;
    if (kwds != NULL && PyDict_GET_SIZE(kwds)) {
        PyErr_SetString(PyExc_TypeError, "Gate(mask) takes no keywords");
        return NULL;
    }
    if (!PyArg_ParseTuple(args, "K", &mask))
        return NULL;
    Gate *self = (Gate *)type->tp_alloc(type, 0);
    if (self != NULL) {
        sigemptyset(&self->signals);
        for (int signo = 1; signo <= 64; signo++)
            if (mask >> (signo - 1) & 1)
                sigaddset(&self->signals, signo);
    }
    return (PyObject *)self;
}

static PyObject *
gate_hold(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    pthread_sigmask(SIG_BLOCK, &((Gate *)self)->signals, NULL);
    Py_RETURN_NONE;
}

static PyObject *
gate_admit(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    pthread_sigmask(SIG_UNBLOCK, &((Gate *)self)->signals, NULL);
    Py_RETURN_NONE;
}

static PyObject *
gate_wait(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    int signo;
    Py_BEGIN_ALLOW_THREADS
    signo = sigwaitinfo(&((Gate *)self)->signals, NULL);
    Py_END_ALLOW_THREADS
    return PyLong_FromLong(signo);
}

static PyObject *
gate_rest(PyObject *self, PyObject *owner)
{
    const sigset_t *signals = &((Gate *)self)->signals;
    int signo = 0;
    pthread_sigmask(SIG_BLOCK, signals, NULL);
    /* The handlers of what came before leave their notes; what comes from here on is held. */
    int failed = PyErr_CheckSignals();
    if (!failed) {
        PyObject *pending = PyObject_GetAttr(owner, pending_name);
        failed = pending == NULL;
        if (pending == Py_False) {
            Py_BEGIN_ALLOW_THREADS
            signo = sigwaitinfo(signals, NULL);
            Py_END_ALLOW_THREADS
        }
        Py_XDECREF(pending);
    }
    pthread_sigmask(SIG_UNBLOCK, signals, NULL);
    return failed ? NULL : PyLong_FromLong(signo);
}

static void
object_dealloc(PyObject *self)
{
    PyTypeObject *type = Py_TYPE(self);
    type->tp_free(self);
    Py_DECREF(type);
}

static PyMethodDef alarm_methods[] = {
    {"arm", alarm_arm, METH_O, "Fire at a deadline in nanoseconds on CLOCK_MONOTONIC."},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot alarm_slots[] = {
    {Py_tp_new, alarm_new},
    {Py_tp_dealloc, object_dealloc},
    {Py_tp_methods, alarm_methods},
    {0, NULL},
};

static PyType_Spec alarm_spec = {
    "rt_robot_os.linux._timer.Alarm", sizeof(Alarm), 0, Py_TPFLAGS_DEFAULT, alarm_slots,
};

static PyMethodDef gate_methods[] = {
    {"hold", gate_hold, METH_NOARGS, "Keep the signals pending."},
    {"admit", gate_admit, METH_NOARGS, "Let the signals through again."},
    {"wait", gate_wait, METH_NOARGS, "Sleep until one of the held signals is there; take it."},
    {"rest", gate_rest, METH_O, "Hold them, wait unless something is pending, and admit them."},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot gate_slots[] = {
    {Py_tp_new, gate_new},
    {Py_tp_dealloc, object_dealloc},
    {Py_tp_methods, gate_methods},
    {0, NULL},
};

static PyType_Spec gate_spec = {
    "rt_robot_os.linux._timer.Gate", sizeof(Gate), 0, Py_TPFLAGS_DEFAULT, gate_slots,
};

static struct PyModuleDef module_definition = {
    PyModuleDef_HEAD_INIT, "_timer", "The calls of timer.py without ctypes.", -1, NULL,
    NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC
PyInit__timer(void)
{
    pending_name = PyUnicode_InternFromString("pending");
    PyObject *module = PyModule_Create(&module_definition);
    PyObject *alarm = PyType_FromSpec(&alarm_spec), *gate = PyType_FromSpec(&gate_spec);
    if (pending_name == NULL || module == NULL || alarm == NULL || gate == NULL
            || PyModule_AddObject(module, "Alarm", alarm) < 0
            || PyModule_AddObject(module, "Gate", gate) < 0)
        return NULL;
    return module;
}
