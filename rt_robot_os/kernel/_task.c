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

/* What each job uses of a task, and the black box: task_core.py and black_box.py in C. */

#include "../base/_core.h"

PyTypeObject *task_type, *black_box_type;

/* Frees an object of a heap type; its references have been released. */
void
free_object(PyObject *object)
{
    PyTypeObject *type = Py_TYPE(object);
    freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    release(object);
    Py_DECREF(type);
}

/* ---- counting ---------------------------------------------------------------------------- */

/* The arithmetic of kernel/histogram.py: eight buckets an octave. */
static int
bucket_of(ns_t duration_ns)
{
    if (duration_ns < 16)
        return duration_ns < 0 ? 0 : (int)duration_ns;
    int shift = 60 - __builtin_clzll((unsigned long long)duration_ns);
    return (shift << 3) + (int)(duration_ns >> shift);
}

int
count_job(Task *task, ns_t release_ns, ns_t previous_ns, ns_t end_ns, ns_t stolen_ns,
          PyObject *handler)
{
    ns_t start_ns = task->start_ns, execution_ns = end_ns - start_ns - stolen_ns;
    task->runs++;
    task->execution_total_ns += execution_ns;
    if (execution_ns > task->execution_limit_ns) {
        PyObject *own = PyObject_CallMethod(handler, "long_execution", "OL", task, execution_ns);
        if (own == NULL)
            return -1;
        execution_ns = PyLong_AsLongLong(own);
        Py_DECREF(own);
        if (execution_ns == -1 && PyErr_Occurred())
            return -1;
    }
    task->counts[bucket_of(execution_ns)][EXECUTION]++;
    ns_t latency_ns = start_ns - release_ns;
    task->counts[bucket_of(latency_ns)][LATENCY]++;
    if (latency_ns > task->latency_maximum_ns)
        task->latency_maximum_ns = latency_ns;
    if (end_ns - release_ns > task->response_limit_ns) {
        PyObject *done = PyObject_CallMethod(handler, "long_response", "OLL", task, release_ns,
                                             end_ns);
        if (done == NULL)
            return -1;
        Py_DECREF(done);
    }
    if (previous_ns < 0)
        return 0;
    ns_t gap_ns = start_ns - previous_ns;
    if (gap_ns > task->gap_maximum_ns)
        task->gap_maximum_ns = gap_ns;
    if (task->period_ns) {
        ns_t jitter_ns = gap_ns - task->interval_ns;
        if (jitter_ns < 0)
            jitter_ns = -jitter_ns;
        task->counts[bucket_of(jitter_ns)][JITTER]++;
        if (jitter_ns > task->jitter_maximum_ns)
            task->jitter_maximum_ns = jitter_ns;
    }
    return 0;
}

static PyObject *
task_count(PyObject *self, PyObject *args)
{
    ns_t release_ns, previous_ns, end_ns, stolen_ns;
    PyObject *handler;
    if (!PyArg_ParseTuple(args, "LLLLO", &release_ns, &previous_ns, &end_ns, &stolen_ns, &handler)
            || count_job((Task *)self, release_ns, previous_ns, end_ns, stolen_ns, handler) < 0)
        return NULL;
    Py_RETURN_NONE;
}

static PyObject *
task_counts(PyObject *self, PyObject *kind)
{
    long number = PyLong_AsLong(kind);
    if (number < 0 || number >= KINDS) {
        if (!PyErr_Occurred())
            PyErr_Format(PyExc_IndexError, "kind %ld must be from 0 to %d", number, KINDS - 1);
        return NULL;
    }
    PyObject *list = PyList_New(BUCKETS);
    for (int i = 0; list != NULL && i < BUCKETS; i++) {
        PyObject *count = PyLong_FromUnsignedLongLong(((Task *)self)->counts[i][number]);
        if (count == NULL)
            Py_CLEAR(list);
        else
            PyList_SetItem(list, i, count);
    }
    return list;
}

static PyObject *
task_clear_counts(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    Task *task = (Task *)self;
    task->releases = task->runs = task->missed = task->coalesced = task->overruns = 0;
    task->execution_total_ns = task->execution_limit_ns = task->execution_maximum_ns = 0;
    task->latency_maximum_ns = task->response_limit_ns = 0;
    task->gap_maximum_ns = task->jitter_maximum_ns = task->blocked_maximum_ns = 0;
    memset(task->counts, 0, sizeof task->counts);
    Py_RETURN_NONE;
}

/* ---- the type of tasks ------------------------------------------------------------------- */

static int
task_init(PyObject *self, PyObject *Py_UNUSED(args), PyObject *Py_UNUSED(keywords))
{
    ((Task *)self)->start_ns = -1;
    return 0;
}

static int
task_traverse(PyObject *self, visitproc visit, void *arg)
{
    Py_VISIT(Py_TYPE(self));
    Py_VISIT(((Task *)self)->name);
    Py_VISIT(((Task *)self)->function);
    return 0;
}

static int
task_clear(PyObject *self)
{
    Py_CLEAR(((Task *)self)->name);
    Py_CLEAR(((Task *)self)->function);
    return 0;
}

static void
task_dealloc(PyObject *self)
{
    PyObject_GC_UnTrack(self);
    task_clear(self);
    free_object(self);
}

static PyObject *
task_get_priority(PyObject *self, void *Py_UNUSED(closure))
{
    return PyLong_FromLong(((Task *)self)->priority);
}

/* The core has this many levels and does not check again. */
static int
task_set_priority(PyObject *self, PyObject *value, void *Py_UNUSED(closure))
{
    long priority = value == NULL ? -1 : PyLong_AsLong(value);
    if (PyErr_Occurred())
        return -1;
    if (priority < 0 || priority >= LEVELS) {
        PyErr_Format(PyExc_ValueError, "priority %R must be from 0 to %d",
                     value == NULL ? Py_None : value, LEVELS - 1);
        return -1;
    }
    ((Task *)self)->priority = (int)priority;
    return 0;
}

static PyGetSetDef task_attributes[] = {
    {"priority", task_get_priority, task_set_priority, "The higher runs first.", NULL},
    {NULL, NULL, NULL, NULL, NULL},
};

static PyMethodDef task_methods[] = {
    {"count", task_count, METH_VARARGS, "Count the job that has ended."},
    {"counts", task_counts, METH_O, "Copy a histogram of this task."},
    {"clear_counts", task_clear_counts, METH_NOARGS, "Reset the counters."},
    {NULL, NULL, 0, NULL},
};

#define FIELD(name, kind) {#name, kind, offsetof(Task, name), 0, NULL}
static PyMemberDef task_members[] = {
    FIELD(name, T_OBJECT), FIELD(function, T_OBJECT), FIELD(aborts, T_BOOL),
    FIELD(skips, T_BOOL), FIELD(pending, T_BOOL), FIELD(held, T_BOOL), FIELD(busy, T_BOOL),
    FIELD(follow_up, T_BOOL), FIELD(abort_pending, T_BOOL), FIELD(grace_used, T_BOOL),
    FIELD(containing, T_BOOL), FIELD(index, T_INT), FIELD(inside, T_INT),
    FIELD(period_ns, T_LONGLONG), FIELD(budget_ns, T_LONGLONG), FIELD(limit_ns, T_LONGLONG),
    FIELD(computed_ns, T_LONGLONG), FIELD(waited_ns, T_LONGLONG),
    FIELD(next_ns, T_LONGLONG), FIELD(next_period_ns, T_LONGLONG),
    FIELD(release_ns, T_LONGLONG), FIELD(interval_ns, T_LONGLONG), FIELD(start_ns, T_LONGLONG),
    FIELD(releases, T_LONGLONG), FIELD(runs, T_LONGLONG), FIELD(missed, T_LONGLONG),
    FIELD(coalesced, T_LONGLONG), FIELD(overruns, T_LONGLONG),
    FIELD(execution_total_ns, T_LONGLONG), FIELD(execution_limit_ns, T_LONGLONG),
    FIELD(execution_maximum_ns, T_LONGLONG), FIELD(latency_maximum_ns, T_LONGLONG),
    FIELD(response_limit_ns, T_LONGLONG), FIELD(gap_maximum_ns, T_LONGLONG),
    FIELD(jitter_maximum_ns, T_LONGLONG), FIELD(blocked_maximum_ns, T_LONGLONG),
    {NULL, 0, 0, 0, NULL},
};
#undef FIELD

static PyType_Slot task_slots[] = {
    {Py_tp_doc, "The part of a task that its kernel reads and writes with each job."},
    {Py_tp_init, task_init},
    {Py_tp_traverse, task_traverse},
    {Py_tp_clear, task_clear},
    {Py_tp_dealloc, task_dealloc},
    {Py_tp_methods, task_methods},
    {Py_tp_getset, task_attributes},
    {Py_tp_members, task_members},
    {0, NULL},
};

static PyType_Spec task_spec = {
    "rt_robot_os._core.TaskCore", sizeof(Task), 0,
    Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE | Py_TPFLAGS_HAVE_GC, task_slots,
};

/* ---- records ----------------------------------------------------------------------------- */

/* The parts after the kind in the tuple of a record: w the task, s the subject, the times a, b, c,
   o the outcome. */
static const char *const shapes[] = {
    [JOB] = "wabco", [PUBLISH] = "wasb", [INTERRUPT] = "was", [OVERRUN] = "wab",
    [ABORT] = "wab", [CEILING] = "wabs", [BLOCKED] = "wab", [MISS] = "wab", [MARK] = "was",
};

/* Returns the address of a time in a record; NULL for any other part. */
static ns_t *
time_of(Record *record, char part)
{
    return part == 'a' ? &record->a : part == 'b' ? &record->b : part == 'c' ? &record->c : NULL;
}

/* Stores a record and overwrites the oldest, whose objects are released last. */
int
store_record(BlackBox *box, const Record *record)
{
    if (box->capacity == 0)
        return 0;
    Py_ssize_t place = box->oldest + box->count;
    if (place >= box->capacity)
        place -= box->capacity;
    Record *slot = &box->ring[place];
    PyObject *task = slot->task, *subject = slot->subject;
    *slot = *record;
    Py_XINCREF(slot->task);
    Py_XINCREF(slot->subject);
    if (box->count < box->capacity)
        box->count++;
    else if (++box->oldest == box->capacity)
        box->oldest = 0;
    Py_XDECREF(task);
    Py_XDECREF(subject);
    return 0;
}

PyObject *
record_as_tuple(const Record *record)
{
    if (record->kind == OTHER) {
        Py_INCREF(record->subject);
        return record->subject;
    }
    const char *shape = shapes[record->kind];
    PyObject *tuple = PyTuple_New((Py_ssize_t)strlen(shape) + 1);
    PyObject *part = tuple == NULL ? NULL : PyLong_FromLong(record->kind);
    for (Py_ssize_t i = 0; part != NULL; i++) {
        PyTuple_SetItem(tuple, i, part);
        char code = shape[i];
        if (code == 0)
            return tuple;
        ns_t *time = time_of((Record *)record, code);
        if (time != NULL)
            part = PyLong_FromLongLong(*time);
        else if (code == 'o')
            part = PyLong_FromLong(record->outcome);
        else {
            part = code == 'w' ? record->task : record->subject;
            part = part == NULL ? Py_None : part;
            Py_INCREF(part);
        }
    }
    Py_XDECREF(tuple);
    return NULL;
}

/* Reads the tuple of a record; one of another shape is stored unmodified. */
static void
record_from_tuple(PyObject *tuple, Record *record)
{
    memset(record, 0, sizeof *record);
    long kind = PyTuple_Size(tuple) > 0 ? PyLong_AsLong(PyTuple_GetItem(tuple, 0)) : OTHER;
    if (kind >= 0 && kind < OTHER
            && PyTuple_Size(tuple) == (Py_ssize_t)strlen(shapes[kind]) + 1) {
        record->kind = (int)kind;
        for (Py_ssize_t i = 0; shapes[kind][i]; i++) {
            PyObject *part = PyTuple_GetItem(tuple, i + 1);
            ns_t *time = time_of(record, shapes[kind][i]);
            if (time != NULL)
                *time = PyLong_AsLongLong(part);
            else if (shapes[kind][i] == 'o')
                record->outcome = (int)PyLong_AsLong(part);
            else if (shapes[kind][i] == 'w')
                record->task = part;
            else
                record->subject = part;
        }
        if (!PyErr_Occurred())
            return;
    }
    PyErr_Clear();
    record->kind = OTHER;
    record->task = NULL;
    record->subject = tuple;
}

/* ---- the black box ----------------------------------------------------------------------- */

static void
black_box_empty(BlackBox *box)
{
    Record *ring = box->ring;
    Py_ssize_t capacity = box->capacity;
    box->ring = NULL;
    box->capacity = box->oldest = box->count = 0;
    for (Py_ssize_t i = 0; i < capacity; i++) {
        Py_XDECREF(ring[i].task);
        Py_XDECREF(ring[i].subject);
    }
    PyMem_Free(ring);
}

static int
black_box_init(PyObject *self, PyObject *args, PyObject *keywords)
{
    static char *names[] = {"capacity", NULL};
    Py_ssize_t capacity = 2048; /* RECORDS_DEFAULT */
    if (!PyArg_ParseTupleAndKeywords(args, keywords, "|n:BlackBox", names, &capacity))
        return -1;
    if (capacity < 0) {
        PyErr_Format(PyExc_ValueError, "capacity %zd must be 0 or more", capacity);
        return -1;
    }
    BlackBox *box = (BlackBox *)self;
    black_box_empty(box);
    box->ring = PyMem_Calloc((size_t)(capacity ? capacity : 1), sizeof(Record));
    if (box->ring == NULL) {
        PyErr_NoMemory();
        return -1;
    }
    box->capacity = capacity;
    return 0;
}

static PyObject *
black_box_add(PyObject *self, PyObject *tuple)
{
    Record record;
    if (!PyTuple_Check(tuple)) {
        PyErr_SetString(PyExc_TypeError, "a record is a tuple");
        return NULL;
    }
    record_from_tuple(tuple, &record);
    store_record((BlackBox *)self, &record);
    Py_RETURN_NONE;
}

static PyObject *
black_box_mark(PyObject *self, PyObject *args)
{
    Record record = {.kind = MARK};
    if (!PyArg_ParseTuple(args, "LO", &record.a, &record.subject))
        return NULL;
    store_record((BlackBox *)self, &record);
    Py_RETURN_NONE;
}

static Record *
record_at(BlackBox *box, Py_ssize_t index)
{
    Py_ssize_t place = box->oldest + index;
    return &box->ring[place < box->capacity ? place : place - box->capacity];
}

/*
 * Returns a tuple of the tuples of some records, from a private copy: making a tuple may start the
 * garbage collector, which may add records.
 */
static PyObject *
tuple_of(BlackBox *box, Py_ssize_t count, int newest_first)
{
    PyObject *tuple = PyTuple_New(count);
    Record *copy = PyMem_Calloc((size_t)count + 1, sizeof(Record));
    if (tuple == NULL || copy == NULL || count > box->count) {
        Py_XDECREF(tuple);
        PyMem_Free(copy);
        return PyErr_Occurred() ? NULL : PyErr_NoMemory();
    }
    for (Py_ssize_t i = 0; i < count; i++) {
        copy[i] = *record_at(box, newest_first ? box->count - 1 - i : i);
        Py_XINCREF(copy[i].task);
        Py_XINCREF(copy[i].subject);
    }
    for (Py_ssize_t i = 0; i < count; i++) {
        PyObject *record = tuple == NULL ? NULL : record_as_tuple(&copy[i]);
        if (record != NULL)
            PyTuple_SetItem(tuple, i, record);
        else
            Py_CLEAR(tuple);
        Py_XDECREF(copy[i].task);
        Py_XDECREF(copy[i].subject);
    }
    PyMem_Free(copy);
    return tuple;
}

static PyObject *
black_box_records(PyObject *self, void *Py_UNUSED(closure))
{
    return tuple_of((BlackBox *)self, ((BlackBox *)self)->count, 0);
}

static PyObject *
black_box_latest(PyObject *self, PyObject *number)
{
    Py_ssize_t count = PyLong_AsSsize_t(number), most = ((BlackBox *)self)->count;
    if (count == -1 && PyErr_Occurred())
        return NULL;
    return tuple_of((BlackBox *)self, count < 0 ? 0 : count < most ? count : most, 1);
}

static PyObject *
black_box_copy(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    BlackBox *box = (BlackBox *)self;
    PyObject *object = PyObject_CallFunction((PyObject *)black_box_type, "n", box->capacity);
    for (Py_ssize_t i = 0; object != NULL && i < box->count; i++)
        store_record((BlackBox *)object, record_at(box, i));
    return object;
}

static PyObject *
black_box_pop_oldest(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    BlackBox *box = (BlackBox *)self;
    if (box->count == 0)
        Py_RETURN_NONE;
    Record *slot = record_at(box, 0), oldest = *slot;
    slot->task = slot->subject = NULL;
    box->count--;
    if (++box->oldest == box->capacity)
        box->oldest = 0;
    PyObject *tuple = record_as_tuple(&oldest);
    Py_XDECREF(oldest.task);
    Py_XDECREF(oldest.subject);
    return tuple;
}

static Py_ssize_t
black_box_length(PyObject *self)
{
    return ((BlackBox *)self)->count;
}

static int
black_box_traverse(PyObject *self, visitproc visit, void *arg)
{
    BlackBox *box = (BlackBox *)self;
    Py_VISIT(Py_TYPE(self));
    for (Py_ssize_t i = 0; i < box->capacity; i++) {
        Py_VISIT(box->ring[i].task);
        Py_VISIT(box->ring[i].subject);
    }
    return 0;
}

static int
black_box_clear(PyObject *self)
{
    black_box_empty((BlackBox *)self);
    return 0;
}

static void
black_box_dealloc(PyObject *self)
{
    PyObject_GC_UnTrack(self);
    black_box_empty((BlackBox *)self);
    free_object(self);
}

static PyMethodDef black_box_methods[] = {
    {"add", black_box_add, METH_O, "Append a record."},
    {"mark", black_box_mark, METH_VARARGS, "Add a mark with a text."},
    {"latest", black_box_latest, METH_O, "Return a copy of the last records, newest first."},
    {"copy", black_box_copy, METH_NOARGS, "Copy the black box in one native call."},
    {"pop_oldest", black_box_pop_oldest, METH_NOARGS, "Remove the oldest record and return it."},
    {NULL, NULL, 0, NULL},
};

static PyGetSetDef black_box_attributes[] = {
    {"records", black_box_records, NULL, "A copy of all records, oldest first.", NULL},
    {NULL, NULL, NULL, NULL, NULL},
};

static PyMemberDef black_box_members[] = {
    {"capacity", T_PYSSIZET, offsetof(BlackBox, capacity), READONLY, NULL},
    {NULL, 0, 0, 0, NULL},
};

static PyType_Slot black_box_slots[] = {
    {Py_tp_doc, "A ring of records."},
    {Py_tp_init, black_box_init},
    {Py_tp_traverse, black_box_traverse},
    {Py_tp_clear, black_box_clear},
    {Py_tp_dealloc, black_box_dealloc},
    {Py_tp_methods, black_box_methods},
    {Py_tp_getset, black_box_attributes},
    {Py_tp_members, black_box_members},
    {Py_sq_length, black_box_length},
    {0, NULL},
};

static PyType_Spec black_box_spec = {
    "rt_robot_os._core.BlackBox", sizeof(BlackBox), 0,
    Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE | Py_TPFLAGS_HAVE_GC, black_box_slots,
};

int
add_task_types(PyObject *module)
{
    task_type = (PyTypeObject *)PyType_FromSpec(&task_spec);
    black_box_type = (PyTypeObject *)PyType_FromSpec(&black_box_spec);
    if (task_type == NULL || black_box_type == NULL
            || PyModule_AddObjectRef(module, "TaskCore", (PyObject *)task_type) < 0
            || PyModule_AddObjectRef(module, "BlackBox", (PyObject *)black_box_type) < 0)
        return -1;
    return 0;
}
