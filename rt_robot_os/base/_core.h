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
 * Shared by the files of the extension: the structs of a task, of the black box and of the core.
 *
 * Each is the base of a Python class, and each attribute has the name, and the meaning, that it
 * has in the Python class of the same name: task_core.py, black_box.py, releases.py,
 * timer_interrupt.py and core.py. Times are in nanoseconds.
 *
 * Conventions. A function that returns an int returns 0, or -1 with an exception set; one that
 * returns a time returns FAILED_NS in that case. Handlers of signals run in Python code only, so
 * nothing here needs protection against them. But no list is in an intermediate state when Python
 * code is called, or when an object is released that may belong to the user.
 */

#ifndef RT_ROBOT_OS_CORE_H
#define RT_ROBOT_OS_CORE_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <signal.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <structmember.h>
#include <time.h>

#define NEVER_NS (1LL << 61)
#define FAILED_NS INT64_MIN
#define LEVELS 103 /* priorities 1 to 99, idle, and three above: kernel/releases.py */
#define IDLE_LEVEL 0
#define BUCKETS 488

enum { LATENCY, EXECUTION, JITTER, KINDS };
enum { JOB, PUBLISH, INTERRUPT, OVERRUN, ABORT, CEILING, BLOCKED, MISS, MARK, OTHER };
enum { OK, FAILED, ABORTED };

typedef long long ns_t; /* as T_LONGLONG */

typedef struct Task {
    PyObject_HEAD
    PyObject *name, *function;
    struct Task *next_task; /* the next one in the queue of its level */
    char aborts, skips, pending, held, busy, follow_up, abort_pending, grace_used, containing;
    int priority, index, inside;
    ns_t period_ns, budget_ns, limit_ns, computed_ns, waited_ns;
    ns_t next_ns, next_period_ns, release_ns, interval_ns, start_ns;
    ns_t releases, runs, missed, coalesced, overruns;
    ns_t execution_total_ns, execution_limit_ns, execution_maximum_ns;
    ns_t latency_maximum_ns, response_limit_ns, gap_maximum_ns, jitter_maximum_ns;
    ns_t blocked_maximum_ns;
    uint64_t counts[BUCKETS][KINDS]; /* in this order a job usually touches one page */
} Task;

typedef struct {
    int kind, outcome;
    PyObject *task, *subject; /* a task or None; a topic, source or resource, or a string */
    ns_t a, b, c;
} Record;

typedef struct {
    PyObject_HEAD
    Record *ring;
    Py_ssize_t capacity, oldest, count;
} BlackBox;

typedef struct {
    ns_t due_ns, order, period_ns;
    PyObject *target; /* a task; without a period an action */
} Timer;

typedef struct {
    Timer *storage;
    int first, count, room;
} TimerList;

typedef struct {
    Task *first, *last;
} Queue;

typedef struct {
    ns_t due_ns;
    int level;
} First;

typedef struct {
    PyObject_HEAD
    PyObject *clock, *now_ns, *record, *trace, *on_idle, *faults, *steal_time;
    BlackBox *black_box;
    Task *current;
    char locked, pending, interrupted, running, stopping, observed;
    char reads_system_clock, reads_thread_clock, sets_timers;
    int level, recursion_limit, firsts_count;
    uint64_t ready[2];
    ns_t stolen_ns, end_ns, spin_ns, polled_ns, overhead_ns, wakeups, refreshed_ns, one_shots;
    ns_t armed_ns, armed_due_ns, spare_ns, near_ns, slack_ns, set_ns, repeat_ns;
    timer_t posix_timers[2];
    sigset_t signals; /* those that end a wait */
    int tick_signal;
    First firsts[LEVELS];
    ns_t indexed_ns[LEVELS];
    Queue queues[LEVELS];
    TimerList timers[LEVELS];
} Core;

/* _task.c */
extern PyTypeObject *task_type, *black_box_type;
int count_job(Task *task, ns_t release_ns, ns_t previous_ns, ns_t end_ns, ns_t stolen_ns,
              PyObject *handler);
int store_record(BlackBox *box, const Record *record);
PyObject *record_as_tuple(const Record *record);
void free_object(PyObject *object);
int add_task_types(PyObject *module);

/* _core.c */
extern PyTypeObject *core_type;
ns_t now_ns(Core *core);
int wake(Core *core, PyObject *tasks, ns_t at_ns);
int settle(Core *core, int signalled);
int add_record(Core *core, const Record *record);
int add_core_types(PyObject *module);

/* topics/_ring.c and linux/_timer.c */
int wait_for_any(const sigset_t *signals, PyObject *owner, int *signo);
int add_ring_types(PyObject *module);
int add_timer_types(PyObject *module);

#endif
