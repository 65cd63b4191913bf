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
 * The core of the kernel: releases.py, timer_interrupt.py and core.py in C, method by method.
 *
 * Those files are the specification and give the reasons; the comments here are about C only. Each
 * change of those files is made here as well (docs/testing_the_core.md).
 */

#include "../base/_core.h"

#define NS_PER_S 1000000000LL
#define ONE_SHOT_ORDER (1LL << 32)
#define DEFER_MAXIMUM 8
#define DEFER_NS 1000000LL
#define OFTEN_WAKES 4
#define SLACK_WAKES 4
#define YIELD_EVERY_NS 800000LL
#define YIELD_NS 60000LL
#define RECURSION_ROOM 200
#define BLOCKED_NS 50000LL
#define LATE_NS 200000LL
#define ABORT_ALWAYS_NS 1
#define REFRESH_NS 20000000LL

PyTypeObject *core_type;
static PyObject *task_aborted; /* kernel.failure.TaskAborted; that module imports this one */
static PyObject *system_clock, *thread_clock; /* time.monotonic_ns, time.thread_time_ns */
static PyObject *arm_name, *arm_spare_name, *swap_name, *poll_name, *wait_name;
static PyObject *refresh_name, *start_text, *end_text, *fail_text;

static ns_t
smaller(ns_t one, ns_t other)
{
    return one < other ? one : other;
}

static ns_t
larger(ns_t one, ns_t other)
{
    return one > other ? one : other;
}

/* ---- calls to Python --------------------------------------------------------------------- */

/* Converts the result of a call to a time and releases it; FAILED_NS when the call failed. */
static ns_t
time_from(PyObject *result)
{
    if (result == NULL)
        return FAILED_NS;
    ns_t time = PyLong_AsLongLong(result);
    Py_DECREF(result);
    return time == -1 && PyErr_Occurred() ? FAILED_NS : time;
}

/* Releases the result of a call; -1 when the call failed. */
static int
done(PyObject *result)
{
    if (result == NULL)
        return -1;
    Py_DECREF(result);
    return 0;
}

/* Calls a method of a clock with one time. */
static PyObject *
call_with_time(PyObject *object, PyObject *method, ns_t time)
{
    PyObject *argument = PyLong_FromLongLong(time);
    if (argument == NULL)
        return NULL;
    PyObject *result = PyObject_CallMethodObjArgs(object, method, argument, NULL);
    Py_DECREF(argument);
    return result;
}

static ns_t
no_clock(void)
{
    PyErr_SetString(PyExc_AttributeError, "the kernel has no clock: __init__ did not run");
    return FAILED_NS;
}

ns_t
now_ns(Core *core)
{
    if (core->reads_system_clock) {
        struct timespec time;
        clock_gettime(CLOCK_MONOTONIC, &time);
        return time.tv_sec * NS_PER_S + time.tv_nsec;
    }
    if (core->now_ns == NULL)
        return no_clock();
    return time_from(PyObject_CallNoArgs(core->now_ns));
}

/* The computing time of the thread. */
static ns_t
computed_ns(Core *core)
{
    if (core->reads_thread_clock) {
        struct timespec time;
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
        return time.tv_sec * NS_PER_S + time.tv_nsec;
    }
    return time_from(PyObject_CallMethod(core->clock, "computed_ns", NULL));
}

static int
set_timer(Core *core, int role, ns_t at_ns)
{
    if (!core->sets_timers)
        return done(call_with_time(core->clock, role ? arm_spare_name : arm_name, at_ns));
    struct itimerspec spec = {
        {core->repeat_ns / NS_PER_S, core->repeat_ns % NS_PER_S},
        {at_ns / NS_PER_S, at_ns % NS_PER_S},
    };
    if (timer_settime(core->posix_timers[role], TIMER_ABSTIME, &spec, NULL) < 0) {
        PyErr_SetFromErrno(PyExc_OSError);
        return -1;
    }
    return 0;
}

static int
swap_timers(Core *core)
{
    if (!core->sets_timers)
        return done(PyObject_CallMethodObjArgs(core->clock, swap_name, NULL));
    timer_t first = core->posix_timers[0];
    core->posix_timers[0] = core->posix_timers[1];
    core->posix_timers[1] = first;
    return 0;
}

int
add_record(Core *core, const Record *record)
{
    if (!core->observed)
        return store_record(core->black_box, record);
    PyObject *tuple = record_as_tuple(record);
    if (tuple == NULL)
        return -1;
    PyObject *result = PyObject_CallFunctionObjArgs(core->record, tuple, NULL);
    Py_DECREF(tuple);
    return done(result);
}

static int
trace(Core *core, ns_t at_ns, PyObject *kind, Task *task)
{
    if (core->trace == NULL || core->trace == Py_None)
        return 0;
    return done(PyObject_CallFunction(core->trace, "LOO", at_ns, kind, task->name));
}

static int
poll_sources(Core *core, ns_t at_ns)
{
    return done(PyObject_CallMethod((PyObject *)core, "poll_sources", "L", at_ns));
}

/* Returns the steal time of a job; FAILED_NS when the call failed. */
static ns_t
charge_blocking(Core *core, Task *task, int level, ns_t at_ns, ns_t late_ns)
{
    return time_from(PyObject_CallMethod(core->faults, "charge_blocking", "OiLL", task, level,
                                         at_ns, late_ns));
}

/* ---- timers, sorted by (due_ns, order) ---------------------------------------------------- */

static Timer *
timer_at(TimerList *list, int index)
{
    return &list->storage[list->first + index];
}

/* Returns when the timer of an index at a level is due; NEVER_NS beyond the last one. */
static ns_t
due_at(Core *core, int level, int index)
{
    TimerList *list = &core->timers[level];
    return index < list->count ? timer_at(list, index)->due_ns : NEVER_NS;
}

static int
make_room(TimerList *list)
{
    if (list->first + list->count < list->room)
        return 0;
    if (list->first > list->count) {
        memmove(list->storage, timer_at(list, 0), (size_t)list->count * sizeof(Timer));
        list->first = 0;
        return 0;
    }
    int room = list->room ? 2 * list->room : 8;
    Timer *storage = PyMem_Realloc(list->storage, (size_t)room * sizeof(Timer));
    if (storage == NULL) {
        PyErr_NoMemory();
        return -1;
    }
    list->storage = storage;
    list->room = room;
    return 0;
}

/* Inserts a timer, which gets its own reference to the target. */
static int
insert_timer(TimerList *list, Timer timer)
{
    if (make_room(list) < 0)
        return -1;
    int low = 0, high = list->count;
    /* It usually is the last: the first comparison is with the last one. */
    for (int middle = high - 1; low < high; middle = (low + high) / 2) {
        Timer *other = timer_at(list, middle);
        if (other->due_ns < timer.due_ns
                || (other->due_ns == timer.due_ns && other->order < timer.order))
            low = middle + 1;
        else
            high = middle;
    }
    if (low == 0 && list->first > 0)
        list->first--;
    else
        memmove(timer_at(list, low + 1), timer_at(list, low),
                (size_t)(list->count - low) * sizeof(Timer));
    list->count++;
    *timer_at(list, low) = timer;
    Py_INCREF(timer.target);
    return 0;
}

/* Removes the first; its reference goes to the caller. */
static Timer
pop_timer(TimerList *list)
{
    Timer timer = *timer_at(list, 0);
    list->first++;
    if (--list->count == 0)
        list->first = 0;
    return timer;
}

static void
empty_timers(TimerList *list)
{
    TimerList old = *list;
    memset(list, 0, sizeof *list);
    for (int i = 0; i < old.count; i++)
        Py_DECREF(timer_at(&old, i)->target);
    PyMem_Free(old.storage);
}

/* ---- levels: ready ones, and which falls due first ---------------------------------------- */

static int
top_level(Core *core)
{
    if (core->ready[1])
        return 127 - __builtin_clzll(core->ready[1]);
    return core->ready[0] ? 63 - __builtin_clzll(core->ready[0]) : -1;
}

static void
set_ready(Core *core, int level)
{
    core->ready[level >> 6] |= 1ULL << (level & 63);
}

static int
is_ready(Core *core, int level)
{
    return core->ready[level >> 6] >> (level & 63) & 1;
}

static First
first_due(Core *core, int index)
{
    First never = {NEVER_NS, LEVELS + index};
    return index < core->firsts_count ? core->firsts[index] : never;
}

static void
remove_first(Core *core, int index)
{
    core->firsts_count--;
    memmove(&core->firsts[index], &core->firsts[index + 1],
            (size_t)(core->firsts_count - index) * sizeof(First));
}

static void
put_first(Core *core, int level, ns_t due_ns)
{
    if (core->indexed_ns[level] < NEVER_NS)
        for (int i = 0; i < core->firsts_count; i++)
            if (core->firsts[i].level == level) {
                remove_first(core, i);
                break;
            }
    core->indexed_ns[level] = due_ns;
    if (due_ns == NEVER_NS)
        return;
    int place = core->firsts_count++;
    for (; place > 0; place--) {
        First before = core->firsts[place - 1];
        if (before.due_ns < due_ns || (before.due_ns == due_ns && before.level < level))
            break;
        core->firsts[place] = before;
    }
    core->firsts[place] = (First){due_ns, level};
}

static void
mark_first_ready(Core *core)
{
    int level = core->firsts[0].level;
    remove_first(core, 0);
    core->indexed_ns[level] = NEVER_NS;
    set_ready(core, level);
}

static void
index_timer(Core *core, int level)
{
    ns_t due_ns = due_at(core, level, 0);
    if (level <= core->level)
        set_ready(core, level);
    else if (due_ns < core->indexed_ns[level]) {
        put_first(core, level, due_ns);
        if (core->firsts[0].due_ns == due_ns)
            core->pending = 1;
    }
}

static void
clear_ready(Core *core, int level)
{
    ns_t due_ns = due_at(core, level, 0);
    core->ready[level >> 6] &= ~(1ULL << (level & 63));
    if (due_ns < core->indexed_ns[level])
        put_first(core, level, due_ns);
}

static int
collect_due(Core *core, ns_t at_ns)
{
    while (core->firsts_count && core->firsts[0].due_ns <= at_ns)
        mark_first_ready(core);
    return core->interrupted ? poll_sources(core, at_ns) : 0;
}

static void
defer(Core *core, int level, ns_t at_ns)
{
    for (int i = 0; i < DEFER_MAXIMUM && core->firsts_count; i++) {
        if (core->firsts[0].level > level || core->firsts[0].due_ns > at_ns + DEFER_NS)
            break;
        mark_first_ready(core);
    }
}

/* ---- releases ---------------------------------------------------------------------------- */

static void
append_to_queue(Core *core, Task *task)
{
    Queue *queue = &core->queues[task->priority];
    Py_INCREF((PyObject *)task);
    task->next_task = NULL;
    if (queue->last == NULL)
        queue->first = task;
    else
        queue->last->next_task = task;
    queue->last = task;
    set_ready(core, task->priority);
}

/* Removes the first of a queue; its reference goes to the caller. */
static Task *
pop_queue(Queue *queue)
{
    Task *task = queue->first;
    queue->first = task->next_task;
    if (queue->first == NULL)
        queue->last = NULL;
    task->next_task = NULL;
    return task;
}

static void
enqueue(Core *core, Task *task, ns_t release_ns, ns_t period_ns)
{
    task->pending = 1;
    task->release_ns = release_ns;
    task->interval_ns = period_ns;
    append_to_queue(core, task);
}

static void
arrive(Core *core, Task *task, ns_t release_ns)
{
    task->releases++;
    if (!task->pending) {
        task->pending = 1;
        task->release_ns = release_ns;
        append_to_queue(core, task);
    } else if (task->held)
        task->missed++;
    else
        task->coalesced++;
}

static void
release_periodic(Core *core, Task *task, ns_t due_ns, ns_t period_ns)
{
    if (task->pending || task->busy) {
        task->next_ns = due_ns;
        task->next_period_ns = period_ns;
        return;
    }
    task->releases++;
    task->next_ns = due_ns + task->period_ns;
    task->next_period_ns = task->period_ns;
    enqueue(core, task, due_ns, period_ns);
}

/* Serves a timer that was popped. */
static int
serve(Core *core, Timer timer, ns_t at_ns)
{
    int status = 0;
    if (timer.period_ns)
        release_periodic(core, (Task *)timer.target, timer.due_ns, timer.period_ns);
    else
        status = done(PyObject_CallFunction(timer.target, "L", at_ns));
    Py_DECREF(timer.target);
    return status;
}

/* Returns whether anything was due; -1 with an exception. */
static int
release_due(Core *core, int level, ns_t at_ns)
{
    int found = 0;
    while (!core->stopping && due_at(core, level, 0) <= at_ns) {
        if (serve(core, pop_timer(&core->timers[level]), at_ns) < 0)
            return -1;
        found = 1;
    }
    return found;
}

static int
add_timer(Core *core, Task *task, ns_t due_ns, ns_t period_ns)
{
    Timer timer = {due_ns, task->index, period_ns, (PyObject *)task};
    if (insert_timer(&core->timers[task->priority], timer) < 0)
        return -1;
    index_timer(core, task->priority);
    return 0;
}

static int
pull_timer(Core *core, Task *task, ns_t at_ns)
{
    at_ns = smaller(at_ns, core->end_ns - 1);
    while (!task->next_ns && due_at(core, task->priority, 0) <= at_ns)
        if (serve(core, pop_timer(&core->timers[task->priority]), at_ns) < 0)
            return -1;
    return 0;
}

static int
return_timer(Core *core, Task *task, ns_t at_ns)
{
    ns_t due_ns = task->next_ns, period_ns = task->next_period_ns;
    ns_t until_ns = smaller(at_ns, core->end_ns - 1);
    task->next_ns = 0;
    if (due_ns <= until_ns) {
        if (task->skips && !task->held) {
            ns_t unserved = (until_ns - due_ns) / task->period_ns + 1;
            task->releases += unserved;
            task->overruns += unserved;
            task->missed += unserved;
            Record record = {.kind = OVERRUN, .task = (PyObject *)task, .a = due_ns,
                             .b = unserved};
            if (add_record(core, &record) < 0)
                return -1;
            due_ns += unserved * task->period_ns;
        } else {
            due_ns = time_from(PyObject_CallMethod((PyObject *)core, "account_missed_releases",
                                                   "OLL", task, due_ns, at_ns));
            if (due_ns == FAILED_NS)
                return -1;
        }
        period_ns = task->period_ns;
    }
    if (!due_ns)
        return 0;
    Timer timer = {due_ns, task->index, period_ns, (PyObject *)task};
    if (insert_timer(&core->timers[task->priority], timer) < 0)
        return -1;
    if (!is_ready(core, task->priority))
        index_timer(core, task->priority);
    return 0;
}

static int
wake_one(Core *core, PyObject *object, ns_t at_ns)
{
    if (!PyObject_TypeCheck(object, task_type)) {
        PyErr_Format(PyExc_TypeError, "%R is not a task of this kernel", object);
        return -1;
    }
    Task *task = (Task *)object;
    if (!task->pending) {
        if (release_due(core, task->priority, smaller(at_ns, core->end_ns - 1)) < 0)
            return -1;
        if (task->priority > core->level)
            core->pending = 1;
    }
    arrive(core, task, at_ns);
    return 0;
}

int
wake(Core *core, PyObject *tasks, ns_t at_ns)
{
    if (!core->running)
        return 0;
    if (PyList_Check(tasks)) {
        for (Py_ssize_t i = 0; i < PyList_Size(tasks); i++) {
            PyObject *task = PyList_GetItem(tasks, i);
            Py_INCREF((PyObject *)task);
            int status = wake_one(core, task, at_ns);
            Py_DECREF((PyObject *)task);
            if (status < 0)
                return -1;
        }
        return 0;
    }
    PyObject *tuple = PySequence_Tuple(tasks);
    int status = tuple == NULL ? -1 : 0;
    for (Py_ssize_t i = 0; status == 0 && i < PyTuple_Size(tuple); i++)
        status = wake_one(core, PyTuple_GetItem(tuple, i), at_ns);
    Py_XDECREF(tuple);
    return status;
}

/* ---- the times that the timers are set to ------------------------------------------------- */

static int
arm(Core *core, ns_t interrupt_ns)
{
    if (interrupt_ns == core->armed_ns)
        return 0;
    if (interrupt_ns == core->spare_ns) {
        if (swap_timers(core) < 0)
            return -1;
        core->spare_ns = 0;
    } else if (set_timer(core, 0, interrupt_ns) < 0)
        return -1;
    core->armed_ns = interrupt_ns;
    return 0;
}

static int
drop_spare(Core *core)
{
    if (core->spare_ns >= NEVER_NS)
        return 0;
    core->spare_ns = NEVER_NS;
    return set_timer(core, 1, NEVER_NS);
}

static ns_t
early_ns(Core *core, int level)
{
    First first = first_due(core, 0);
    if (first.level > level && first.level < LEVELS && core->timers[first.level].count
            && timer_at(&core->timers[first.level], 0)->period_ns)
        return first.due_ns - core->spin_ns;
    return first.due_ns;
}

static ns_t
lenient_ns(Core *core, ns_t due_ns)
{
    if (due_ns <= core->armed_due_ns && core->armed_due_ns <= due_ns + core->slack_ns)
        return core->armed_ns;
    if (due_ns == core->spare_ns)
        return due_ns;
    ns_t wake_ns = core->near_ns, often_ns = OFTEN_WAKES * wake_ns, time_ns = now_ns(core);
    if (time_ns == FAILED_NS)
        return FAILED_NS;
    if (time_ns + 2 * often_ns < core->armed_ns && core->armed_ns <= due_ns)
        return core->armed_ns;
    if (due_ns - time_ns > often_ns || time_ns - core->set_ns > often_ns + core->slack_ns)
        core->slack_ns = 0;
    else if (core->slack_ns < SLACK_WAKES * wake_ns)
        core->slack_ns += wake_ns;
    core->set_ns = time_ns;
    if (!core->slack_ns)
        return due_ns;
    return drop_spare(core) < 0 ? FAILED_NS : due_ns + core->slack_ns;
}

static ns_t
second_ns(Core *core, int level, ns_t due_ns)
{
    First first = first_due(core, 0);
    if (first.level >= LEVELS)
        return NEVER_NS;
    TimerList *timers = &core->timers[first.level];
    ns_t period_ns = timers->count ? timer_at(timers, 0)->period_ns : 0;
    ns_t found_ns = period_ns ? due_ns + period_ns : NEVER_NS;
    for (int i = 1; i <= 2; i++) {
        First other = first_due(core, i);
        if (due_ns < other.due_ns && other.due_ns < found_ns && other.level > level)
            found_ns = other.due_ns;
    }
    for (int i = 1; i <= 2; i++) {
        ns_t other_ns = due_at(core, first.level, i);
        if (due_ns < other_ns && other_ns < found_ns)
            found_ns = other_ns;
    }
    return found_ns;
}

static int
arm_ahead(Core *core, int level, ns_t check_ns)
{
    ns_t due_ns = core->stopping ? NEVER_NS : first_due(core, 0).due_ns;
    ns_t interrupt_ns = due_ns, spare_ns;
    if (core->near_ns && level && due_ns < NEVER_NS) {
        interrupt_ns = lenient_ns(core, due_ns);
        if (interrupt_ns == FAILED_NS)
            return -1;
    } else if (core->spin_ns && !core->stopping)
        interrupt_ns = early_ns(core, level);
    if (check_ns < interrupt_ns) {
        interrupt_ns = check_ns;
        spare_ns = due_ns - core->spin_ns;
    } else if (interrupt_ns > due_ns)
        spare_ns = NEVER_NS;
    else if (interrupt_ns < due_ns && core->near_ns) {
        core->armed_due_ns = 0;
        return 0;
    } else
        spare_ns = second_ns(core, level, due_ns) - core->spin_ns;
    core->armed_due_ns = interrupt_ns >= due_ns ? interrupt_ns : 0;
    if (arm(core, interrupt_ns) < 0)
        return -1;
    if (spare_ns == core->spare_ns)
        return 0;
    core->spare_ns = spare_ns;
    return set_timer(core, 1, spare_ns);
}

static int
arm_for(Core *core, Task *task, int level, ns_t due_ns)
{
    ns_t interrupt_ns = due_ns;
    if (core->near_ns)
        interrupt_ns = lenient_ns(core, due_ns);
    else if (core->spin_ns && due_ns == first_due(core, 0).due_ns)
        interrupt_ns = early_ns(core, level);
    if (interrupt_ns == FAILED_NS)
        return -1;
    if (task->aborts) {
        ns_t time_ns = now_ns(core);
        if (time_ns == FAILED_NS)
            return -1;
        task->limit_ns = task->budget_ns;
        task->computed_ns = computed_ns(core);
        task->waited_ns = 0;
        if (task->computed_ns == FAILED_NS)
            return -1;
        interrupt_ns = smaller(interrupt_ns, time_ns + task->budget_ns);
    }
    if (arm(core, interrupt_ns) < 0)
        return -1;
    core->armed_due_ns = interrupt_ns >= due_ns ? interrupt_ns : 0;
    return 0;
}

/* Polls the clock; between two readings handlers of signals run. */
static ns_t
poll_clock(Core *core, ns_t until_ns, ns_t time_ns)
{
    ns_t begin_ns = time_ns;
    while (time_ns < until_ns && !core->pending && !core->stopping) {
        if (!core->sets_timers)
            time_ns = time_from(call_with_time(core->clock, poll_name, until_ns));
        else
            time_ns = PyErr_CheckSignals() < 0 ? FAILED_NS : now_ns(core);
        if (time_ns == FAILED_NS)
            return FAILED_NS;
    }
    core->polled_ns += time_ns - begin_ns;
    return time_ns;
}

static ns_t
spin(Core *core, ns_t time_ns, int level)
{
    ns_t due_ns = first_due(core, 0).due_ns;
    if (time_ns < due_ns && early_ns(core, level) <= time_ns)
        while (time_ns != FAILED_NS && time_ns < due_ns)
            time_ns = now_ns(core);
    return time_ns;
}

/* Returns when the interrupt comes, 0 when it polled, or FAILED_NS. */
static ns_t
arm_or_poll(Core *core, ns_t time_ns, ns_t idled_ns)
{
    ns_t due_ns = first_due(core, 0).due_ns;
    if (due_ns - time_ns > core->near_ns || due_ns == core->armed_ns
            || due_ns == core->spare_ns) {
        core->slack_ns = 0;
        return arm_ahead(core, IDLE_LEVEL, NEVER_NS) < 0 ? FAILED_NS : due_ns;
    }
    if (time_ns - idled_ns <= YIELD_EVERY_NS || core->end_ns - time_ns <= 2 * YIELD_NS)
        return poll_clock(core, due_ns, time_ns) == FAILED_NS ? FAILED_NS : 0;
    if (arm(core, time_ns + YIELD_NS) < 0)
        return FAILED_NS;
    core->armed_due_ns = 0;
    return drop_spare(core) < 0 ? FAILED_NS : time_ns + YIELD_NS;
}

/* ---- dispatch ---------------------------------------------------------------------------- */

/* Sets the next task to run, with a reference for the caller, or NULL: call it again. */
static int
next_job(Core *core, int level, ns_t time_ns, Task **task)
{
    *task = NULL;
    if (due_at(core, level, 0) <= time_ns) {
        if (release_due(core, level, time_ns) < 0)
            return -1;
        return core->interrupted ? poll_sources(core, time_ns) : 0;
    }
    if (core->queues[level].first == NULL) {
        clear_ready(core, level);
        return 0;
    }
    *task = pop_queue(&core->queues[level]);
    (*task)->pending = 0;
    return 0;
}

static int
begin_job(Core *core, Task *task, int level, ns_t time_ns, ns_t end_ns, ns_t *previous_ns)
{
    Task *before = core->current;
    task->busy = 1;
    core->current = task;
    Py_INCREF((PyObject *)task);
    Py_XDECREF((PyObject *)before);
    core->level = level;
    ns_t next_ns = first_due(core, 0).due_ns, soon_ns = time_ns + core->near_ns;
    ns_t level_ns = due_at(core, level, 0);
    if (soon_ns < level_ns && level_ns < next_ns)
        next_ns = level_ns;
    if (soon_ns < task->next_ns && task->next_ns < next_ns)
        next_ns = task->next_ns;
    if (task->aborts || next_ns > core->armed_due_ns
            || core->armed_due_ns > next_ns + core->slack_ns)
        if (arm_for(core, task, level, next_ns) < 0)
            return -1;
    ns_t start_ns = now_ns(core);
    if (start_ns == FAILED_NS)
        return -1;
    core->overhead_ns += start_ns - end_ns;
    *previous_ns = task->start_ns;
    task->start_ns = start_ns;
    core->stolen_ns = 0;
    return trace(core, start_ns, start_text, task);
}

static PyObject *
attribute_of(const char *module_name, const char *name)
{
    PyObject *module = PyImport_ImportModule(module_name);
    PyObject *found = module == NULL ? NULL : PyObject_GetAttrString(module, name);
    Py_XDECREF(module);
    return found;
}

/* Clears the current exception and returns it. */
static PyObject *
raised_exception(void)
{
    PyObject *type, *value, *traceback;
    PyErr_Fetch(&type, &value, &traceback);
    PyErr_NormalizeException(&type, &value, &traceback);
    if (traceback != NULL)
        PyException_SetTraceback(value, traceback);
    Py_XDECREF(type);
    Py_XDECREF(traceback);
    return value;
}

/* Describes the exception of a job and releases it: both may run user code and are preemptible. */
static int
contain(Core *core, Task *task, PyObject **failure)
{
    PyObject *error = raised_exception();
    if (task_aborted == NULL)
        task_aborted = attribute_of("rt_robot_os.kernel.failure", "TaskAborted");
    if (task_aborted == NULL) {
        Py_DECREF(error);
        return -1;
    }
    int outcome = PyErr_GivenExceptionMatches((PyObject *)Py_TYPE(error), task_aborted)
        ? ABORTED : FAILED;
    task->limit_ns = 0;
    core->locked = 0;
    *failure = PyObject_CallMethod((PyObject *)core, "contain", "OO", task, error);
    if (*failure == NULL) {
        PyErr_Clear();
        core->locked = 1;
        *failure = PyObject_CallMethod((PyObject *)core, "minimal_report", "O", task);
        core->locked = 0;
    }
    Py_DECREF(error);
    core->locked = 1;
    return *failure == NULL ? -1 : outcome;
}

/* Runs the job. Returns its outcome; -1 when the kernel itself failed. */
static int
call(Core *core, Task *task, PyObject **failure)
{
    PyObject *function = task->function == NULL ? Py_None : task->function, *result = NULL;
    Py_INCREF(function);
    *failure = NULL;
    core->locked = 0;
    if (!core->pending || settle(core, 0) == 0)
        result = PyObject_CallNoArgs(function);
    Py_XDECREF(result);
    core->locked = 1;
    int outcome = result != NULL ? OK : contain(core, task, failure);
    Py_DECREF(function);
    return outcome;
}

static int
end_job(Core *core, Task *task, ns_t release_ns, ns_t previous_ns, ns_t end_ns, int outcome,
        PyObject *failure)
{
    Record record = {.kind = JOB, .outcome = outcome, .task = (PyObject *)task, .a = release_ns,
                     .b = task->start_ns, .c = end_ns};
    if (add_record(core, &record) < 0
            || count_job(task, release_ns, previous_ns, end_ns, core->stolen_ns, core->faults) < 0
            || trace(core, end_ns, outcome == OK ? end_text : fail_text, task) < 0)
        return -1;
    if (task->period_ns && !task->next_ns && pull_timer(core, task, end_ns) < 0)
        return -1;
    if (task->next_ns && return_timer(core, task, end_ns) < 0)
        return -1;
    task->busy = 0;
    if (failure == NULL && !task->follow_up && !task->inside)
        return 0;
    return done(PyObject_CallMethod(core->faults, "after_job", "OOiL", task,
                                    failure == NULL ? Py_None : failure, outcome, end_ns));
}

/* Collects what fell due while a job ran; returns the time. */
static ns_t
collect_after(Core *core, Task *task, int level)
{
    core->pending = 0;
    ns_t time_ns = now_ns(core);
    if (time_ns == FAILED_NS)
        return FAILED_NS;
    ns_t late_ns = time_ns - larger(core->armed_ns, task->start_ns);
    if (collect_due(core, time_ns) < 0)
        return FAILED_NS;
    if (late_ns > BLOCKED_NS && charge_blocking(core, task, level, time_ns, late_ns) == FAILED_NS)
        return FAILED_NS;
    return time_ns;
}

static int
run_job(Core *core, Task *task, int level, ns_t *time_ns, ns_t *end_ns)
{
    ns_t release_ns = task->release_ns, previous_ns;
    PyObject *failure = NULL;
    if (begin_job(core, task, level, *time_ns, *end_ns, &previous_ns) < 0)
        return -1;
    int outcome = call(core, task, &failure);
    int status = outcome < 0 ? -1 : 0;
    *end_ns = *time_ns = now_ns(core);
    if (status == 0)
        status = *end_ns == FAILED_NS ? -1 : end_job(core, task, release_ns, previous_ns,
                                                     *end_ns, outcome, failure);
    Py_XDECREF(failure);
    if (status < 0)
        return -1;
    /* Handlers of signals run here, between two jobs, as they do in the Python form. */
    if (PyErr_CheckSignals() < 0)
        return -1;
    if (core->pending || first_due(core, 0).due_ns <= *end_ns)
        *time_ns = collect_after(core, task, level);
    return *time_ns == FAILED_NS ? -1 : 0;
}

static void
clear_current(Core *core, int level)
{
    Task *before = core->current;
    core->current = NULL;
    core->level = level;
    Py_XDECREF((PyObject *)before);
}

/* Runs every ready task above a level. `end_ns`: the end of the last work that was not the
   kernel's own; updated on return. */
static int
dispatch(Core *core, int floor, ns_t time_ns, ns_t *end_ns)
{
    while (!core->stopping) {
        int level = top_level(core);
        if (level <= floor)
            break;
        Task *task;
        if (next_job(core, level, time_ns, &task) < 0)
            return -1;
        if (task == NULL)
            continue;
        int status = run_job(core, task, level, &time_ns, end_ns);
        Py_DECREF((PyObject *)task);
        if (status < 0)
            return -1;
    }
    clear_current(core, floor);
    return 0;
}

/* ---- interrupts -------------------------------------------------------------------------- */

static int
serve_soon(Core *core, int level, ns_t *end_ns)
{
    ns_t left_ns = core->near_ns;
    while (!core->stopping) {
        First first = first_due(core, 0);
        ns_t time_ns = now_ns(core);
        if (time_ns == FAILED_NS)
            return -1;
        if (first.level <= level || first.due_ns - time_ns > left_ns)
            break;
        if (time_ns < first.due_ns) {
            if (first.due_ns == core->armed_ns || first.due_ns == core->spare_ns)
                break;
            core->overhead_ns += time_ns - *end_ns;
            *end_ns = poll_clock(core, first.due_ns, time_ns);
            if (*end_ns == FAILED_NS)
                return -1;
            left_ns -= *end_ns - time_ns;
        }
        core->pending = 0;
        time_ns = now_ns(core);
        if (time_ns == FAILED_NS || collect_due(core, time_ns) < 0)
            return -1;
        if (top_level(core) > level && dispatch(core, level, time_ns, end_ns) < 0)
            return -1;
    }
    return 0;
}

/* Sets the timer after an interrupt; checks the budget of the job. */
static int
arm_after(Core *core, Task *current, int level, ns_t entry_ns, ns_t stolen_ns)
{
    ns_t due_ns = first_due(core, 0).due_ns;
    if (current == NULL || (!current->limit_ns && !core->stopping)) {
        if (core->spare_ns && due_ns <= core->armed_due_ns
                && core->armed_due_ns <= due_ns + core->slack_ns)
            return 0;
        return arm_ahead(core, level, NEVER_NS);
    }
    ns_t used_ns = entry_ns - current->start_ns - stolen_ns - current->waited_ns, check_ns;
    if (used_ns < current->limit_ns && !core->stopping) {
        ns_t left_ns = current->limit_ns - used_ns;
        check_ns = now_ns(core);
        if (check_ns != FAILED_NS)
            check_ns += current->waited_ns ? larger(left_ns, LATE_NS) : left_ns;
    } else
        check_ns = time_from(PyObject_CallMethod((PyObject *)core, "check_budget", "OL", current,
                                                 used_ns));
    return check_ns == FAILED_NS ? -1 : arm_ahead(core, level, check_ns);
}

/* Returns the steal time of a job with a limit, if it did not compute all the time. */
static ns_t
steal_time_of(Core *core, Task *task, ns_t entry_ns, ns_t stolen_ns, ns_t thread_ns)
{
    ns_t gap_ns = entry_ns - task->start_ns - stolen_ns - task->waited_ns
        - (thread_ns - task->computed_ns);
    if (gap_ns <= LATE_NS)
        return 0;
    return time_from(PyObject_CallMethod(core->faults, "attribute_gap", "OLL", task, entry_ns,
                                         gap_ns));
}

static int
serve_interrupt(Core *core, Task *current, int level)
{
    ns_t stolen_ns = core->stolen_ns, entry_ns, time_ns, late_ns = 0, taken_ns, thread_ns = 0;
    int limited = current != NULL && current->limit_ns > ABORT_ALWAYS_NS;
    core->pending = 0;
    entry_ns = time_ns = now_ns(core);
    if (limited)
        thread_ns = computed_ns(core);
    if (entry_ns == FAILED_NS || thread_ns == FAILED_NS)
        return -1;
    if (current != NULL && !core->stopping)
        late_ns = entry_ns - larger(core->armed_ns, current->start_ns);
    if (core->spin_ns)
        time_ns = spin(core, time_ns, level);
    if (time_ns == FAILED_NS || collect_due(core, time_ns) < 0)
        return -1;
    if (current != NULL && (late_ns > current->blocked_maximum_ns || late_ns > BLOCKED_NS)) {
        taken_ns = charge_blocking(core, current, level, entry_ns, late_ns);
        if (taken_ns == FAILED_NS)
            return -1;
        stolen_ns += taken_ns;
    }
    if (limited) {
        taken_ns = steal_time_of(core, current, entry_ns, stolen_ns, thread_ns);
        if (taken_ns == FAILED_NS)
            return -1;
        stolen_ns += taken_ns;
    }
    ns_t done_ns = entry_ns;
    if (top_level(core) > level && dispatch(core, level, time_ns, &done_ns) < 0)
        return -1;
    if (core->near_ns && first_due(core, 0).due_ns - done_ns <= core->near_ns
            && serve_soon(core, level, &done_ns) < 0)
        return -1;
    if (first_due(core, 0).level <= level)
        defer(core, level, time_ns);
    if (arm_after(core, current, level, entry_ns, stolen_ns) < 0)
        return -1;
    if (limited) {
        ns_t after_ns = computed_ns(core);
        if (after_ns == FAILED_NS)
            return -1;
        current->computed_ns += after_ns - thread_ns;
    }
    ns_t end_ns = now_ns(core);
    if (end_ns == FAILED_NS)
        return -1;
    core->overhead_ns += end_ns - done_ns;
    core->stolen_ns = stolen_ns + end_ns - entry_ns;
    return 0;
}

static void
set_current(Core *core, Task *current, int level)
{
    Task *before = core->current;
    Py_XINCREF((PyObject *)current);
    core->current = current;
    core->level = level;
    Py_XDECREF((PyObject *)before);
}

/* Serves interrupts until none is pending. An error of the kernel ends the kernel, not the job. */
static int
serve_interrupts(Core *core, Task *current, int level)
{
    do {
        int status = serve_interrupt(core, current, level);
        set_current(core, current, level);
        if (status == 0)
            continue;
        if (PyErr_ExceptionMatches(PyExc_RecursionError)
                || !PyErr_ExceptionMatches(PyExc_Exception))
            return -1;
        PyObject *error = raised_exception();
        PyObject *first = PyObject_CallMethod((PyObject *)core, "fail", "O", error);
        Py_DECREF(error);
        if (first == NULL)
            return -1;
        int ends = first == Py_False;
        Py_DECREF(first);
        if (ends)
            break;
    } while (core->pending);
    return 0;
}

/* Raises TaskAborted in the interrupted task; `made` is the result of make_abort. */
static int
raise_abort(PyObject *made)
{
    PyObject *abort, *steps, *step;
    if (!PyArg_ParseTuple(made, "OO", &abort, &steps))
        return -1;
    PyObject *iterator = PyObject_GetIter(steps);
    while (iterator != NULL && (step = PyIter_Next(iterator)) != NULL)
        Py_DECREF(step);
    Py_XDECREF(iterator);
    PyErr_Clear(); /* the same exception, or the stack had no room */
    PyErr_SetObject((PyObject *)Py_TYPE(abort), abort);
    return -1;
}

int
settle(Core *core, int signalled)
{
    int limit = core->recursion_limit;
    if (core->locked || !core->running) {
        core->pending = core->locked;
        if (signalled && limit)
            Py_SetRecursionLimit(limit);
        return 0;
    }
    Task *current = core->current;
    int level = core->level, status = 0;
    PyObject *made = NULL;
    Py_XINCREF((PyObject *)current);
    core->locked = 1;
    core->recursion_limit = limit + RECURSION_ROOM;
    Py_SetRecursionLimit(limit + RECURSION_ROOM);
#if PY_VERSION_HEX < 0x030C0000
    if (signalled && current != NULL)
        status = done(PyObject_CallMethod((PyObject *)core, "check_depth", "Oi", current, limit));
#endif
    if (status == 0)
        status = serve_interrupts(core, current, level);
    if (status == 0 && current != NULL && current->abort_pending && !current->inside) {
        made = PyObject_CallMethod((PyObject *)core, "make_abort", "O", current);
        status = made == NULL ? -1 : 0;
    }
    Py_XDECREF((PyObject *)current);
    core->recursion_limit = limit;
    Py_SetRecursionLimit(limit);
    core->locked = 0;
    if (made != NULL) {
        raise_abort(made);
        Py_DECREF(made);
        return -1;
    }
    return status == 0 && core->pending ? settle(core, 0) : status;
}

/* ---- waiting ----------------------------------------------------------------------------- */

/* Waits as MonotonicClock.wait does, or calls the clock. Returns whether something other than the
   timer may have ended the wait; -1 with an exception. */
static int
wait_for_signal(Core *core)
{
    PyObject *came;
    if (core->sets_timers) {
        int signo;
        if (wait_for_any(&core->signals, (PyObject *)core, &signo) < 0)
            return -1;
        if (signo == 0 || signo == core->tick_signal)
            return 0;
        came = PyObject_CallMethod(core->clock, "serve_signal", "i", signo);
    } else
        came = PyObject_CallMethodObjArgs(core->clock, wait_name, (PyObject *)core, NULL);
    int other = came == NULL ? -1 : PyObject_IsTrue(came);
    Py_XDECREF(came);
    return other;
}

/* Calls on_idle, then waits for the interrupt or another signal. */
static int
idle(Core *core, ns_t time_ns, ns_t interrupt_ns)
{
    if (core->on_idle != NULL && core->on_idle != Py_None) {
        if (done(PyObject_CallMethod((PyObject *)core, "idle", "L", interrupt_ns - time_ns)) < 0)
            return -1;
        if (core->stopping)
            return 0;
    }
    if (time_ns - core->refreshed_ns > REFRESH_NS) {
        core->refreshed_ns = time_ns;
        if (done(call_with_time(core->steal_time, refresh_name, time_ns)) < 0)
            return -1;
    }
    int other = wait_for_signal(core);
    if (other < 0)
        return -1;
    if (other)
        core->interrupted = 1;
    core->wakeups++;
    return 0;
}

static PyObject *
core_loop(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    Core *core = (Core *)self;
    ns_t end_ns = 0, idled_ns = 0;
    for (;;) {
        core->locked = 1;
        core->pending = 0;
        if (core->stopping)
            Py_RETURN_NONE;
        ns_t time_ns = now_ns(core);
        if (time_ns == FAILED_NS)
            return NULL;
        end_ns = end_ns ? end_ns : time_ns;
        ns_t late_ns = time_ns - core->armed_ns;
        if (late_ns > LATE_NS && core->armed_ns && top_level(core) < 0
                && done(PyObject_CallMethod(core->steal_time, "attribute", "LL", time_ns,
                                            late_ns)) < 0)
            return NULL;
        if (core->spin_ns)
            time_ns = spin(core, time_ns, IDLE_LEVEL);
        if (time_ns == FAILED_NS || collect_due(core, time_ns) < 0)
            return NULL;
        if (top_level(core) >= 0) {
            if (dispatch(core, IDLE_LEVEL, time_ns, &end_ns) < 0)
                return NULL;
            continue;
        }
        ns_t interrupt_ns = arm_or_poll(core, time_ns, idled_ns);
        if (interrupt_ns == FAILED_NS)
            return NULL;
        ns_t waits_ns = interrupt_ns ? now_ns(core) : time_ns;
        if (waits_ns == FAILED_NS)
            return NULL;
        core->overhead_ns += waits_ns - end_ns;
        end_ns = 0;
        if (interrupt_ns) {
            idled_ns = time_ns;
            if (idle(core, time_ns, interrupt_ns) < 0)
                return NULL;
        }
    }
}

/* ---- methods ----------------------------------------------------------------------------- */

static int
is_level(long level)
{
    if (level >= 0 && level < LEVELS)
        return 1;
    PyErr_Format(PyExc_IndexError, "level %ld must be from 0 to %d", level, LEVELS - 1);
    return 0;
}

/* Converts an argument to a task. */
static int
to_task(PyObject *object, void *address)
{
    if (!PyObject_TypeCheck(object, task_type)) {
        PyErr_Format(PyExc_TypeError, "%R must be a task", object);
        return 0;
    }
    *(Task **)address = (Task *)object;
    return 1;
}

static PyObject *
none_unless(int failed)
{
    if (failed < 0)
        return NULL;
    Py_RETURN_NONE;
}

static PyObject *
core_settle(PyObject *self, PyObject *args)
{
    int signum = 0;
    PyObject *frame = NULL;
    if (!PyArg_ParseTuple(args, "|iO:settle", &signum, &frame))
        return NULL;
    return none_unless(settle((Core *)self, signum != 0));
}

static PyObject *
core_lock(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    int before = ((Core *)self)->locked;
    ((Core *)self)->locked = 1;
    return PyBool_FromLong(before);
}

static PyObject *
core_unlock(PyObject *self, PyObject *before)
{
    Core *core = (Core *)self;
    core->locked = before == Py_True;
    if (before == Py_True || !(core->pending || top_level(core) > core->level))
        Py_RETURN_NONE;
    return none_unless(settle(core, 0));
}

static PyObject *
core_ready_above(PyObject *self, PyObject *level)
{
    long number = PyLong_AsLong(level);
    if (number == -1 && PyErr_Occurred())
        return NULL;
    return PyBool_FromLong(top_level((Core *)self) > number);
}

static void
clear_queues(Core *core)
{
    for (int level = 0; level < LEVELS; level++)
        while (core->queues[level].first != NULL) {
            Task *task = pop_queue(&core->queues[level]);
            Py_DECREF((PyObject *)task);
        }
}

static PyObject *
core_clear_timers(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    Core *core = (Core *)self;
    core->ready[0] = core->ready[1] = 0;
    core->firsts_count = 0;
    for (int level = 0; level < LEVELS; level++)
        core->indexed_ns[level] = NEVER_NS;
    for (int level = 0; level < LEVELS; level++)
        empty_timers(&core->timers[level]);
    Py_RETURN_NONE;
}

static PyObject *
core_add_timer(PyObject *self, PyObject *args)
{
    Task *task;
    ns_t due_ns, period_ns;
    if (!PyArg_ParseTuple(args, "O&LL", to_task, &task, &due_ns, &period_ns))
        return NULL;
    return none_unless(add_timer((Core *)self, task, due_ns, period_ns));
}

static PyObject *
core_schedule(PyObject *self, PyObject *args)
{
    Core *core = (Core *)self;
    Timer timer = {0, 0, 0, NULL};
    int level;
    if (!PyArg_ParseTuple(args, "LOi", &timer.due_ns, &timer.target, &level) || !is_level(level))
        return NULL;
    timer.order = ONE_SHOT_ORDER + ++core->one_shots;
    if (insert_timer(&core->timers[level], timer) < 0)
        return NULL;
    index_timer(core, level);
    return PyLong_FromLongLong(timer.order);
}

static PyObject *
core_cancel(PyObject *self, PyObject *args)
{
    ns_t order;
    int level;
    if (!PyArg_ParseTuple(args, "Li", &order, &level) || !is_level(level))
        return NULL;
    TimerList *list = &((Core *)self)->timers[level];
    for (int i = 0; i < list->count; i++)
        if (timer_at(list, i)->order == order) {
            PyObject *target = timer_at(list, i)->target;
            list->count--;
            memmove(timer_at(list, i), timer_at(list, i + 1),
                    (size_t)(list->count - i) * sizeof(Timer));
            Py_DECREF(target);
            break;
        }
    Py_RETURN_NONE;
}

static PyObject *
core_release_due(PyObject *self, PyObject *args)
{
    int level;
    ns_t at_ns;
    if (!PyArg_ParseTuple(args, "iL", &level, &at_ns) || !is_level(level))
        return NULL;
    int found = release_due((Core *)self, level, at_ns);
    return found < 0 ? NULL : PyBool_FromLong(found);
}

static PyObject *
core_release_unserved(PyObject *self, PyObject *args)
{
    Core *core = (Core *)self;
    ns_t at_ns;
    if (!PyArg_ParseTuple(args, "L", &at_ns))
        return NULL;
    for (int level = 0; level < LEVELS; level++)
        for (int i = 0; i < core->timers[level].count; i++) {
            Timer timer = *timer_at(&core->timers[level], i);
            if (timer.due_ns <= at_ns && timer.period_ns)
                release_periodic(core, (Task *)timer.target, timer.due_ns, timer.period_ns);
        }
    Py_RETURN_NONE;
}

static PyObject *
core_return_timer(PyObject *self, PyObject *args)
{
    Task *task;
    ns_t at_ns;
    if (!PyArg_ParseTuple(args, "O&L", to_task, &task, &at_ns))
        return NULL;
    return none_unless(return_timer((Core *)self, task, at_ns));
}

static PyObject *
core_wake(PyObject *self, PyObject *args)
{
    PyObject *tasks;
    ns_t at_ns;
    if (!PyArg_ParseTuple(args, "OL", &tasks, &at_ns))
        return NULL;
    return none_unless(wake((Core *)self, tasks, at_ns));
}

static PyObject *
core_arrive(PyObject *self, PyObject *args)
{
    Task *task;
    ns_t release_ns;
    if (!PyArg_ParseTuple(args, "O&L", to_task, &task, &release_ns))
        return NULL;
    arrive((Core *)self, task, release_ns);
    Py_RETURN_NONE;
}

static PyObject *
core_enqueue(PyObject *self, PyObject *args)
{
    Task *task;
    ns_t release_ns, period_ns;
    if (!PyArg_ParseTuple(args, "O&LL", to_task, &task, &release_ns, &period_ns))
        return NULL;
    enqueue((Core *)self, task, release_ns, period_ns);
    Py_RETURN_NONE;
}

static PyObject *
core_withdraw(PyObject *self, PyObject *object)
{
    Task *task, *before = NULL;
    if (!to_task(object, &task))
        return NULL;
    Queue *queue = &((Core *)self)->queues[task->priority];
    for (Task *each = queue->first; each != NULL; before = each, each = each->next_task)
        if (each == task) {
            if (before == NULL)
                queue->first = task->next_task;
            else
                before->next_task = task->next_task;
            if (queue->last == task)
                queue->last = before;
            task->next_task = NULL;
            task->missed++;
            Py_DECREF((PyObject *)task); /* the argument holds another reference */
            break;
        }
    task->pending = 0;
    Py_RETURN_NONE;
}

static PyObject *
core_release(PyObject *self, PyObject *task)
{
    Core *core = (Core *)self;
    char locked = core->locked;
    core->locked = 1;
    ns_t time_ns = now_ns(core);
    int status = time_ns == FAILED_NS ? -1 : core->running ? wake_one(core, task, time_ns) : 0;
    core->locked = locked;
    if (status == 0 && core->pending && !locked)
        status = settle(core, 0);
    return none_unless(status);
}

static PyObject *
core_begin_timers(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    Core *core = (Core *)self;
    if (core->clock == NULL) {
        no_clock();
        return NULL;
    }
    core->armed_ns = core->armed_due_ns = core->spare_ns = core->slack_ns = core->set_ns = 0;
    core->sets_timers = 0;
    PyObject *wake_ns = PyObject_GetAttrString(core->clock, "wake_ns");
    ns_t near_ns = time_from(wake_ns);
    PyObject *timers = PyObject_GetAttrString(core->clock, "posix_timers");
    if (near_ns == FAILED_NS || timers == NULL) {
        Py_XDECREF(timers);
        return NULL;
    }
    core->near_ns = core->spin_ns ? 0 : near_ns;
    int status = 0;
    if (timers != Py_None) {
        ns_t first, second;
        unsigned long long mask;
        status = PyArg_ParseTuple(timers, "LLLKi", &first, &second, &core->repeat_ns, &mask,
                                  &core->tick_signal) ? 0 : -1;
        if (status == 0) {
            sigemptyset(&core->signals);
            for (int signo = 1; signo <= 64; signo++)
                if (mask >> (signo - 1) & 1)
                    sigaddset(&core->signals, signo);
            core->posix_timers[0] = (timer_t)(intptr_t)first;
            core->posix_timers[1] = (timer_t)(intptr_t)second;
            core->sets_timers = 1;
        }
    }
    Py_DECREF(timers);
    return none_unless(status);
}

static PyObject *
core_interrupt_by(PyObject *self, PyObject *args)
{
    Core *core = (Core *)self;
    ns_t at_ns;
    if (!PyArg_ParseTuple(args, "L", &at_ns))
        return NULL;
    ns_t time_ns = now_ns(core);
    if (time_ns == FAILED_NS)
        return NULL;
    if (time_ns < core->armed_ns && core->armed_ns <= at_ns)
        Py_RETURN_NONE;
    if (arm(core, at_ns) < 0)
        return NULL;
    core->armed_due_ns = 0;
    Py_RETURN_NONE;
}

static PyObject *
core_poll(PyObject *self, PyObject *args)
{
    ns_t until_ns, time_ns;
    if (!PyArg_ParseTuple(args, "LL", &until_ns, &time_ns))
        return NULL;
    time_ns = poll_clock((Core *)self, until_ns, time_ns);
    return time_ns == FAILED_NS ? NULL : PyLong_FromLongLong(time_ns);
}

static PyMethodDef core_methods[] = {
    {"settle", core_settle, METH_VARARGS, "Run what is above the interrupted task, on top of it."},
    {"lock", core_lock, METH_NOARGS, "Enter a critical section."},
    {"unlock", core_unlock, METH_O, "Leave a critical section and settle what is pending."},
    {"ready_above", core_ready_above, METH_O, "Return whether something is ready above a level."},
    {"clear_timers", core_clear_timers, METH_NOARGS, "Remove all timers."},
    {"add_timer", core_add_timer, METH_VARARGS, "Release a periodic task at a time."},
    {"schedule", core_schedule, METH_VARARGS, "Call something once at a time."},
    {"cancel", core_cancel, METH_VARARGS, "Undo schedule, unless it was called already."},
    {"release_due", core_release_due, METH_VARARGS, "Release what is due at a level."},
    {"release_unserved", core_release_unserved, METH_VARARGS, "Count releases at the end."},
    {"return_timer", core_return_timer, METH_VARARGS, "Put the timer of a task back."},
    {"wake", core_wake, METH_VARARGS, "Record that an event released tasks."},
    {"arrive", core_arrive, METH_VARARGS, "Record an event for a task."},
    {"enqueue", core_enqueue, METH_VARARGS, "Queue a job of a periodic task."},
    {"withdraw", core_withdraw, METH_O, "Drop the waiting job of a task."},
    {"release", core_release, METH_O, "Release a task now."},
    {"begin_timers", core_begin_timers, METH_NOARGS, "Reset the timers' state."},
    {"_interrupt_by", core_interrupt_by, METH_VARARGS, "Bring the interrupt forward to a time."},
    {"_poll", core_poll, METH_VARARGS, "Poll the clock until a release."},
    {"loop", core_loop, METH_NOARGS, "Run what is due, and wait, until the kernel stops."},
    {NULL, NULL, 0, NULL},
};

/* ---- the type ---------------------------------------------------------------------------- */

static PyObject *
core_get_current(PyObject *self, void *Py_UNUSED(closure))
{
    Task *current = ((Core *)self)->current;
    PyObject *object = current == NULL ? Py_None : (PyObject *)current;
    Py_INCREF(object);
    return object;
}

static int
core_set_current(PyObject *self, PyObject *value, void *Py_UNUSED(closure))
{
    Task *task = NULL;
    value = value == NULL ? Py_None : value; /* deleted */
    if (value != Py_None && !to_task(value, &task))
        return -1;
    set_current((Core *)self, task, ((Core *)self)->level);
    return 0;
}

static PyGetSetDef core_attributes[] = {
    {"current", core_get_current, core_set_current, "The task whose job runs.", NULL},
    {NULL, NULL, NULL, NULL, NULL},
};

#define FIELD(name, kind) {#name, kind, offsetof(Core, name), 0, NULL}
static PyMemberDef core_members[] = {
    FIELD(clock, T_OBJECT), FIELD(now_ns, T_OBJECT), FIELD(record, T_OBJECT),
    FIELD(trace, T_OBJECT), FIELD(on_idle, T_OBJECT), FIELD(faults, T_OBJECT),
    FIELD(steal_time, T_OBJECT), FIELD(locked, T_BOOL), FIELD(pending, T_BOOL),
    FIELD(interrupted, T_BOOL), FIELD(running, T_BOOL), FIELD(stopping, T_BOOL),
    FIELD(observed, T_BOOL), FIELD(level, T_INT), FIELD(recursion_limit, T_INT),
    FIELD(stolen_ns, T_LONGLONG), FIELD(end_ns, T_LONGLONG), FIELD(spin_ns, T_LONGLONG),
    FIELD(polled_ns, T_LONGLONG), FIELD(overhead_ns, T_LONGLONG), FIELD(wakeups, T_LONGLONG),
    {"black_box", T_OBJECT, offsetof(Core, black_box), READONLY, NULL},
    {NULL, 0, 0, 0, NULL},
};
#undef FIELD

static int
core_traverse(PyObject *self, visitproc visit, void *arg)
{
    Core *core = (Core *)self;
    Py_VISIT(Py_TYPE(self));
    Py_VISIT(core->clock);
    Py_VISIT(core->now_ns);
    Py_VISIT(core->record);
    Py_VISIT(core->trace);
    Py_VISIT(core->on_idle);
    Py_VISIT(core->faults);
    Py_VISIT(core->steal_time);
    Py_VISIT((PyObject *)core->black_box);
    Py_VISIT((PyObject *)core->current);
    for (int level = 0; level < LEVELS; level++) {
        for (int i = 0; i < core->timers[level].count; i++)
            Py_VISIT(timer_at(&core->timers[level], i)->target);
        for (Task *task = core->queues[level].first; task != NULL; task = task->next_task)
            Py_VISIT((PyObject *)task);
    }
    return 0;
}

static int
core_clear(PyObject *self)
{
    Core *core = (Core *)self;
    core_clear_timers(self, NULL);
    clear_queues(core);
    Py_CLEAR(core->clock);
    Py_CLEAR(core->now_ns);
    Py_CLEAR(core->record);
    Py_CLEAR(core->trace);
    Py_CLEAR(core->on_idle);
    Py_CLEAR(core->faults);
    Py_CLEAR(core->steal_time);
    Py_CLEAR(core->black_box);
    Py_CLEAR(core->current);
    return 0;
}

static void
core_dealloc(PyObject *self)
{
    PyObject_GC_UnTrack(self);
    core_clear(self);
    free_object(self);
}

static int
core_init(PyObject *self, PyObject *args, PyObject *keywords)
{
    static char *names[] = {"clock", "black_box", "spin_ns", NULL};
    Core *core = (Core *)self;
    PyObject *clock, *box;
    ns_t spin_ns = 0;
    if (!PyArg_ParseTupleAndKeywords(args, keywords, "OO!|L:KernelCore", names, &clock, black_box_type,
                                     &box, &spin_ns))
        return -1;
    core_clear(self);
    core->clock = clock;
    Py_INCREF(clock);
    core->black_box = (BlackBox *)box;
    Py_INCREF(box);
    core->now_ns = PyObject_GetAttrString(clock, "now_ns");
    core->record = PyObject_GetAttrString(box, "add");
    core->reads_system_clock = core->now_ns == system_clock;
    PyObject *computed = PyObject_GetAttrString(clock, "computed_ns");
    core->reads_thread_clock = computed == thread_clock;
    if (done(computed) < 0)
        return -1;
    core->end_ns = NEVER_NS;
    core->spin_ns = spin_ns;
    PyObject *begun = core->now_ns == NULL || core->record == NULL
        ? NULL : core_begin_timers(self, NULL);
    return done(begun);
}

static PyType_Slot core_slots[] = {
    {Py_tp_doc, "Dispatch: what runs with every job."},
    {Py_tp_init, core_init},
    {Py_tp_traverse, core_traverse},
    {Py_tp_clear, core_clear},
    {Py_tp_dealloc, core_dealloc},
    {Py_tp_methods, core_methods},
    {Py_tp_getset, core_attributes},
    {Py_tp_members, core_members},
    {0, NULL},
};

static PyType_Spec core_spec = {
    "rt_robot_os._core.KernelCore", sizeof(Core), 0,
    Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE | Py_TPFLAGS_HAVE_GC, core_slots,
};

int
add_core_types(PyObject *module)
{
    struct {
        PyObject **place;
        const char *text;
    } names[] = {
        {&arm_name, "arm"}, {&arm_spare_name, "arm_spare"}, {&swap_name, "swap"},
        {&poll_name, "poll"}, {&wait_name, "wait"}, {&refresh_name, "refresh"},
        {&start_text, "start"}, {&end_text, "end"}, {&fail_text, "fail"},
    };
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if ((*names[i].place = PyUnicode_InternFromString(names[i].text)) == NULL)
            return -1;
    system_clock = attribute_of("time", "monotonic_ns");
    thread_clock = attribute_of("time", "thread_time_ns");
    if (system_clock == NULL || thread_clock == NULL || add_task_types(module) < 0)
        return -1;
    core_type = (PyTypeObject *)PyType_FromSpec(&core_spec);
    if (core_type == NULL)
        return -1;
    return PyModule_AddObjectRef(module, "KernelCore", (PyObject *)core_type);
}
