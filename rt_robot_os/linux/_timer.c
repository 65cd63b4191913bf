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
 * The system calls of a timer and a signal gate for each job, without ctypes. timer.py has the
 * same in Python; it also creates and deletes the timers.
 */

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <limits.h>
#include <signal.h>
#include <time.h>

#include "../base/_core.h"

#define NS_PER_S 1000000000LL

typedef struct {
    PyObject_HEAD
    timer_t timer;
    long long repeat_ns;
} PosixTimer;

typedef struct {
    PyObject_HEAD
    sigset_t signals;
} SignalGate;

/* The attribute of the owner that says that something came up. */
static PyObject *pending_name;

static PyObject *
allocate(PyTypeObject *type)
{
    return ((allocfunc)PyType_GetSlot(type, Py_tp_alloc))(type, 0);
}

static void
deallocate(PyObject *self)
{
    PyTypeObject *type = Py_TYPE(self);
    ((freefunc)PyType_GetSlot(type, Py_tp_free))(self);
    Py_DECREF(type);
}

static PyObject *
posix_timer_new(PyTypeObject *type, PyObject *args, PyObject *kwds)
{
    long long timer, repeat_ns;
    if (kwds != NULL && PyDict_Size(kwds) != 0) {
        PyErr_SetString(PyExc_TypeError, "PosixTimer(timer, repeat_ns) takes no keywords");
        return NULL;
    }
    if (!PyArg_ParseTuple(args, "LL", &timer, &repeat_ns))
        return NULL;
    PosixTimer *self = (PosixTimer *)allocate(type);
    if (self != NULL) {
        self->timer = (timer_t)(intptr_t)timer;
        self->repeat_ns = repeat_ns;
    }
    return (PyObject *)self;
}

static PyObject *
posix_timer_arm(PyObject *object, PyObject *deadline)
{
    PosixTimer *self = (PosixTimer *)object;
    int overflow;
    long long deadline_ns = PyLong_AsLongLongAndOverflow(deadline, &overflow);
    if (overflow > 0)
        deadline_ns = LLONG_MAX;
    else if (deadline_ns == -1 && PyErr_Occurred())
        return NULL;
    struct itimerspec spec = {
        {self->repeat_ns / NS_PER_S, self->repeat_ns % NS_PER_S},
        {deadline_ns / NS_PER_S, deadline_ns % NS_PER_S},
    };
    if (timer_settime(self->timer, TIMER_ABSTIME, &spec, NULL) < 0)
        return PyErr_SetFromErrno(PyExc_OSError);
    Py_RETURN_NONE;
}

static PyObject *
signal_gate_new(PyTypeObject *type, PyObject *args, PyObject *kwds)
{
    unsigned long long mask;
    if (kwds != NULL && PyDict_Size(kwds) != 0) {
        PyErr_SetString(PyExc_TypeError, "SignalGate(mask) takes no keywords");
        return NULL;
    }
    if (!PyArg_ParseTuple(args, "K", &mask))
        return NULL;
    SignalGate *self = (SignalGate *)allocate(type);
    if (self != NULL) {
        sigemptyset(&self->signals);
        for (int signo = 1; signo <= 64; signo++)
            if (mask >> (signo - 1) & 1)
                sigaddset(&self->signals, signo);
    }
    return (PyObject *)self;
}

static PyObject *
signal_gate_mask(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    pthread_sigmask(SIG_BLOCK, &((SignalGate *)self)->signals, NULL);
    Py_RETURN_NONE;
}

static PyObject *
signal_gate_unmask(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    pthread_sigmask(SIG_UNBLOCK, &((SignalGate *)self)->signals, NULL);
    Py_RETURN_NONE;
}

static PyObject *
signal_gate_wait_masked(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    int signo;
    Py_BEGIN_ALLOW_THREADS
    signo = sigwaitinfo(&((SignalGate *)self)->signals, NULL);
    Py_END_ALLOW_THREADS
    return PyLong_FromLong(signo);
}

/*
 * Masks signals, waits for one of them unless `owner.pending` is true, and unmasks them. Sets the
 * number of the signal; 0 when something was pending, -1 when another signal was handled instead.
 */
int
wait_for_any(const sigset_t *signals, PyObject *owner, int *signo)
{
    *signo = 0;
    pthread_sigmask(SIG_BLOCK, signals, NULL);
    /* Handlers of earlier signals run here; later signals stay pending. */
    int failed = PyErr_CheckSignals();
    if (!failed) {
        PyObject *pending = PyObject_GetAttr(owner, pending_name);
        failed = pending == NULL;
        if (pending == Py_False) {
            Py_BEGIN_ALLOW_THREADS
            *signo = sigwaitinfo(signals, NULL);
            Py_END_ALLOW_THREADS
        }
        Py_XDECREF(pending);
    }
    pthread_sigmask(SIG_UNBLOCK, signals, NULL);
    return failed ? -1 : 0;
}

static PyObject *
signal_gate_wait(PyObject *self, PyObject *owner)
{
    int signo;
    int failed = wait_for_any(&((SignalGate *)self)->signals, owner, &signo);
    return failed < 0 ? NULL : PyLong_FromLong(signo);
}

static PyMethodDef posix_timer_methods[] = {
    {"arm", posix_timer_arm, METH_O, "Fire at a deadline in nanoseconds on CLOCK_MONOTONIC."},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot posix_timer_slots[] = {
    {Py_tp_new, posix_timer_new},
    {Py_tp_dealloc, deallocate},
    {Py_tp_methods, posix_timer_methods},
    {0, NULL},
};

static PyType_Spec posix_timer_spec = {
    "rt_robot_os._core.PosixTimer", sizeof(PosixTimer), 0, Py_TPFLAGS_DEFAULT, posix_timer_slots,
};

static PyMethodDef signal_gate_methods[] = {
    {"mask_signals", signal_gate_mask, METH_NOARGS, "Mask the signals: they stay pending."},
    {"unmask_signals", signal_gate_unmask, METH_NOARGS, "Unmask the signals."},
    {"wait_masked", signal_gate_wait_masked, METH_NOARGS,
     "Sleep until one of the masked signals is pending, and remove it."},
    {"wait", signal_gate_wait, METH_O,
     "Mask the signals, wait unless something is pending, and unmask them."},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot signal_gate_slots[] = {
    {Py_tp_new, signal_gate_new},
    {Py_tp_dealloc, deallocate},
    {Py_tp_methods, signal_gate_methods},
    {0, NULL},
};

static PyType_Spec signal_gate_spec = {
    "rt_robot_os._core.SignalGate", sizeof(SignalGate), 0, Py_TPFLAGS_DEFAULT, signal_gate_slots,
};

int
add_timer_types(PyObject *module)
{
    pending_name = PyUnicode_InternFromString("pending");
    if (pending_name == NULL)
        return -1;
    PyObject *timer = PyType_FromSpec(&posix_timer_spec);
    PyObject *gate = PyType_FromSpec(&signal_gate_spec);
    int failed = timer == NULL || gate == NULL
            || PyModule_AddObjectRef(module, "PosixTimer", timer) < 0
            || PyModule_AddObjectRef(module, "SignalGate", gate) < 0;
    Py_XDECREF(timer);
    Py_XDECREF(gate);
    return failed ? -1 : 0;
}
