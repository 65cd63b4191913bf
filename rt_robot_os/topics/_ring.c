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
 * The ring of a topic, its publisher and its subscription: topics/ring.py in C, which explains it.
 *
 * Memory order. Writers and readers are tasks of one kernel, so of one thread. One preempts
 * another only where Python runs, never between two statements here. So head is a plain number,
 * and a copy in C cannot be lapped. If another CPU read the ring, a writer would have to store head with
 * release order after the message, its stamp and its length. A reader would have to load head with
 * acquire order, copy, load head again after an acquire fence, and discard what was overwritten
 * meanwhile. x86-64 does that with plain moves, arm64 does not.
 */

#include "../base/_core.h"

#include <string.h>

typedef struct {
    PyObject_HEAD
    Core *kernel; /* NULL until __init__ has succeeded */
    PyObject *name, *layout, *slots, *wakes, *triggers;
    Py_buffer storage;
    ns_t *stamps;
    Py_ssize_t *lengths;
    ns_t head, mask;
    Py_ssize_t slot_bytes, stride;
    Py_ssize_t size, count_offset, count_maximum, tail_start, item_bytes; /* Layout.length_rule */
    char has_tail, large;
} Topic;

typedef struct {
    PyObject_HEAD
    Topic *topic;
    Py_buffer buffer;
} End;

typedef struct {
    End end;
    ns_t published;
} Publisher;

typedef struct {
    End end;
    ns_t stamp_ns, seq, next_seq, lost, skipped, reads;
    Py_ssize_t length;
    char fresh;
} Subscription;

static PyTypeObject *topic_type, *publisher_type, *subscription_type;

/* ---- the ring ------------------------------------------------------------------------------ */

static int
topic_clear(PyObject *self)
{
    Topic *topic = (Topic *)self;
    Py_CLEAR(topic->kernel); /* first: the rest is not used without a kernel */
    Py_CLEAR(topic->name);
    Py_CLEAR(topic->layout);
    Py_CLEAR(topic->slots);
    Py_CLEAR(topic->wakes);
    Py_CLEAR(topic->triggers);
    PyBuffer_Release(&topic->storage);
    return 0;
}

static int
topic_traverse(PyObject *self, visitproc visit, void *arg)
{
    Topic *topic = (Topic *)self;
    Py_VISIT(Py_TYPE(self));
    Py_VISIT(topic->kernel);
    Py_VISIT(topic->name);
    Py_VISIT(topic->layout);
    Py_VISIT(topic->slots);
    Py_VISIT(topic->wakes);
    Py_VISIT(topic->triggers);
    Py_VISIT(topic->storage.obj);
    return 0;
}

static void
topic_dealloc(PyObject *self)
{
    PyObject_GC_UnTrack(self);
    topic_clear(self);
    PyMem_Free(((Topic *)self)->stamps);
    PyMem_Free(((Topic *)self)->lengths);
    free_object(self);
}

/* Reads the sizes of messages from the layout. */
static int
read_layout(Topic *topic)
{
    PyObject *rule = PyObject_GetAttrString(topic->layout, "length_rule");
    int read = rule != NULL
        && PyArg_ParseTuple(rule, "nnnnnn;Layout.length_rule", &topic->size, &topic->slot_bytes,
                            &topic->count_offset, &topic->count_maximum, &topic->tail_start,
                            &topic->item_bytes);
    Py_XDECREF(rule);
    if (read && (topic->size < 0 || topic->slot_bytes < topic->size
                 || topic->slot_bytes > INT32_MAX)) {
        PyErr_Format(PyExc_ValueError, "topic %R: messages of %zd to %zd bytes", topic->name,
                     topic->size, topic->slot_bytes);
        return -1;
    }
    return read ? 0 : -1;
}

static int
make_ring(Topic *topic, PyObject *storage)
{
    Py_ssize_t depth = PyList_Size(topic->slots);
    if (depth < 1 || depth & (depth - 1)) {
        PyErr_Format(PyExc_ValueError, "topic %R: %zd slots, but the depth must be a power of two",
                     topic->name, depth);
        return -1;
    }
    if (PyObject_GetBuffer(storage, &topic->storage, PyBUF_WRITABLE) < 0)
        return -1;
    topic->stride = topic->slot_bytes + (-topic->slot_bytes & 7);
    topic->large = topic->storage.len == 0;
    topic->has_tail = topic->large || topic->slot_bytes != topic->size;
    if (!topic->large && topic->storage.len / depth < topic->stride) {
        PyErr_Format(PyExc_ValueError, "topic %R: a storage of %zd bytes for %zd slots of %zd",
                     topic->name, topic->storage.len, depth, topic->stride);
        return -1;
    }
    topic->mask = depth - 1;
    topic->stamps = PyMem_Calloc((size_t)depth, sizeof *topic->stamps);
    topic->lengths = PyMem_Calloc((size_t)depth, sizeof *topic->lengths);
    topic->wakes = PyList_New(0);
    topic->triggers = PyList_New(0);
    if (topic->stamps == NULL || topic->lengths == NULL) {
        PyErr_NoMemory();
        return -1;
    }
    for (Py_ssize_t i = 0; i < depth; i++)
        topic->lengths[i] = topic->size;
    return topic->wakes == NULL || topic->triggers == NULL ? -1 : 0;
}

static int
topic_init(PyObject *self, PyObject *args, PyObject *Py_UNUSED(keywords))
{
    Topic *topic = (Topic *)self;
    PyObject *kernel, *name, *layout, *slots, *storage;
    if (!PyArg_ParseTuple(args, "O!UOO!O:TopicCore", core_type, &kernel, &name, &layout,
                          &PyList_Type, &slots, &storage))
        return -1;
    if (topic->name != NULL) {
        PyErr_Format(PyExc_TypeError, "topic %R was made before", topic->name);
        return -1;
    }
    Py_INCREF(name);
    Py_INCREF(layout);
    Py_INCREF(slots);
    topic->name = name;
    topic->layout = layout;
    topic->slots = slots;
    if (read_layout(topic) < 0 || make_ring(topic, storage) < 0)
        return -1;
    Py_INCREF(kernel);
    topic->kernel = (Core *)kernel;
    return 0;
}

static int
is_made(Topic *topic)
{
    if (topic != NULL && topic->kernel != NULL)
        return 1;
    PyErr_SetString(PyExc_AttributeError, "this topic, or this end of one, has not been made: "
                    "its __init__ has not run");
    return 0;
}

static PyObject *
topic_stamp_of(PyObject *self, PyObject *number)
{
    Topic *topic = (Topic *)self;
    ns_t sample = PyLong_AsLongLong(number);
    return PyErr_Occurred() || !is_made(topic) ? NULL
        : PyLong_FromLongLong(topic->stamps[sample & topic->mask]);
}

static PyObject *
topic_length_of(PyObject *self, PyObject *number)
{
    Topic *topic = (Topic *)self;
    ns_t sample = PyLong_AsLongLong(number);
    return PyErr_Occurred() || !is_made(topic) ? NULL
        : PyLong_FromSsize_t(topic->lengths[sample & topic->mask]);
}

/* ---- common to publisher and subscription -------------------------------------------------- */

static int
end_clear(PyObject *self)
{
    End *end = (End *)self;
    Py_CLEAR(end->topic);
    PyBuffer_Release(&end->buffer);
    return 0;
}

static int
end_traverse(PyObject *self, visitproc visit, void *arg)
{
    Py_VISIT(Py_TYPE(self));
    Py_VISIT(((End *)self)->topic);
    Py_VISIT(((End *)self)->buffer.obj);
    return 0;
}

static void
end_dealloc(PyObject *self)
{
    PyObject_GC_UnTrack(self);
    end_clear(self);
    free_object(self);
}

static PyObject *
end_buffer(PyObject *self, void *Py_UNUSED(closure))
{
    PyObject *buffer = ((End *)self)->buffer.obj;
    buffer = buffer == NULL ? Py_None : buffer;
    Py_INCREF(buffer);
    return buffer;
}

static int
end_set_buffer(PyObject *self, PyObject *value, void *Py_UNUSED(closure))
{
    Py_buffer view, before;
    if (value == NULL) {
        PyErr_SetString(PyExc_AttributeError, "buffer cannot be deleted");
        return -1;
    }
    if (PyObject_GetBuffer(value, &view, PyBUF_SIMPLE) < 0)
        return -1;
    before = ((End *)self)->buffer;
    ((End *)self)->buffer = view;
    PyBuffer_Release(&before);
    return 0;
}

static int
end_connect(PyObject *self, PyObject *topic, PyObject *buffer)
{
    End *end = (End *)self;
    if (!is_made((Topic *)topic))
        return -1;
    if (end->topic != NULL) {
        PyErr_Format(PyExc_TypeError, "this end of topic %R was made before", end->topic->name);
        return -1;
    }
    if (end_set_buffer(self, buffer, NULL) < 0)
        return -1;
    Py_INCREF(topic);
    end->topic = (Topic *)topic;
    return 0;
}

/* Returns the topic of an end; NULL with an exception when it has none, or no longer one. */
static Topic *
topic_of(PyObject *self)
{
    Topic *topic = ((End *)self)->topic;
    return is_made(topic) ? topic : NULL;
}

/* ---- the publisher ------------------------------------------------------------------------- */

static int
publisher_init(PyObject *self, PyObject *args, PyObject *Py_UNUSED(keywords))
{
    PyObject *topic, *buffer;
    if (!PyArg_ParseTuple(args, "O!O:PublisherCore", topic_type, &topic, &buffer))
        return -1;
    return end_connect(self, topic, buffer);
}

/* Copies a message into the slot after the newest sample. */
static int
write_slot(Topic *topic, const Py_buffer *data, Py_ssize_t length)
{
    if (topic->has_tail ? length < 0 || length > data->len || length > topic->slot_bytes
            : data->len != topic->slot_bytes) {
        PyErr_Format(PyExc_ValueError, "topic %R: %zd of %zd bytes for a slot of %s%zd",
                     topic->name, length, data->len, topic->has_tail ? "at most " : "",
                     topic->slot_bytes);
        return -1;
    }
    Py_ssize_t index = (Py_ssize_t)(topic->head & topic->mask);
    if (!topic->large) {
        memmove((char *)topic->storage.buf + index * topic->stride, data->buf, (size_t)length);
        return 0;
    }
    PyObject *slot = PyList_GetItem(topic->slots, index);
    Py_buffer target;
    if (slot == NULL || PyObject_GetBuffer(slot, &target, PyBUF_WRITABLE) < 0)
        return -1;
    memmove(target.buf, data->buf, (size_t)(length < target.len ? length : target.len));
    PyBuffer_Release(&target);
    return 0;
}

/* Makes the message in that slot the newest sample and releases its tasks; locked. */
static int
commit(Publisher *self, Topic *topic, Py_ssize_t length, ns_t stamp_ns, ns_t at_ns)
{
    Core *core = topic->kernel;
    Record record = {.kind = PUBLISH, .task = (PyObject *)core->current, .subject = topic->name,
                     .a = at_ns, .b = topic->head};
    Py_ssize_t index = (Py_ssize_t)(topic->head & topic->mask);
    topic->stamps[index] = stamp_ns ? stamp_ns : at_ns;
    topic->lengths[index] = length;
    topic->head++;
    self->published++;
    if (add_record(core, &record) < 0
            || (PyList_Size(topic->wakes) && wake(core, topic->wakes, at_ns) < 0))
        return -1;
    if (PyList_Size(topic->triggers) == 0)
        return 0;
    PyObject *done = PyObject_CallMethod((PyObject *)topic, "release_triggered", "L", at_ns);
    Py_XDECREF(done);
    return done == NULL ? -1 : 0;
}

static PyObject *
put(Publisher *self, Topic *topic, const Py_buffer *data, Py_ssize_t length, ns_t stamp_ns)
{
    Core *core = topic->kernel;
    ns_t at_ns = now_ns(core);
    if (at_ns == FAILED_NS)
        return NULL;
    core->locked = 1;
    int status = write_slot(topic, data, length);
    if (status == 0)
        status = commit(self, topic, length, stamp_ns, at_ns);
    core->locked = 0;
    if (status < 0 || (core->pending && settle(core, 0) < 0))
        return NULL;
    Py_RETURN_NONE;
}

/* Finds the length of the message in the buffer of a publisher, by the count of its tail. */
static int
find_length(Topic *topic, const Py_buffer *data, Py_ssize_t *length)
{
    uint32_t count;
    *length = topic->size;
    if (!topic->has_tail || topic->count_maximum < 0)
        return 0;
    if (topic->count_offset + (Py_ssize_t)sizeof count <= data->len) {
        memcpy(&count, (const char *)data->buf + topic->count_offset, sizeof count);
        if (count <= topic->count_maximum) {
            if (count)
                *length = topic->tail_start + (Py_ssize_t)count * topic->item_bytes;
            return 0;
        }
    }
    PyObject *found = PyObject_CallMethod(topic->layout, "length", "O", data->obj); /* raises */
    *length = found == NULL ? -1 : PyLong_AsSsize_t(found);
    Py_XDECREF(found);
    return PyErr_Occurred() ? -1 : 0;
}

/* publish(stamp_ns=0); the fast calling convention needs no tuple of arguments */
static PyObject *
publisher_publish(PyObject *self, PyObject *const *args, Py_ssize_t count, PyObject *names)
{
    Topic *topic = topic_of(self);
    Py_buffer *data = &((Publisher *)self)->end.buffer;
    Py_ssize_t named = names == NULL ? 0 : PyTuple_Size(names);
    ns_t stamp_ns = 0;
    if (topic == NULL)
        return NULL;
    if (count + named > 1 || (named && PyUnicode_CompareWithASCIIString(
            PyTuple_GetItem(names, 0), "stamp_ns") != 0)) {
        PyErr_Format(PyExc_TypeError, "topic %R: publish takes stamp_ns and nothing else",
                     topic->name);
        return NULL;
    }
    if (count + named && (stamp_ns = PyLong_AsLongLong(args[0])) == -1 && PyErr_Occurred())
        return NULL;
    Py_ssize_t length;
    if (find_length(topic, data, &length) < 0)
        return NULL;
    return put((Publisher *)self, topic, data, length, stamp_ns);
}

static PyObject *
publisher_send(PyObject *self, PyObject *args)
{
    Topic *topic = topic_of(self);
    Py_buffer data;
    ns_t stamp_ns = 0;
    if (topic == NULL || !PyArg_ParseTuple(args, "y*|L:send", &data, &stamp_ns))
        return NULL;
    PyObject *result = put((Publisher *)self, topic, &data, data.len, stamp_ns);
    PyBuffer_Release(&data);
    return result;
}

static PyObject *
publisher_commit(PyObject *self, PyObject *args)
{
    Topic *topic = topic_of(self);
    Py_ssize_t length;
    ns_t stamp_ns, at_ns;
    if (topic == NULL || !PyArg_ParseTuple(args, "nLL:commit", &length, &stamp_ns, &at_ns))
        return NULL;
    if (length < 0 || length > topic->slot_bytes) {
        PyErr_Format(PyExc_ValueError, "topic %R: %zd bytes in a slot of %zd", topic->name,
                     length, topic->slot_bytes);
        return NULL;
    }
    if (commit((Publisher *)self, topic, length, stamp_ns, at_ns) < 0)
        return NULL;
    Py_RETURN_NONE;
}

/* ---- the subscription ---------------------------------------------------------------------- */

static int
subscription_init(PyObject *self, PyObject *args, PyObject *Py_UNUSED(keywords))
{
    Subscription *reader = (Subscription *)self;
    PyObject *topic, *buffer;
    if (!PyArg_ParseTuple(args, "O!OL:SubscriptionCore", topic_type, &topic, &buffer,
                          &reader->next_seq)
            || end_connect(self, topic, buffer) < 0)
        return -1;
    reader->seq = -1;
    reader->length = reader->end.topic->size;
    return 0;
}

/* Copies a sample out of its slot. */
static int
read_slot(Subscription *self, Topic *topic, Py_ssize_t index)
{
    if (topic->large) { /* in chunks: other tasks may run, and publish, in between */
        PyObject *done = PyObject_CallMethod((PyObject *)self, "copy_large", "n", index);
        Py_XDECREF(done);
        return done == NULL ? -1 : 0;
    }
    Py_ssize_t length = topic->has_tail ? topic->lengths[index] : topic->slot_bytes;
    Py_buffer *target = &self->end.buffer;
    if (target->readonly) {
        PyErr_Format(PyExc_TypeError, "topic %R: the buffer of a subscription must be writable",
                     topic->name);
        return -1;
    }
    if (topic->has_tail ? length > target->len : length != target->len) {
        PyErr_Format(PyExc_ValueError, "topic %R: a sample of %zd bytes for a buffer of %zd",
                     topic->name, length, target->len);
        return -1;
    }
    memmove(target->buf, (const char *)topic->storage.buf + index * topic->stride,
            (size_t)length);
    self->length = length;
    return 0;
}

static PyObject *
take(Subscription *self, Topic *topic)
{
    ns_t depth = topic->mask + 1, wanted = self->next_seq, stamp_ns;
    do {
        if (wanted >= topic->head) {
            self->fresh = 0;
            Py_RETURN_FALSE;
        }
        if (topic->head - wanted > depth) {
            self->lost += topic->head - depth - wanted;
            self->next_seq = wanted = topic->head - depth;
        }
        Py_ssize_t index = (Py_ssize_t)(wanted & topic->mask);
        if (read_slot(self, topic, index) < 0)
            return NULL;
        stamp_ns = topic->stamps[index];
    } while (topic->head - wanted > depth); /* lapped while copying a large one */
    self->stamp_ns = stamp_ns;
    self->seq = wanted;
    self->next_seq = wanted + 1;
    self->reads++;
    self->fresh = 1;
    Py_RETURN_TRUE;
}

static PyObject *
subscription_take(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    Topic *topic = topic_of(self);
    return topic == NULL ? NULL : take((Subscription *)self, topic);
}

static PyObject *
subscription_latest(PyObject *self, PyObject *Py_UNUSED(nothing))
{
    Topic *topic = topic_of(self);
    if (topic == NULL)
        return NULL;
    Subscription *reader = (Subscription *)self;
    ns_t behind = topic->head - reader->next_seq - 1;
    if (behind > 0) {
        reader->skipped += behind;
        reader->next_seq += behind;
    }
    return take(reader, topic);
}

static PyObject *
subscription_skip(PyObject *self, PyObject *args, PyObject *keywords)
{
    static char *names[] = {"newest", NULL};
    Topic *topic = topic_of(self);
    int newest = 0;
    if (topic == NULL
            || !PyArg_ParseTupleAndKeywords(args, keywords, "|p:skip", names, &newest))
        return NULL;
    Subscription *reader = (Subscription *)self;
    ns_t behind = topic->head - reader->next_seq, depth = topic->mask + 1;
    if (behind <= 0)
        Py_RETURN_FALSE;
    if (newest)
        reader->skipped += behind - 1;
    else if (behind > depth)
        reader->lost += behind - depth;
    reader->next_seq += newest ? behind : behind > depth ? behind - depth + 1 : 1;
    Py_RETURN_TRUE;
}

static PyObject *
subscription_unread(PyObject *self, void *Py_UNUSED(closure))
{
    Topic *topic = topic_of(self);
    if (topic == NULL)
        return NULL;
    ns_t behind = topic->head - ((Subscription *)self)->next_seq, depth = topic->mask + 1;
    return PyLong_FromLongLong(behind < depth ? behind : depth);
}

/* ---- the types ----------------------------------------------------------------------------- */

#define READ(type, name, kind) {#name, kind, offsetof(type, name), READONLY, NULL}
#define FIELD(name, kind) {#name, kind, offsetof(Subscription, name), 0, NULL}
#define CALL(function) ((PyCFunction)(void (*)(void))(function))

static PyMethodDef topic_methods[] = {
    {"stamp_of", topic_stamp_of, METH_O, "Return the stamp of a stored sample."},
    {"length_of", topic_length_of, METH_O, "Return the length of a stored sample, in bytes."},
    {NULL, NULL, 0, NULL},
};

static PyMemberDef topic_members[] = {
    READ(Topic, kernel, T_OBJECT_EX), READ(Topic, name, T_OBJECT_EX),
    READ(Topic, layout, T_OBJECT_EX), READ(Topic, slots, T_OBJECT_EX),
    READ(Topic, wakes, T_OBJECT_EX), READ(Topic, triggers, T_OBJECT_EX),
    READ(Topic, head, T_LONGLONG), READ(Topic, mask, T_LONGLONG),
    READ(Topic, slot_bytes, T_PYSSIZET), READ(Topic, has_tail, T_BOOL), READ(Topic, large, T_BOOL),
    {NULL, 0, 0, 0, NULL},
};

static PyMethodDef publisher_methods[] = {
    {"publish", CALL(publisher_publish), METH_FASTCALL | METH_KEYWORDS,
     "Publish the message."},
    {"send", publisher_send, METH_VARARGS, "Publish CDR that fits the layout."},
    {"commit", publisher_commit, METH_VARARGS, "Make the message in the next slot a sample."},
    {NULL, NULL, 0, NULL},
};

static PyMemberDef publisher_members[] = {
    READ(End, topic, T_OBJECT_EX), READ(Publisher, published, T_LONGLONG),
    {NULL, 0, 0, 0, NULL},
};

static PyMethodDef subscription_methods[] = {
    {"take", subscription_take, METH_NOARGS, "Copy the oldest unread sample."},
    {"latest", subscription_latest, METH_NOARGS, "Copy the newest sample."},
    {"skip", CALL(subscription_skip), METH_VARARGS | METH_KEYWORDS,
     "Skip a sample without copying it."},
    {NULL, NULL, 0, NULL},
};

static PyMemberDef subscription_members[] = {
    READ(End, topic, T_OBJECT_EX), FIELD(stamp_ns, T_LONGLONG), FIELD(seq, T_LONGLONG),
    FIELD(next_seq, T_LONGLONG), FIELD(lost, T_LONGLONG), FIELD(skipped, T_LONGLONG),
    FIELD(reads, T_LONGLONG), FIELD(length, T_PYSSIZET), FIELD(fresh, T_BOOL),
    {NULL, 0, 0, 0, NULL},
};

static PyGetSetDef publisher_attributes[] = {
    {"buffer", end_buffer, end_set_buffer, "The message that is published next.", NULL},
    {NULL, NULL, NULL, NULL, NULL},
};

static PyGetSetDef subscription_attributes[] = {
    {"buffer", end_buffer, end_set_buffer, "Where samples are copied to.", NULL},
    {"unread", subscription_unread, NULL, "The number of unread samples that are not lost.", NULL},
    {NULL, NULL, NULL, NULL, NULL},
};

static PyType_Slot topic_slots[] = {
    {Py_tp_doc, "The part of a topic that is read and written with each message."},
    {Py_tp_init, topic_init}, {Py_tp_traverse, topic_traverse}, {Py_tp_clear, topic_clear},
    {Py_tp_dealloc, topic_dealloc}, {Py_tp_methods, topic_methods},
    {Py_tp_members, topic_members}, {0, NULL},
};

static PyType_Slot publisher_slots[] = {
    {Py_tp_doc, "The part of a publisher that runs with each message."},
    {Py_tp_init, publisher_init}, {Py_tp_traverse, end_traverse}, {Py_tp_clear, end_clear},
    {Py_tp_dealloc, end_dealloc}, {Py_tp_methods, publisher_methods},
    {Py_tp_members, publisher_members}, {Py_tp_getset, publisher_attributes}, {0, NULL},
};

static PyType_Slot subscription_slots[] = {
    {Py_tp_doc, "The part of a subscription that runs with each message."},
    {Py_tp_init, subscription_init}, {Py_tp_traverse, end_traverse}, {Py_tp_clear, end_clear},
    {Py_tp_dealloc, end_dealloc}, {Py_tp_methods, subscription_methods},
    {Py_tp_members, subscription_members}, {Py_tp_getset, subscription_attributes}, {0, NULL},
};

#define FLAGS (Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE | Py_TPFLAGS_HAVE_GC)
static PyType_Spec specs[] = {
    {"rt_robot_os._core.TopicCore", sizeof(Topic), 0, FLAGS, topic_slots},
    {"rt_robot_os._core.PublisherCore", sizeof(Publisher), 0, FLAGS, publisher_slots},
    {"rt_robot_os._core.SubscriptionCore", sizeof(Subscription), 0, FLAGS, subscription_slots},
};

int
add_ring_types(PyObject *module)
{
    PyTypeObject **types[] = {&topic_type, &publisher_type, &subscription_type};
    for (int i = 0; i < 3; i++) {
        PyObject *type = PyType_FromSpec(&specs[i]);
        if (type == NULL)
            return -1;
        *types[i] = (PyTypeObject *)type;
        if (PyModule_AddObjectRef(module, strrchr(specs[i].name, '.') + 1, type) < 0)
            return -1;
    }
    return 0;
}
